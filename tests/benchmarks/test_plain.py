"""The yardstick does the same work: it follows the product's trace until sgn(s) chatters."""

import importlib.util
from pathlib import Path

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.plant.mass_properties import true_model
from spheretwin.plant.mujoco_rotor import MujocoRotor
from spheretwin.simulation import simulate

TICKS = 30


def test_plain_loop_runs_the_same_physics():
    spec = importlib.util.spec_from_file_location("plain", Path(__file__).with_name("plain.py"))
    plain = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(plain)
    scenario = scenarios.load("nutation")
    table = simulate(scenario).telemetry
    reference = scenario.trajectory.sample(table["t_s"])
    section = scenario.plant
    model = true_model(mjcf.read(actuators.MJCF_PATH), section.modelling_error)
    rotor = MujocoRotor([model], section.step_s, section.integrator)
    rotor.start(np.zeros(3), np.zeros(3))
    actuator = actuators.load()
    law = plain.PlainAfsm(actuator.inertia, scenario.controller.period_s)
    rows = plain.run(
        rotor.model, rotor.data, actuator, scenario, law, reference, table["disturbance_Nm"], TICKS
    )
    names = (
        "q_rad", "qdot_rad_s", "error_rad", "torque_command_Nm", "torque_Nm", "current_command_A",
        "current_A",
    )  # fmt: skip
    scale = {name: np.abs(table[name][:TICKS]).max() for name in names}
    for tick, row in enumerate(rows):
        for name, value in zip(names, row, strict=True):
            # It interpolates f_t linearly between samples 0.25 degrees apart: 1e-4 of the peak.
            np.testing.assert_allclose(value, table[name][tick], atol=1e-3 * scale[name])
