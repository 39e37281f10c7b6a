"""Validation of a twin: what is wrong is named with its size, and a true twin is accepted."""

from itertools import pairwise

import numpy as np
import pytest

import spheretwin
from spheretwin.machine import shadow, validate
from spheretwin.machine.intervals import Uncertainty
from spheretwin.machine.log import log_of
from spheretwin.machine.model import model_of
from spheretwin.machine.state_estimation import Shadow
from tests.twin.machine.machine_logs import KNOWN, SCENARIO, changing_log


@pytest.fixture(scope="module")
def log():
    return changing_log(3.0, seed=5)


def test_the_true_twin_is_accepted(log):
    result = validate(log, SCENARIO, KNOWN)
    assert result.accepted, result.structure
    # Two standard deviations of 9,000 squares are 3 %; the plant of the log is MuJoCo's.
    assert result.fit.chi2 == pytest.approx(1.0, abs=0.06)
    # Of gamma some 370 edges remain; the mean of as many squares of uniform errors deviates by 0.046.
    for value in result.fit.hinge_chi2.values():
        assert value == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize(
    ("wrong", "what", "size"),
    [
        ({"plant.coulomb_Nm": [1e-3, 2e-3, 2e-3]}, "plant.coulomb_Nm.0", 1e-3),
        ({"plant.payload_kg": 0.09}, "plant.payload_kg", 0.01),
        ({"plant.group_gain": [1.0] * 5 + [0.9] + [1.0] * 12}, "plant.group_gain.5", 0.1),
    ],
)
def test_what_is_wrong_is_named_first(log, wrong, what, size):
    result = validate(log, SCENARIO, {**KNOWN, **wrong})
    assert not result.accepted
    assert result.structure[0].what == what
    assert result.structure[0].size == pytest.approx(size, rel=0.15)
    assert abs(result.structure[0].deviations) > 10


def test_errors_of_identified_values_are_no_structure(log):
    """Friction that is wrong by one standard deviation of the twin; a known value counts as exact."""
    wrong = {**KNOWN, "plant.coulomb_Nm": [1e-3, 2e-3, 2e-3]}

    def structure_of(deviation_Nm):
        uncertainty = Uncertainty(("plant.coulomb_Nm.0",), np.array([[deviation_Nm**2]]))
        return validate(log, SCENARIO, wrong, uncertainty=uncertainty).structure

    assert not structure_of(1e-3)
    exact = {one.what: one.deviations for one in validate(log, SCENARIO, wrong).structure}
    # 1e-12 N·m is 1e-8 of the deviation that the noise gives, of which the variance has the square.
    assert {one.what: one.deviations for one in structure_of(1e-12)} == pytest.approx(exact, rel=1e-9)


def test_bins_hold_every_row_with_the_mean_and_rms_of_their_residuals(log):
    result = validate(log, SCENARIO, {**KNOWN, "plant.coulomb_Nm": [0.0, 2e-3, 2e-3]})
    for hinge in result.fit.hinge_chi2:
        angles = [one for one in result.fit.bins if (one.hinge, one.by) == (hinge, "angle_rad")]
        # The encoder is used where its count changes.
        counts = np.count_nonzero(np.diff(log.angle_rad[: 14 * 200 + 1, 2]))
        assert sum(one.rows for one in angles) == (counts if hinge == "gamma" else 14 * 200)
        assert all(first.high == second.low for first, second in pairwise(angles))
        assert all(abs(one.mean_rad) <= one.rms_rad for one in angles)
    # Missing friction about α: against the motion, so by rate from one sign to the other.
    rates = [one for one in result.fit.bins if (one.hinge, one.by) == ("alpha", "rate_rad_s")]
    assert np.ptp([one.mean_rad for one in rates]) > 1e-4


def test_a_hinge_whose_count_does_not_change_is_not_informative():
    """No innovation and no residual of it is an agreement: its chi-squared was 0.000, and consistent."""
    motion = {"trajectory.amplitude_rad": [0.2, 0.2, 0.0], "duration": 1.0}
    run = spheretwin.simulate(SCENARIO, {**KNOWN, **motion})
    log = log_of(run.telemetry)
    assert np.ptp(log.angle_rad[:, 2]) == 0.0
    for chi2 in (validate(log, SCENARIO, KNOWN).fit.hinge_chi2, shadow(log, SCENARIO, KNOWN).chi2):
        assert np.isnan(chi2["gamma"])
        assert chi2["alpha"] == pytest.approx(1.0, abs=0.15)
    running = Shadow(model_of(SCENARIO, KNOWN))
    running.advance(log)
    assert running.verdict().consistent
    assert "gamma not informative" in running.verdict().text()
