"""Columns of a file: times of any type to the nanosecond, and numbers only where they are asked for."""

from datetime import datetime, timedelta

import numpy as np
import pyarrow as pa
import pytest

from spheretwin.machine.raw_table import RawTable
from spheretwin.models.base.errors import InputError

EPOCH_ns = 1764253053 * 10**9
STEPS_ns = np.arange(5) * 1_000_003  # with float64 seconds since 1970, the last digits would be lost
NS = EPOCH_ns + STEPS_ns
SECONDS = 1e-9 * STEPS_ns


def texts(make):
    return pa.chunked_array([[make(int(ns)) for ns in NS]])


TIMES = {
    "integers": (pa.array(NS), "ns"),
    "unsigned": (pa.array(NS.astype(np.uint64)), "ns"),
    "unsigned beyond int64": (pa.array(NS.astype(np.uint64) + 2**63), "ns"),
    "integers since 1970": (pa.array(NS), None),
    "timestamps": (pa.array(NS).cast(pa.timestamp("ns")), None),
    "timestamps with a zone": (pa.array(NS).cast(pa.timestamp("ns", "Europe/Berlin")), "s"),
    "durations": (pa.array(STEPS_ns).cast(pa.duration("ns")), None),
    "decimals": (pa.array(NS).cast(pa.decimal128(30, 0)), "ns"),
    "texts of integers": (texts(str), "ns"),
    "texts of decimals": (texts(lambda ns: f"{ns // 10**9}.{ns % 10**9:09d}"), "s"),
    "ISO texts": (texts(lambda ns: str(np.datetime64(ns, "ns"))), None),
    "ISO texts with Z": (texts(lambda ns: f"{np.datetime64(ns, 'ns')}Z"), None),
    "array of integers": (NS, "ns"),
}


@pytest.mark.parametrize(("column", "unit"), TIMES.values(), ids=TIMES)
def test_times_are_exact_to_the_nanosecond(column, unit):
    column = column if isinstance(column, np.ndarray | pa.ChunkedArray) else pa.chunked_array([column])
    t_s, _ = RawTable("a", {"t": column}).times("t", unit, 0.0)
    assert t_s == pytest.approx(SECONDS, abs=1e-12)


CLOCKS = {
    "spreadsheet": "%d.%m.%Y %H:%M:%S.%f", "American": "%m/%d/%Y %I:%M:%S.%f %p", "clock": "%H:%M:%S.%f",
    "ISO with an offset": "%Y-%m-%dT%H:%M:%S.%f+01:00", "ISO with a comma": "%Y-%m-%d %H:%M:%S,%f",
}  # fmt: skip


@pytest.mark.parametrize("form", CLOCKS.values(), ids=CLOCKS)
def test_dates_and_clocks_are_read_also_over_midnight(form):
    start = datetime(2025, 11, 27, 23, 59, 59, 998_000)
    cells = [(start + timedelta(milliseconds=step)).strftime(form) for step in range(5)]
    t_s, _ = RawTable("a", {"t": pa.chunked_array([cells])}).times("t", None, 0.0)
    assert t_s - t_s[0] == pytest.approx(1e-3 * np.arange(5), abs=1e-6)


@pytest.mark.parametrize("kind", [pa.time64("ns"), pa.time32("ms")])
def test_clock_times_of_arrow_go_on_after_midnight(kind):
    unit = {"ns": 10**9, "ms": 10**3}[kind.unit]
    ticks = (86_399 * unit + np.arange(3) * unit) % (86_400 * unit)
    column = pa.array(ticks if kind.unit == "ns" else ticks.astype(np.int32)).cast(kind)
    t_s, _ = RawTable("a", {"t": pa.chunked_array([column])}).times("t", None, 0.0)
    assert np.diff(t_s).tolist() == [1.0, 1.0]


def test_durations_with_a_unit_are_read():
    cells = pa.chunked_array([["0 sec", "0.001 sec", "2e-3 sec"]])
    assert RawTable("a", {"t": cells}).times("t", None, 0.0)[0] == pytest.approx([0, 1e-3, 2e-3])
    cells = pa.chunked_array([["0,5 ms", "1,5 ms"]])
    assert RawTable("a", {"t": cells}, decimal=",").times("t", None, 0.0)[0] == pytest.approx([5e-4, 1.5e-3])


@pytest.mark.parametrize("dtype", [np.int64, np.uint32, np.float64])
def test_a_clock_that_starts_again_is_continuous(dtype):
    count = ((2**32 - 2000 + 1000 * np.arange(5)) % 2**32).astype(dtype)
    t_s, _ = RawTable("a", {"t": count}).times("t", "us", 2.0**32)
    assert np.diff(t_s) == pytest.approx(1e-3, abs=1e-9)


def test_a_missing_time_is_none():
    for column in (pa.array([NS[0], None, NS[2]]), pa.array([str(NS[0]), "", str(NS[2])])):
        t_s, notes = RawTable("a", {"t": pa.chunked_array([column])}).times("t", "ns", 0.0)
        assert np.isnan(t_s[1])
        assert t_s[2] == pytest.approx(2 * 1_000_003e-9, abs=1e-12)
        assert notes == ("times from 2025-11-27 14:17:33.000+00:00",)


def test_only_columns_that_are_asked_for_are_converted():
    columns = {
        "id": pa.chunked_array([pa.array([2**64 - 1, 3], pa.uint64())]),
        "flag": pa.chunked_array([["a", "b"]]),
        "x": pa.chunked_array([pa.array([1, None])]),
        "when": pa.chunked_array([pa.array([1, 2], pa.date32())]),
    }
    table = RawTable("a", columns)
    assert np.array_equal(table.numbers("x"), [1.0, np.nan], equal_nan=True)
    with pytest.raises(InputError, match="column flag: expected numbers, received 'a' in row 0"):
        table.numbers("flag")
    with pytest.raises(InputError, match=r"column when: expected numbers, received values of type date32"):
        table.numbers("when")
    with pytest.raises(InputError, match="column flag: expected times, received 'a' in row 0"):
        table.times("flag", None, 0.0)
    numbers = pa.chunked_array([[str(number) for number in range(9)] + ["ERR"]])
    with pytest.raises(InputError, match="column t: expected times, received 'ERR' in row 9"):
        RawTable("a", {"t": numbers}).times("t", "ns", 0.0)
    with pytest.raises(InputError, match=r"expected a column y, received id, flag, x, when"):
        table.numbers("y")
