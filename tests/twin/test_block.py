"""Runs of a block against each run alone."""

from __future__ import annotations

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import fill_defaults
from spheretwin.loop.block import RunBlock
from spheretwin.metrics import METRICS
from spheretwin.metrics.figures import Figures
from spheretwin.metrics.reduction import PlannedRun
from spheretwin.models.base.columns import MixedRowsError
from spheretwin.scenario.files import files_of
from spheretwin.session import Session
from spheretwin.simulation import follow

RUNS = 4


def random_changes(generator, run, **more):
    """Changes of a run in numbers of every part."""
    return {
        "seed": int(generator.integers(2**40)),
        "plant.modelling_error": generator.uniform(-0.2, 0.5),
        "plant.modelling_torque_Nm": tuple(generator.uniform(-2e-3, 2e-3, 3).tolist()),
        "plant.coulomb_Nm": tuple(generator.uniform(0, 5e-3, 3).tolist()),
        "plant.viscous_Nm_s": tuple(generator.uniform(0, 2e-4, 3).tolist()),
        "plant.payload_kg": generator.uniform(0, 0.05),
        "plant.group_gain": tuple(generator.normal(1, 0.02, 18).tolist()),
        "plant.initial_rad_s": tuple(generator.uniform(-0.1, 0.1, 3).tolist()),
        "disturbance.load": generator.uniform(0, 2) if run else 40.0,  # the first one does not complete
        "disturbance.random_bound_Nm": generator.uniform(0, 0.05),
        "sensors.angle_offset_rad": tuple(generator.normal(0, 2e-3, 3).tolist()),
        **more,
    }


HARDWARE = {
    "ideal": lambda generator: {"controller.law": "pd"},
    "electronics": lambda generator: {
        "sensors.potentiometer.noise_rad": generator.uniform(1e-4, 7e-4),
        "sensors.adc.gain_error": generator.uniform(0, 2e-3),
        "drive.resistance_ohm": generator.normal(1.3, 0.05),
        "drive.inductance_H": generator.normal(9e-4, 4e-5),
        "drive.supply_V": generator.normal(24, 0.6),
        "drive.dac_offset_V": generator.uniform(0, 4e-3),
        "drive.ambient_degC": generator.uniform(15, 40),
        "controller.reaching_gain": tuple(generator.uniform(0.01, 0.05, 3).tolist()),
    },
    "prototype": lambda generator: {
        "plant.stiction.break_away": generator.uniform(1.1, 1.6),
        "plant.cable.stiffness_Nm_rad": tuple(generator.uniform(0, 2e-3, 3).tolist()),
        "drive.coil_coupling": generator.uniform(0.1, 0.9),
        "nominal.delay_s": 1e-3 * float(generator.integers(1, 3)),
        "watchdog.on": True,
    },
}


def alone(scenario):
    """Status, reason and figures of a run of a session."""
    with Session(scenario) as session:
        figures = Figures(PlannedRun(session.initial_scenario, session.actuator, scenario.ticks))
        status = follow(session, scenario.ticks, [figures])
        return status, session.reason, figures.values()


def in_block(every):
    files = files_of(every[0])
    return RunBlock([fill_defaults(own, files, None, None) for own in every], files, METRICS).run()


@pytest.mark.parametrize("engine", ["lagrangian", "mujoco"])
@pytest.mark.parametrize("hardware", HARDWARE)
def test_each_run_is_that_of_its_session(hardware, engine):
    generator = np.random.default_rng()
    every = []
    for run in range(RUNS):
        changes = {"hardware": hardware, "plant.engine": engine, "duration": 1.3}
        changes |= random_changes(generator, run, **HARDWARE[hardware](generator))
        every.append(scenarios.load("sinusoid", changes))
    endings = in_block(every)
    assert len({ending.status for ending in endings}) == 2
    for ending, scenario in zip(endings, every, strict=True):
        assert tuple(ending) == alone(scenario), scenario.model_dump()


def test_faults_act_at_their_own_times():
    every = [
        scenarios.load(
            "sinusoid",
            {
                "hardware": "electronics",
                "duration": 0.5,
                "plant.engine": "lagrangian",
                "seed": k,
                "fault": [{"target": "coil.3", "mode": "open", "start_s": start_s, "detection": True}],
            },
        )
        for k, start_s in enumerate((0.1, 0.2003, 0.7))
    ]
    for ending, scenario in zip(in_block(every), every, strict=True):
        assert tuple(ending) == alone(scenario)


def test_a_run_whose_inputs_do_not_stay_finite_is_left_to_its_session():
    changes = {"plant.engine": "lagrangian", "duration": 250.0, "disturbance.gamma_envelope": "growing"}
    bounds_Nm = 0.0, 0.01
    every = [scenarios.load("hold", {**changes, "disturbance.random_bound_Nm": own}) for own in bounds_Nm]
    first, second = in_block(every)
    assert first.status == "completed"
    assert second is None


def test_refuses_scenarios_that_differ_in_more_than_numbers():
    every = [scenarios.load("hold", {"controller.law": law}) for law in ("pd", "afsm")]
    with pytest.raises(MixedRowsError):
        in_block(every)
