"""Content of the base and of telemetry: messages, checks, user code, columns, series, events, faults."""

import numpy as np

from spheretwin.models.base import errors, files, user_code
from spheretwin.models.base.checks import Check, bound_shares, broken
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.telemetry import csv_series, signals, status
from spheretwin.models.telemetry.fault_log import FaultLog
from spheretwin.models.telemetry.run_record import Change, RunRecord
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.status import Events, Level, Status
from spheretwin.models.telemetry.table import Table, TelemetryBuffer, check_rows, read_parquet
from tests.content.content import content_test, scratch
from tests.content.values import tree


def result(call, *arguments, **named):
    """Return the result of a call as text, or the message of its refusal."""
    try:
        return repr(call(*arguments, **named))
    except (SpheretwinError, ValueError) as error:
        return f"{type(error).__name__}: {error}"


def listed(calls):
    return "\n".join(
        f"{call.__name__}{arguments!r:.150}: {result(call, *arguments)}" for call, arguments in calls
    )


class Raises:
    def __repr__(self):
        raise OSError("no text")


def texts():
    """Texts of errors and values."""
    deep = [1]
    for _ in range(30):
        deep = [deep]
    errors_ = [
        OSError(2, "x", "a.txt"), OSError(2, "x", f"a{errors.HIDDEN}"), OSError(2, "x", "a", None, "b"),
        OSError("plain"), ValueError("a\n b\t c"), ValueError(), RecursionError("deep"),
        UnicodeDecodeError("utf-8", b"\xff", 0, 1, "bad"), KeyError("k"),
    ]  # fmt: skip
    values = [
        None, True, 3, 1.5, "text", "a\nb", b"x", [], [1, None], (1, 2), {}, {"a": [False, {"b": None}]},
        deep, list(range(100)), {i: i for i in range(100)}, np.zeros(3), np.arange(500), np.float64(0.5),
        10**5000, "x" * 500, Raises(), [[[["x"]]]],
    ]  # fmt: skip
    lines = [
        f"{error!r}: {errors.without_breaks(error)} | {errors.exception_text(error)}" for error in errors_
    ]
    lines += [errors.shown(value) for value in values]
    lines += [
        errors.one_line(text)
        for text in ("a\x1b[2Jb", "a\nb", "é", "x" * 5000, "y " * 3000, f"{'z' * 400} end", "a  b")
    ]
    lines += [f"{longest}: {errors.shortened('abcdefghij', longest)}" for longest in range(1, 12)]
    lines += [repr(errors.is_plain(text)) for text in ("a", "é", "\n", "\udcff", "\x7f", "")]
    lines += [
        repr(errors.distinct_texts(*numbers))
        for numbers in (
            (1.0, 2.0), (1.0, 1.0), (1.0, 1.0 + 1e-9), (1.0, 1 + 2**-52), (0.1 + 0.2, 0.3), (1 / 3, 2 / 3),
            (1e300, 1.0, 1.00000001),
        )
    ]  # fmt: skip
    lines += [
        errors.did_you_mean(text, ("hold", "nutation", "tilt")) or "none"
        for text in ("hodl", "nutatoin", "x", "", "t" * 500, "til")
    ]
    lines += [
        str(errors.LawError.of("pd", 0.1234567891, ValueError("lost"))),
        str(errors.InputError("a\x00" + "b" * 3000)),
    ]
    return "\n".join(lines)


CHECKS = [
    Check("low", "a", 3, 0.5, 1.0, "w"), Check("high", "b", 1, 1.5, 1.0, "w", "rad"),
    Check("equal", "c", 1, 1.0, 1.0, "w", "N·m", 1.0),
    Check("between", "d", 1, 0.0123456, 0.02, "w", "s", 0.01, {"x": 1.0, "y": float("nan")}),
    Check("below", "e", 1, 0.005, 0.02, "w", "1", 0.01), Check("nan", "f", 1, float("nan"), 1.0, "w"),
    Check("none", "g", 0, None, 1.0, "w"), Check("free", "h", 1, 123456.0, None, "w", "A"),
    Check("inf", "i", 1, float("inf"), 2e-5, "w"), Check("zero", "j", 1, 0.0, 1e-2, "w"),
]  # fmt: skip


def checks():
    lines = [f"{each.row()} | {each.value_text()} | {each.bound_text()}" for each in CHECKS]
    return "\n".join([*lines, f"{broken(CHECKS)} {bound_shares(CHECKS)}"])


KINDS = "from pathlib import Path\nimport numba\n@numba.njit\ndef step(): pass\n"


def user_files():
    """References to user code, and what is refused of it and of outputs."""
    folder = scratch("user_files")
    for name, text in {
        "good": "from math import sin\ndef law(x):\n    return 2 * x\nVALUE = 3\ndef Other():\n    pass\n",
        "syntax": "x = 1\ndef law(:\n", "raises": "x = 1\n\n\n1 / 0\n",
        "deep": "def f():\n    raise ValueError('a\\nb')\nf()\n", "empty": "", "values": "A = 1\n",
        "quits": "raise SystemExit(3)\n", "paths": "from pathlib import Path\n",
        "missing": "import no_module\n", "kinds": f"{KINDS}class Mine(Path): pass\n",
    }.items():  # fmt: skip
        (folder / f"{name}.py").write_text(text)
    (folder / "bytes.py").write_bytes(b"x = '\xff'\n")
    lines = []
    for reference in (
        "good.py:law", "good.py:lwa", "good.py:VALUE", "good.py:sin", "good.py:", ":law", "good",
        "syntax.py:law", "raises.py:law", "deep.py:f", "empty.py:law", "values.py:law", "none.py:law",
        "a\0.py:law", "quits.py:law", "bytes.py:law", "good.txt:law", "good.py:a b", "paths.py:f",
        "missing.py:f", "kinds.py:x",
    ):  # fmt: skip
        path = f"{folder}/{reference}"
        lines.append(f"{reference}: {user_code.is_reference(path)}")
        for load in (user_code.load_function, user_code.load_named):
            text = result(load, path, "law mine")
            lines.append("  " + (text.partition(" at 0x")[0] if text.startswith("<") else text))
    (folder / "file").write_text("")
    for name in ("new.txt", "file", ".", "none/new.txt", "file/new.txt", "x" * 300):
        writable = result(files.check_writable, folder / name)
        made = result(files.make_folder, folder / "made" / name)
        lines.append(f"{name[:20]}: {writable[:200]} {made[:200]}")
    return "\n".join(lines)


CSV = {
    "good": "t_s,a,b\n0,1,2\n0.5,3,4\n1.5,-1,0\n", "comments": "# c\n\nb, a ,t_s\n# d\n1,2,0\n3,4,1e-3\n",
    "order": "t_s,a,b\n0,1,2\n0,3,4\n", "near": "t_s,a,b\n1,1,2\n1.0000000001,3,4\n",
    "short": "t_s,a,b\n0,1\n", "word": "# x\nt_s,a,b\n0,1,x\n", "large": "t_s,a,b\n0,1,2e9\n",
    "nan": "t_s,a,b\n0,nan,2\n", "missing": "t_s,a\n0,1\n", "twice": "t_s,a,b,a\n0,1,2,3\n", "empty": "",
    "head": "t_s,a,b\n", "long": "t_s,a,b\n1e99,1,2\n", "quote": 't_s,"a",b\n0,"1",2\n',
    "negative": "t_s,a,b\n-1,1,2\n0,1,2\n", "bom": "\ufefft_s,a,b\n0,1,2\n", "nothing": "# nothing\n",
    "semicolons": "t_s;a;b\n0;1;2\n",
    "four": "t_s,a,b\n0,1,2\n3,4,5,6\n", "after a comment": "t_s,a,b\n0,1,2\n\n# so\n3,north,5\n",
    "blank": "t_s,a,b\n3,,5\n", "infinite": "t_s,a,b\n3,4,-inf\n", "wide": "t_s,a,b\n0,1," + "9" * 200_000,
}  # fmt: skip


def series():
    folder, lines = scratch("series"), []
    times = np.array([-1.0, 0.0, 0.25, 0.5 - 1e-13, 0.5 - 1e-9, 0.5, 1.0, 1.5, 2.0])
    for name, text in CSV.items():
        (folder / f"{name}.csv").write_text(text, encoding="utf-8")
        try:
            one = csv_series.read("series", folder / f"{name}.csv", ("a", "b"), 1e9)
        except SpheretwinError as error:
            lines.append(f"{name}: {error}")
            continue
        lines.append(f"{name}: {one.t_s.tolist()} {one.values.tolist()}")
        lines.append(f"  held {one.zero_order_hold(times, (9.0, 8.0)).tolist()}")
        lines.append(f"  between {one.interpolate(times).tolist()}")
    (folder / "bytes.csv").write_bytes(b"\xff")
    names = ("none.csv", "bytes.csv", ".")
    lines += [result(csv_series.read, "series", folder / name, ("a",), 1.0) for name in names]
    lines += [result(csv_series.check_rising, each) for each in ([0, 1], [1, 1], [0, 1, 0.5], [], [0, 1e-10])]
    lines.append(repr(csv_series.reached(np.array([-1.0, 0.0, 1.0, 1e6])).tolist()))
    return "\n".join(lines)


def columns():
    """Signals, their headings and places, and what tables refuse."""
    lines = []
    for arguments in (
        ("a", "rad", 1, "m"), ("a", "rad", 3, "m"), ("a", "rad", 2, "m", ("x", "y")), ("", "rad", 1, "m"),
        (3, "rad", 1, "m"), ("a\n", "rad", 1, "m"), ("a", 1, 1, "m"), ("a", "rad", 0, "m"),
        ("a", "rad", True, "m"), ("a", "rad", 1.0, "m"), ("a", "rad", 1, "m\x00"),
        ("a", "rad", 2, "m", ("x",)), ("a", "rad", 1, "m", ("x,y",)), ("a", "rad", 1, "m", ("",)),
        ("a", "rad", 1, "m", "x"), ("a", "1", 1, "m", (), ("on", "off")),
        ("a", "1", 1, "m", (), ("on", "o,f")), ("a", "1", 1, "m", (), "on"),
        ("a", "1", 1, "m", (), ("on", "")), ("a", "1", 1, "m", (), (1, 2)),
    ):  # fmt: skip
        lines += [f"{arguments}: {result(Signal, *arguments)}"]
    common = signals.common_signals(18)
    lines += [f"{signal}, {[one.name for one in signal.scalars()][:4]}" for signal in common]
    lines += [repr(signals.offsets(common)), repr(signals.width(common))]
    lines.append(result(signals.with_more, {"a": Signal("a", "rad", 1, "m")}, (Signal("a", "rad", 2, "m"),)))
    lines.append(
        result(
            signals.with_more,
            {"a": Signal("a", "rad", 1, "m")},
            (Signal("b", "s", 2, "n"), Signal("a", "rad", 1, "m")),
        )
    )
    pair = (Signal("t_s", "s", 1, "time"), Signal("x_m", "m", 2, "two", ("p", "q"), ("on", "off")))
    table = Table(pair, np.arange(12.0).reshape(4, 3))
    lines += [
        repr(table["t_s"].tolist()),
        repr(table["x_m"].tolist()),
        repr(table.rows(1, 3).values.tolist()),
        result(table.__getitem__, "x_n"),
    ]
    lines += [result(Table, pair, np.zeros((2, 2))), result(Table, pair, np.zeros(3))]
    path = scratch("columns") / "a.parquet"
    table.write_parquet(path, {"k": "v", "ü": "ä"})
    for rows in (True, False):
        again, metadata = read_parquet(path, rows=rows)
        lines.append(f"{again.signals} {again.values.tolist()} {metadata}")
    lines.append(result(read_parquet, path.with_name("none.parquet")))
    for log in (
        np.zeros((2, 3)), np.zeros((2, 4)), np.zeros((2, 3), dtype=np.float32), np.zeros((3, 2)).T,
        [[0.0] * 3], np.zeros(3),
    ):  # fmt: skip
        lines.append(result(check_rows, log, 3))
    buffer = TelemetryBuffer(pair, 5)
    buffer.write(table.rows(0, 2))
    buffer.write(Table((pair[0], Signal("y", "1", 1, "new")), np.array([[7.0, 8.0]])))
    buffer.write(table.rows(2, 3))
    lines.append(f"{[signal.name for signal in buffer.table.signals]} {buffer.table.values.tolist()}")
    return "\n".join(lines)


def record():
    made = RunRecord(
        {"a": {"b": 1}},
        (Change(3, "x", [1, 2]), Change(5, "y", None)),
        9,
        {"f": "d", "g": None},
        {"v": "1"},
        Status.FAILSAFE,
        4,
    )
    texts = made.metadata()
    lines = tree(texts)
    lines.append(repr(RunRecord.from_metadata(texts) == made))
    for change in (
        {"scenario": "3"}, {"scenario": "{"}, {"journal": "[1]"}, {"journal": '[["x", 1, 2]]'},
        {"ticks": "x"}, {"status": "x"}, {"status": "complete"}, {"first_tick": "x"}, {"files": "[]"},
        {"versions": "1"},
    ):  # fmt: skip
        lines.append(f"{change}: {result(RunRecord.from_metadata, {**texts, **change})}")
    for name in texts:
        others = {key: text for key, text in texts.items() if key != name}
        lines.append(f"no {name}: {result(RunRecord.from_metadata, others)}")
    lines += [f"{each!s} {each.level} {each.code} {each.text}" for each in Status]
    lines += [result(status.named, name) for name in ("failsafe", "diverge", "")] + [
        repr(status.BY_CODE),
        str(list(Level)),
    ]
    return "\n".join(lines)


def events():
    """Events and faults of rows in which states change at known ticks, in chunks of several sizes."""
    ticks = 1000
    columns_ = (
        Signal("t_s", "s", 1, "time"),
        Signal("allocation_scale", "1", 1, "scale"),
        Signal(
            "fault",
            "1",
            4,
            "fault",
            ("coil.00", "coil.01", "pot.alpha", "dac.01"),
            ("works", "open", "short"),
        ),
        Signal("group_out", "1", 2, "out", (), ("in use", "known to be out", "found open", "found shorted")),
        Signal("time_to_detection_s", "s", 2, "delay"),
    )
    table = Table(columns_, np.zeros((ticks, 10)))
    table["t_s"][:] = 1e-3 * np.arange(ticks)
    scale = table["allocation_scale"]
    scale[:] = 1.0
    scale[[100, 150, 300, 410, 511, 512]] = [0.5, 0.6, 0.7, 0.123, 0.0, 0.0]
    scale[700] = 0.0
    fault = table["fault"]
    (
        fault[100:300, 0], fault[200:, 1], fault[400:600, 2], fault[500:700, 0], fault[600:, 2],
        fault[0:50, 3],
    ) = 1, 2, 1, 2, 2, 1  # fmt: skip
    out, delay = table["group_out"], table["time_to_detection_s"]
    delay[:] = -1.0
    out[130:, 0], delay[130:, 0] = 1, 0.03
    out[300:500, 0], out[520:, 0], delay[520:, 0] = 0, 2, 0.02
    out[800:, 1], delay[800:, 1] = 3, 0.6
    lines = []
    for size in (1000, 1, 170):
        log, outcome = FaultLog(), Events()
        happened = []
        for first in range(0, ticks, size):
            rows = table.rows(first, first + size)
            log.write(rows)
            happened += outcome.of(rows)
        lines.append(f"chunks of {size}")
        lines += (
            [each.text() for each in log.faults]
            + [repr(each) for each in happened]
            + [repr(outcome.end(Status.COMPLETED))]
        )
    return "\n".join(lines)


CASES = {
    "base_texts": texts, "base_checks": checks, "base_user_files": user_files, "telemetry_series": series,
    "telemetry_columns": columns, "telemetry_record": record, "telemetry_events": events,
}  # fmt: skip


test_content = content_test(CASES)
