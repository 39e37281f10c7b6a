"""The closed loop of the nutation as numbers for the peers, without code of the product."""

from typing import NamedTuple

import numpy as np

from spheretwin.electronics.coil import CurrentLag, fill_lag
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.actuator import Actuator
from spheretwin.models.magnetics import TorqueModel, torque_model
from spheretwin.plant.mass_properties import true_model
from spheretwin.plant.mujoco_rotor import MujocoRotor
from spheretwin.scenario.sections import Scenario
from spheretwin.trajectories.disturbances import Draws


class Problem(NamedTuple):
    """One run."""

    scenario: Scenario
    actuator: Actuator
    reference: np.ndarray  # (ticks, 3, 3) angle, rate, acceleration as rows
    disturbance: np.ndarray  # (ticks, 3) N·m, generalised, subtracted in (1), the unknown torque included
    law: dict[str, np.ndarray]  # gains of the law, (3,) each, by their names in a scenario
    nominal_inertia: np.ndarray  # (3,) kg·m²
    inertia: np.ndarray  # (3,) kg·m², the modelling error included
    magnetics: TorqueModel
    drive: CurrentLag
    period_s: float
    step_s: float
    substeps: int


def problem(scenario: Scenario) -> Problem:
    """Return the numbers of a scenario that has no part beyond those of the nutation."""
    actuator, plant, period_s = actuators.load(), scenario.plant, scenario.controller.period_s
    t = period_s * np.arange(scenario.ticks)
    draws = np.random.default_rng(scenario.seed).random(len(t))
    disturbance = scenario.disturbance.sample(t, Draws(lambda: draws, None)) + np.array(
        plant.modelling_torque_Nm
    )
    group = actuator.group
    gains = {
        name: np.array(value)
        for name, value in scenario.controller.model_dump().items()
        if isinstance(value, tuple)
    }
    return Problem(
        scenario=scenario,
        actuator=actuator,
        reference=scenario.trajectory.sample(t),
        disturbance=disturbance,
        law=gains,
        nominal_inertia=np.array(actuator.inertia),
        inertia=(1 + plant.modelling_error) * actuator.inertia,
        magnetics=torque_model(actuator),
        drive=CurrentLag.filled(
            fill_lag,
            group.inductance_H / group.resistance_ohm,
            plant.step_s,
            group.current_limit_A,
            groups=len(actuator.groups),
        )[0],
        period_s=period_s,
        step_s=plant.step_s,
        substeps=scenario.substeps,
    )


def bare_rotor(problem: Problem) -> MujocoRotor:
    """Return the rotor in MuJoCo as the product sets it up."""
    modelling_error = problem.inertia[0] / problem.nominal_inertia[0] - 1
    return MujocoRotor([true_model(mjcf.read(actuators.MJCF_PATH), modelling_error)], problem.step_s, "RK4")
