"""Watch over a machine: what changed, how large, how fast, and silence without a change."""

from types import SimpleNamespace

import numpy as np
import pytest

from spheretwin.machine import Log, Watch, WatchSettings
from spheretwin.models.base.errors import InputError
from tests.twin.machine.machine_logs import KNOWN, SCENARIO, changing_log

CHANGED_s = 2.5
ONE_WEAK = [1.0] * 5 + [0.8] + [1.0] * 12


@pytest.fixture
def watch():
    return Watch(SCENARIO, KNOWN)


OFFSET_rad = np.radians(0.1)


@pytest.mark.parametrize(
    ("field", "value", "what", "size", "within_s"),
    [
        ("plant.group_gain", [0.97] * 18, "torque_scale", -0.03, 0.8),
        ("plant.group_gain", ONE_WEAK, "plant.group_gain.5", -0.2, 0.8),
        ("sensors.angle_offset_rad", [OFFSET_rad, 0.0, 0.0], "sensors.angle_offset_rad.0", OFFSET_rad, 0.2),
        ("plant.coulomb_Nm", [4e-3] * 3, "plant.coulomb_Nm of all hinges", 2e-3, 0.3),
    ],
    ids=["torque", "one group", "offset", "friction"],
)
def test_it_names_what_changed(field, value, what, size, within_s):
    log = changing_log(CHANGED_s + 1.0, (CHANGED_s, field, value))
    alarm, *_ = Watch(SCENARIO, KNOWN).advance(log)
    assert alarm.what == what
    assert alarm.size == pytest.approx(size, rel=0.4)  # of a few tenths of a second
    assert CHANGED_s < alarm.t_s <= CHANGED_s + within_s + 0.1
    assert alarm.confidence > 0.9


def test_the_sums_show_what_raised_an_alarm(watch):
    log = changing_log(3.0, (CHANGED_s, "plant.coulomb_Nm", [4e-3] * 3))
    assert watch.advance(log.rows(0, 2500)) == []
    assert 0 <= max(watch.sums.values()) < watch.threshold
    alarms, row = [], 2500
    while not alarms:  # of the last window
        alarms, row = watch.advance(log.rows(row, row + 100)), row + 100
    assert watch.sums[alarms[0].what] > watch.threshold


@pytest.mark.release("1.2 s; test_it_names_what_changed has the alarms")
def test_a_healthy_machine_is_silent_for_any_cut_of_its_log():
    log = changing_log(8.0, seed=4)
    whole, cut = Watch(SCENARIO, KNOWN), Watch(SCENARIO, KNOWN)
    assert whole.advance(log) == []
    assert not any(cut.advance(log.rows(first, first + 790)) for first in range(0, 8000, 790))
    assert np.array_equal(whole._sums, cut._sums)
    assert whole.variance < 1.1


def test_the_threshold_is_that_of_the_rate_of_false_alarms():
    """Lorden: the mean time to a false alarm of one sum is at least exp(threshold) windows."""
    watch = Watch(SCENARIO, KNOWN, ["torque_scale"], WatchSettings(window_s=0.2, false_alarms_per_hour=0.5))
    # Up, down and the doubled variance; 18,000 windows an hour.
    assert np.exp(watch.threshold) == pytest.approx(3 * 18_000 / 0.5)


def test_the_sums_of_pure_noise_exceed_a_threshold_as_rarely_as_stated():
    """Normal residuals without a plant: the sums are those of the watch, with a threshold of 100 windows."""
    watch = Watch(SCENARIO, KNOWN, ["torque_scale", "plant.coulomb_Nm"])
    watch.threshold, generator = np.log(100 * len(watch._sums)), np.random.default_rng(1)
    rows, count, alarms = 60, len(watch._values), 0
    for _ in range(20_000):
        slopes = generator.normal(0, 3, (rows, count)) / watch._changes[:count]
        residual = generator.normal(0, 1, rows)
        sums = {"information": slopes.T @ slopes, "gradient": slopes.T @ residual}
        part = SimpleNamespace(**sums, squares=residual @ residual, used=rows)
        alarms += len(watch._add(part, 0.0))
        watch._values[:] = 1.0
    # 200 at most on average; named after some windows at times, so fewer.
    assert 0 < alarms <= 200


def test_a_gap_is_not_judged():
    log = changing_log(4.0)
    rows = np.r_[0:2500, 2540:4000]
    gap = Log(log.t_s[rows], log.current_A[rows], log.angle_rad[rows])
    assert Watch(SCENARIO, KNOWN).advance(gap) == []


def test_what_does_not_fit_is_refused(watch):
    log = changing_log(0.5)
    watch.advance(log.rows(0, 300))
    measured = Log(log.t_s[300:], log.current_A[300:], log.angle_rad[300:], "measured")
    with pytest.raises(InputError, match="expected commanded currents as before, received measured"):
        watch.advance(measured)
