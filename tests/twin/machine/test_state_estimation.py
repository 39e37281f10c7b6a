"""Shadow of a machine: accuracy on simulated logs, cuts, wrong models, delay, and what is refused."""

import numpy as np
import pytest

import spheretwin as st
from spheretwin.machine import Log, ShadowSettings, fit_noise, shadow
from spheretwin.machine.log import log_of
from spheretwin.machine.model import model_of
from spheretwin.machine.state_estimation import Shadow
from spheretwin.machine.workflow import NOMINAL
from spheretwin.models.base.errors import InputError
from tests.twin.machine.machine_logs import KNOWN, SCENARIO


@pytest.fixture(scope="module")
def run():
    return st.simulate(SCENARIO, {**KNOWN, "duration": 2.0})


@pytest.fixture(scope="module")
def log(run):
    return log_of(run.telemetry)


@pytest.fixture(scope="module")
def model():
    return model_of(SCENARIO, KNOWN)


def test_it_finds_angles_and_rates(run, log, model):
    """Noise of 0.020 degrees and counts of 0.18 degrees; a Kalman filter's rates are off by 53 mrad/s."""
    quiet = ShadowSettings(disturbance_walk_Nm=1e-4, torque_noise_Nm_s=1e-5)
    result = shadow(log, model, settings=quiet)
    settled = slice(200, None)
    angle = (result.telemetry["q_estimated_rad"] - run.telemetry["q_rad"])[settled]
    rate = (result.telemetry["qdot_estimated_rad_s"] - run.telemetry["qdot_rad_s"])[settled]
    assert np.all(np.degrees(np.sqrt(np.mean(angle**2, axis=0))) < 0.005)
    assert np.all(np.sqrt(np.mean(rate**2, axis=0)) < 0.002)
    assert result.consistent
    assert np.all(result.rms_innovation_rad[:2] == pytest.approx(3.6e-4, rel=0.15))


def test_the_cut_of_a_log_does_not_change_a_bit(log, model):
    whole = shadow(log, model)
    running = Shadow(model)
    parts = [running.advance(log.rows(a, b)) for a, b in ((0, 3), (3, 5), (5, 900), (900, 2000))]
    assert np.array_equal(np.vstack([part.values for part in parts]), whole.telemetry.values)
    assert running.verdict() == (whole.chi2, whole.consistent)
    assert running.log_likelihood == whole.log_likelihood


@pytest.mark.release("2.2 s; test_identification.py finds delays in less")
def test_the_delay_is_found(log, model):
    """The model does not know the delay of 1 ms: the fitted shift has it within its interval."""
    fit = fit_noise(log.rows(0, 1500), model._replace(delay_s=0.0))
    low, high = fit.shift_interval_s
    assert low < 1e-3 < high
    assert high - low < 0.4e-3


def test_a_wrong_model_is_unlikely(log, model):
    good = shadow(log, model)
    for wrong in (-log.current_A, log.current_A[:, ::-1]):
        bad = shadow(Log(log.t_s, wrong, log.angle_rad), model)
        assert bad.log_likelihood < good.log_likelihood - 100


def test_an_estimate_that_diverges_is_not_consistent(log, model):
    bad = shadow(Log(log.t_s, 1e3 * log.current_A, log.angle_rad), model)
    assert not bad.consistent
    assert not all(np.isfinite(value) and value < 2 for value in bad.chi2.values())


def test_measured_currents_are_interpolated_and_not_delayed(run, log, model):
    table = run.telemetry
    measured = Log(table["t_s"], table["current_measured_A"], table["q_measured_rad"], "measured")
    result = shadow(measured, model)
    assert result.consistent
    # Commands that are taken as measured are a delay too early.
    early = shadow(Log(log.t_s, log.current_A, log.angle_rad, "measured"), model)
    assert result.log_likelihood > early.log_likelihood - 20


def test_a_lost_current_is_that_before(log, model):
    current = log.current_A.copy()
    current[500:503, 4] = np.nan
    previous = log.current_A.copy()
    previous[500:503, 4] = previous[499, 4]
    lost, held = (shadow(Log(log.t_s, given, log.angle_rad), model) for given in (current, previous))
    assert np.array_equal(lost.telemetry.values, held.telemetry.values)


def test_an_offset_is_estimated_if_wanted(log, model):
    """The field of the coils knows the pose: an offset of 10 mrad changes the torque of the currents."""
    result = shadow(log, model, settings=ShadowSettings(offset_walk_rad=1e-5))
    assert np.all(result.telemetry["offset_estimated_rad_std"][-1] <= 0.01)


def test_a_known_offset_is_subtracted(log, model):
    shifted = Log(log.t_s, log.current_A, log.angle_rad + 0.01)
    moved = shadow(shifted, model._replace(offset_rad=np.full(3, 0.01)))
    expected = shadow(log, model).telemetry["q_estimated_rad"]
    assert np.allclose(moved.telemetry["q_estimated_rad"], expected, rtol=0, atol=1e-9)


def test_conditions_of_a_log_are_fields_of_its_scenario(log):
    loaded = Log(log.t_s, log.current_A, log.angle_rad, conditions={"plant.payload_kg": 0.05})
    expected = shadow(log, SCENARIO, {**KNOWN, "plant.payload_kg": 0.05})
    assert shadow(loaded, SCENARIO, NOMINAL).log_likelihood == expected.log_likelihood
    with pytest.raises(InputError, match="name or file of a scenario for a log with conditions"):
        shadow(loaded, st.load(SCENARIO, NOMINAL))
