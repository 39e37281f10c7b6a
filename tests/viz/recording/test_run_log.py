"""Log of a run: each time of saturation once, and every way to end."""

import numpy as np
import pytest

from spheretwin.models.telemetry.signals import Signal, width
from spheretwin.models.telemetry.status import QUIET_S, Events, Level, Status
from spheretwin.models.telemetry.table import Table

SIGNALS = (
    Signal("t_s", "s", 1, "time"),
    Signal("allocation_scale", "1", 1, "share"),
)


def rows(t_s, scale):
    table = Table(SIGNALS, np.zeros((len(t_s), width(SIGNALS))))
    table["t_s"][:], table["allocation_scale"][:] = t_s, scale
    return table


@pytest.mark.parametrize("status", Status)
def test_every_status_ends_a_log(status):
    events = Events()
    events.of(rows([0.0, 0.5], [1.0, 1.0]))
    assert events.end(status) == (0.5, status.level, status.text)


def test_a_lost_rank_is_an_event_of_its_own():
    t_s = np.arange(6) * 1.0
    found = Events().of(rows(t_s, [1.0, 0.5, 0.0, 1.0, 0.0, 0.5]))
    assert [event[0] for event in found] == [1.0, 2.0, 4.0, 5.0]
    assert ["rank lost" in event[2] for event in found] == [False, True, True, False]
    assert ["current limit" in event[2] for event in found] == [True, False, False, True]


def test_a_time_at_the_limit_is_one_event():
    t_s = np.arange(1000) * 1e-3
    scale = np.ones(1000)
    scale[100:200:3] = 0.5  # chatters at the limit
    scale[200 + round(1000 * QUIET_S) :] = 0.25
    events = Events()
    found = []
    for first, last in ((0, 150), (150, 400), (400, 1000)):  # a chunk ends amid each
        found += events.of(rows(t_s[first:last], scale[first:last]))
    assert [event[0] for event in found] == [pytest.approx(0.1), pytest.approx(0.3)]
    assert {event[1] for event in found} == {Level.WARN}
    assert "50 %" in found[0][2]
