"""States are lanes of a timeline: each change once, at its time, with its name, for any chunks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.models.telemetry.signals import Signal
from spheretwin.viz.recording.status import StateChanges
from tests.viz.tables import table_of

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
    for first, last in zip([0, *cuts], [*cuts, len(whole)], strict=True):
        for lane in changes.of(whole.rows(first, last)):
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
    assert lanes(whole, sorted(cuts)) == expected
