"""Lanes of states and log of a run: each change and each time of saturation once, for any chunks."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.status import QUIET_S, Events, Status
from spheretwin.viz.recording.status import StateChanges
from tests.viz.tables import chunks, table_of

SIGNALS = (
    Signal("t_s", "s", 1, "time"),
    Signal("part", "1", 2, "how a part is", ("first one", "second"), ("works", "open", "short")),
    Signal("alone", "1", 1, "how it is", states=("on", "off")),
    Signal("current_A", "A", 1, "no state"),
)
ROWS = 30


def table(values):
    ticks = np.arange(len(values))
    return table_of(SIGNALS, 0.1 * ticks, part=values[:, :2], alone=values[:, 2], current_A=ticks)


def lanes(whole, cuts):
    changes, result = StateChanges(), {}
    for lane in (lane for rows in chunks(whole, cuts) for lane in changes.of(rows)):
        result.setdefault(lane.entity, []).extend(zip(lane.t_s, lane.states, strict=True))
    return result


@pytest.mark.release("1.1 s; content of telemetry_events has chunks of three sizes")
@given(
    st.lists(
        st.tuples(st.integers(0, 2), st.integers(0, 2), st.integers(0, 1)), min_size=ROWS, max_size=ROWS
    ),
    st.sets(st.integers(1, ROWS - 1)),
)
def test_each_change_is_logged_once_for_any_chunks(values, cuts):
    whole = table(np.array(values, dtype=np.float64))
    expected = {}
    for column, entity in enumerate(("part/first-one", "part/second", "alone")):
        names, before = ("on", "off") if column == 2 else SIGNALS[1].states, 0
        for tick, row in enumerate(values):
            if row[column] != before:
                change = (whole["t_s"][tick], names[row[column]])
                expected.setdefault(entity, []).append(change)
                before = row[column]
    assert lanes(whole, cuts) == expected


TICKS = 200
TICK_s = 0.01

LOG_SIGNALS = (Signal("t_s", "s", 1, "time"), Signal("allocation_scale", "1", 1, "share"))


@pytest.mark.parametrize("status", Status)
def test_every_status_ends_a_log(status):
    events = Events()
    events.of(table_of(LOG_SIGNALS, [0.0, 0.5], allocation_scale=[1.0, 1.0]))
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
    events, results, whole = Events(), [], table_of(LOG_SIGNALS, t_s, allocation_scale=scale)
    for rows in chunks(whole, cuts):
        results += events.of(rows)
    expected = slow_messages(t_s, scale)
    assert [t_s for t_s, _, _ in results] == [t_s for t_s, _ in expected]
    assert all(text in results[i][2] for i, (_, text) in enumerate(expected))
    assert events.end(Status.COMPLETED)[0] == t_s[-1]
