"""A run in memory: every row, and a column for each signal that it ever had."""

import numpy as np

from spheretwin.models.telemetry.signals import Signal, width
from spheretwin.models.telemetry.table import Table, TelemetryBuffer

TIME, RATE, GAIN = Signal("t_s", "s", 1, "time"), Signal("w", "rad/s", 3, "rate"), Signal("g", "1", 1, "gain")


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


def test_a_column_that_comes_or_goes_is_nan_where_it_was_not():
    buffer = TelemetryBuffer((TIME, RATE), 6)
    first, second = rows((TIME, RATE), 0, 2), rows((TIME, GAIN), 50, 3)
    buffer.write(first)
    buffer.write(second)
    buffer.write(last := rows((TIME, RATE), 90, 1))
    table = buffer.table
    assert table.signals == (TIME, RATE, GAIN)
    np.testing.assert_array_equal(table["t_s"], [*first["t_s"], *second["t_s"], *last["t_s"]])
    np.testing.assert_array_equal(table["w"], [*first["w"], *np.full((3, 3), np.nan), *last["w"]])
    np.testing.assert_array_equal(table["g"], [np.nan, np.nan, *second["g"], np.nan])
