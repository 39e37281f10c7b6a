"""Design of experiments: limits are kept, the expected intervals are those of an identification."""

import numpy as np
import pytest

import spheretwin
from spheretwin.machine import DesignSettings, design, identify
from spheretwin.machine.log import log_of
from spheretwin.models.base.errors import SpheretwinError
from tests.twin.machine.machine_logs import KNOWN, SCENARIO

WANTED = ["torque_scale", "plant.modelling_error"]
SMALL = DesignSettings(duration_s=1.0, candidates=4, payloads_kg=(0.0, 0.1), largest_rate_rad_s=4.0)


@pytest.fixture(scope="module")
def experiment():
    return design(SCENARIO, WANTED, KNOWN, SMALL)


def test_the_motion_keeps_the_limits(experiment):
    for run in experiment.runs:
        assert np.max(np.abs(run["qdot_rad_s"])) <= SMALL.largest_rate_rad_s
        assert np.max(np.abs(run["q_rad"][:, :2])) <= SMALL.largest_angle_rad
        assert np.max(np.abs(run["current_command_A"])) <= SMALL.largest_current_A


def test_the_scenario_is_that_of_the_experiment(experiment):
    run = spheretwin.simulate(experiment.scenario)
    assert np.array_equal(run.telemetry["current_command_A"], experiment.runs[0]["current_command_A"])


def test_the_expected_deviation_is_that_of_the_identification(experiment):
    known = [{"plant.payload_kg": payload_kg} for payload_kg in SMALL.payloads_kg]
    logs = [log_of(run, conditions=one) for run, one in zip(experiment.runs, known, strict=True)]
    result = identify(logs, SCENARIO, WANTED, KNOWN)
    for name, deviation in experiment.deviations.items():
        low, high = result.parameters[name].interval
        # At the values that were found, which differ from the true ones; of the noise alone.
        noise = (high - low) / 3.92 / result.parameters[name].widening
        assert noise == pytest.approx(deviation, rel=0.1)
        assert experiment.narrower[name] == pytest.approx(experiment.reference[name] / deviation)


def test_without_a_motion_within_the_limits_there_is_no_design():
    tight = SMALL.model_copy(update={"largest_current_A": 1e-3, "candidates": 2})
    with pytest.raises(SpheretwinError, match="none of 2"):
        design(SCENARIO, WANTED, KNOWN, tight)
