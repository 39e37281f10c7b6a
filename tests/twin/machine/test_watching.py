"""Watch over a machine: what changed, how large, when, how sure, and silence without a change."""

import numpy as np
import pytest
from scipy.stats import chi2

from spheretwin.machine import Log, Watch, WatchSettings
from spheretwin.machine.change_diagnosis import evidence_of_noise
from spheretwin.machine.explanations import UNNAMED, candidates_of, evidence
from spheretwin.machine.parameters import Machine, selected
from spheretwin.models.base.errors import InputError
from tests.twin.machine.machine_logs import KNOWN, SCENARIO, changing_log
from tests.twin.machine.random_changes import HELD_OUT, outcome_of, random_case

ONE_WEAK = [1.0] * 5 + [0.8] + [1.0] * 12


@pytest.fixture
def watch():
    return Watch(SCENARIO, KNOWN)


OFFSET_rad = np.radians(0.1)
OFFSETS = "sensors.angle_offset_rad"


@pytest.mark.parametrize(
    ("field", "value", "what", "size", "within_s"),
    [
        ("plant.group_gain", [0.97] * 18, "torque_scale", -0.03, 0.8),
        ("plant.group_gain", ONE_WEAK, "plant.group_gain.5", -0.2, 0.8),
        (OFFSETS, [OFFSET_rad, 0.0, 0.0], f"{OFFSETS}.0", OFFSET_rad, 0.5),
        ("plant.coulomb_Nm", [4e-3] * 3, "plant.coulomb_Nm of all hinges", 2e-3, 0.5),
    ],
    ids=["torque", "one group", "offset", "friction"],
)
def test_it_names_what_changed(field, value, what, size, within_s):
    changed_s = float(np.random.default_rng(len(what)).uniform(2.3, 2.7))
    log = changing_log(changed_s + 1.0, (changed_s, field, value))
    (alarm,) = Watch(SCENARIO, KNOWN).advance(log)
    assert alarm.what == what
    assert alarm.size == pytest.approx(size, rel=0.3)
    assert changed_s < alarm.t_s <= changed_s + within_s + 0.1
    assert alarm.onset_s == pytest.approx(changed_s, abs=0.02)
    assert alarm.confidence > 0.9
    assert alarm.shares[what] == alarm.confidence


@pytest.mark.parametrize("changed_s", [2.4, 2.41, 2.4337, 2.45, 2.4683, 2.49])
def test_an_offset_has_its_name_at_any_time_within_a_window(changed_s):
    log = changing_log(3.0, (changed_s, OFFSETS, [0.0, OFFSET_rad, 0.0]))
    (alarm,) = Watch(SCENARIO, KNOWN).advance(log)
    assert alarm.what == f"{OFFSETS}.1"
    assert alarm.onset_s == pytest.approx(changed_s, abs=3e-3)
    assert alarm.size == pytest.approx(OFFSET_rad, rel=0.2)


@pytest.mark.parametrize("lasts_s", [0.1, None], ids=["push", "load"])
@pytest.mark.parametrize(("load_Nm", "seed"), [(0.01, 1), (-0.037, 2)])
def test_a_load_has_its_name_and_its_duration(load_Nm, seed, lasts_s):
    begins_s = float(np.random.default_rng(seed).uniform(2.3, 2.6))
    changes = [(begins_s, "disturbance.load", load_Nm / 0.05)]
    if lasts_s:
        changes.append((begins_s + lasts_s, "disturbance.load", 0.0))
    (alarm,) = Watch(SCENARIO, KNOWN).advance(changing_log(3.4, *changes, seed=seed))
    assert alarm.what == "plant.modelling_torque_Nm of all hinges"
    assert alarm.size == pytest.approx(load_Nm, rel=0.05)
    assert alarm.lasted_s == (pytest.approx(lasts_s, abs=0.01) if lasts_s else None)


def test_a_kick_shorter_than_a_push_is_unexplained():
    changes = (2.4173, "disturbance.load", 0.6), (2.4323, "disturbance.load", 0.0)
    alarm, *_ = Watch(SCENARIO, KNOWN).advance(changing_log(3.2, *changes))
    assert alarm.what == UNNAMED


def test_a_group_with_the_wrong_sign_is_unexplained():
    """No gain within its range does that, and another parameter would explain some of it."""
    gains = [1.0] * 5 + [-1.0] + [1.0] * 12
    alarm, *_ = Watch(SCENARIO, KNOWN).advance(changing_log(3.2, (2.4261, "plant.group_gain", gains)))
    assert alarm.what == UNNAMED


def test_a_change_of_a_parameter_that_is_not_watched_is_unexplained():
    log = changing_log(3.2, (2.417, "disturbance.load", 0.4))
    alarm, *_ = Watch(SCENARIO, KNOWN, ["plant.group_gain", "plant.coulomb_Nm"]).advance(log)
    assert (alarm.what, alarm.size) == (UNNAMED, None)
    assert alarm.confidence > 0.9


def test_the_evidence_has_the_mean_1_without_a_change():
    """Then it exceeds a threshold at most with the inverse of it as probability (Markov)."""
    parameters = selected(["plant.coulomb_Nm"], Machine(SCENARIO, KNOWN).model.actuator)
    candidates = candidates_of(parameters, np.full(3, 2e-3), parameters)
    normal, deviation = np.linspace(-60, 150, 100_001), 0.3 / candidates[0].size
    information = np.full(len(normal), deviation**2)
    logs = evidence(normal * deviation, information, candidates, np.zeros(len(normal), np.int64))
    density = np.exp(logs - 0.5 * normal**2) / np.sqrt(2 * np.pi)
    assert np.trapezoid(density, normal) == pytest.approx(1, abs=1e-3)
    squares, angles = np.linspace(0, 2e4, 4001), np.array([20])
    logs = np.hstack([evidence_of_noise(np.array([value]), angles) for value in squares])
    for factor in logs:
        density = np.exp(factor + chi2.logpdf(squares, angles))
        assert np.trapezoid(density, squares) == pytest.approx(1, abs=1e-3)


def test_friction_below_0_explains_nothing():
    """Residuals that friction of −10 mN·m would explain are no evidence of it: there are 2 mN·m to lose."""
    parameters = selected(["plant.coulomb_Nm"], Machine(SCENARIO, KNOWN).model.actuator)
    candidates = candidates_of(parameters, np.full(3, 2e-3), parameters)
    information = np.full(2, 1e8)
    logs = evidence(np.array([1.0, -1.0]) * 1e-2 * information, information, candidates, np.zeros(2, int))
    assert logs[0] > 4000
    assert logs[1] < logs[0] - 2500


def test_the_evidence_shows_what_raised_an_alarm(watch):
    log = changing_log(3.0, (2.5, "plant.coulomb_Nm", [4e-3] * 3))
    assert watch.advance(log.rows(0, 2500)) == []
    assert 0 <= max(watch.sums.values()) < watch.threshold
    largest, row = dict.fromkeys(watch.sums, 0.0), 2500
    while row < 3000:
        watch.advance(log.rows(row, row + 100))
        row += 100
        largest = {name: max(value, watch.sums[name]) for name, value in largest.items()}
    assert largest["plant.coulomb_Nm of all hinges"] > watch.threshold


@pytest.mark.release("1.2 s; test_it_names_what_changed has the alarms")
def test_a_healthy_machine_is_silent_for_any_cut_of_its_log():
    log = changing_log(8.0, seed=4)
    whole, cut = Watch(SCENARIO, KNOWN), Watch(SCENARIO, KNOWN)
    assert whole.advance(log) == []
    assert not any(cut.advance(log.rows(first, first + 790)) for first in range(0, 8000, 790))
    assert whole.sums == cut.sums
    assert whole.variance < 1.1


def test_the_threshold_is_that_of_the_rate_of_false_alarms():
    watch = Watch(SCENARIO, KNOWN, ["torque_scale"], WatchSettings(window_s=0.2, false_alarms_per_hour=0.5))
    assert np.exp(watch.threshold) == pytest.approx(18_000 / 0.5)  # windows of an hour


@pytest.mark.release("265 logs, 6 min; the tests above have single changes")
def test_the_confidence_is_the_rate_of_right_names():
    """Of machines that change in one of 14 ways, or not, at random times, sizes, hinges and motions.

    Another four kinds were not used while the watch was built. Of these a small gain of a sensor looks like
    an offset in slow motion: 3 of 40 such changes get a wrong name.
    """
    built = [outcome_of(random_case(seed)) for seed in range(225)]
    held_out = [outcome_of(random_case(seed, list(HELD_OUT)[seed % 4])) for seed in range(40)]
    assert not any(outcome.early for outcome in built + held_out)
    assert not any(outcome.alarm for outcome in built if outcome.case.kind == "nothing")
    named = [outcome for outcome in built if outcome.is_named]
    right = np.mean([outcome.is_right for outcome in named])
    assert len(named) > 130
    assert np.mean([outcome.alarm.confidence for outcome in named]) == pytest.approx(right, abs=0.05)
    assert np.mean([outcome.is_right for outcome in held_out]) > 0.9


def test_a_gap_is_not_judged():
    log = changing_log(4.0)
    rows = np.r_[0:2500, 2540:4000]
    gap = Log(log.t_s[rows], log.current_A[rows], log.angle_rad[rows])
    assert Watch(SCENARIO, KNOWN).advance(gap) == []


@pytest.mark.parametrize("shift", [2.3e-3, -8e-3])
def test_the_watch_goes_on_from_the_changed_machine(shift):
    """After an alarm the offset belongs to the machine; back at 0 it is the opposite change."""
    changes = [(2.4137, OFFSETS, [0.0, 0.0, shift]), (3.2671, OFFSETS, [0.0, 0.0, 0.0])]
    alarms = Watch(SCENARIO, KNOWN).advance(changing_log(4.2, *changes))
    assert [alarm.what for alarm in alarms] == [f"{OFFSETS}.2"] * 2
    assert [alarm.size for alarm in alarms] == pytest.approx([shift, -shift], rel=0.2)


def test_what_does_not_fit_is_refused(watch):
    log = changing_log(0.5)
    watch.advance(log.rows(0, 300))
    measured = Log(log.t_s[300:], log.current_A[300:], log.angle_rad[300:], "measured")
    with pytest.raises(InputError, match="expected commanded currents as before, received measured"):
        watch.advance(measured)
