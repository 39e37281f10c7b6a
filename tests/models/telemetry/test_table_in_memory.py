"""A run in memory: every row in its order."""

import numpy as np

from spheretwin.models.telemetry.signals import Signal, width
from spheretwin.models.telemetry.table import Table, TelemetryBuffer

TIME, RATE = Signal("t_s", "s", 1, "time"), Signal("w", "rad/s", 3, "rate")


def rows(signals, first, count):
    shape = count, width(signals)
    return Table(signals, first + np.arange(np.prod(shape), dtype=float).reshape(shape))


def test_all_rows_are_there_in_their_order():
    buffer = TelemetryBuffer((TIME, RATE), 10)
    chunks = [rows((TIME, RATE), 100 * i, count) for i, count in enumerate((3, 0, 5))]
    for chunk in chunks:
        buffer.write(chunk)
    np.testing.assert_array_equal(buffer.table.values, np.concatenate([chunk.values for chunk in chunks]))
    assert buffer.table.signals == (TIME, RATE)
