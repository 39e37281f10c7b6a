"""Log of a run: each time of saturation once, and every way to end."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.status import QUIET_S, Events, Status
from tests.viz.tables import table_of

TICKS = 200
TICK_s = 0.01

SIGNALS = (Signal("t_s", "s", 1, "time"), Signal("allocation_scale", "1", 1, "share"))


@pytest.mark.parametrize("status", Status)
def test_every_status_ends_a_log(status):
    events = Events()
    events.of(table_of(SIGNALS, [0.0, 0.5], allocation_scale=[1.0, 1.0]))
    assert events.end(status) == (0.5, status.level, status.text)


def slow_messages(t_s, scale):
    """A slow copy: a tick at a limit is a message unless the same limit acted shortly before it."""
    return [
        (t_s[tick], "rank lost" if scale[tick] == 0 else f"{100 * scale[tick]:.0f} %")
        for tick in range(len(t_s))
        if scale[tick] < 1
        and not any(
            (scale[before] == 0) == (scale[tick] == 0)
            for before in np.flatnonzero((scale[:tick] < 1) & (t_s[tick] - t_s[:tick] <= QUIET_S))
        )
    ]


# The last tick of a chunk and the first of the next one; a pause that is over just after an edge.
@example([(99, 0.5), (100, 0.25)], {100})
@example([(99, 0.5), (100, 0.0), (101, 0.5)], {100, 101})
@example([(50, 0.5), (61, 0.5), (71, 0.5)], {51, 60, 61, 62})
@given(
    st.lists(st.tuples(st.integers(0, TICKS - 1), st.sampled_from([0.0, 0.25, 0.5])), max_size=12),
    st.sets(st.integers(1, TICKS - 1)),
)
def test_limits_are_reported_once_for_any_chunks(limited, cuts):
    t_s, scale = TICK_s * np.arange(TICKS), np.ones(TICKS)
    for tick, value in limited:
        scale[tick] = value
    events, results, whole = Events(), [], table_of(SIGNALS, t_s, allocation_scale=scale)
    for first, last in zip([0, *sorted(cuts)], [*sorted(cuts), TICKS], strict=True):
        results += events.of(whole.rows(first, last))
    expected = slow_messages(t_s, scale)
    assert [t_s for t_s, _, _ in results] == [t_s for t_s, _ in expected]
    assert all(text in results[i][2] for i, (_, text) in enumerate(expected))
    assert events.end(Status.COMPLETED)[0] == t_s[-1]
