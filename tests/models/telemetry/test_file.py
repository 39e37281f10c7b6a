"""Telemetry streamed to a file: the table of the run, whatever becomes of the process, the disk, the law."""

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.telemetry import file as telemetry_file
from spheretwin.models.telemetry import parts as telemetry_parts
from spheretwin.models.telemetry.file import TelemetryFile, join
from spheretwin.models.telemetry.signals import Signal, common_signals, width
from spheretwin.models.telemetry.table import PARQUET_FORMAT, Table, read_parquet

SIGNALS = common_signals(18)

PART_ROWS = 64
GAIN, SLIP = Signal("gain", "1", 2, "a law's own"), Signal("slip", "m", 1, "another law's own")
FACTS = {"scenario": '{"a": 1}', "ticks": "0"}


@pytest.fixture(autouse=True)
def _short_parts(monkeypatch):
    monkeypatch.setattr(telemetry_file, "PART_ROWS", PART_ROWS)


def table(rows, signals=SIGNALS, seed=0):
    return Table(signals, np.random.default_rng(seed).normal(size=(rows, width(signals))))


def streamed(path, whole, chunk, facts=FACTS):
    """Write a table chunk by chunk; close is left to the caller."""
    file = TelemetryFile(path, whole.signals, facts)
    for first in range(0, len(whole), chunk):
        file.write(whole.rows(first, first + chunk))
    return file


def parts_beside(path):
    (folder,) = path.parent.glob(f".{path.name}.*.parts")
    return sorted(folder.glob("*.arrows"))


@pytest.mark.parametrize("rows", [0, 1, PART_ROWS - 1, PART_ROWS, PART_ROWS + 1, 5 * PART_ROWS, 333])
def test_the_file_is_the_table(rows, tmp_path):
    whole = table(rows)
    file = streamed(path := tmp_path / "run.parquet", whole, 7)
    file.finish("completed")
    assert not path.exists()
    file.close({"ticks": str(rows)})
    again, metadata = read_parquet(path)
    assert again.signals == SIGNALS
    assert again.values.tobytes() == whole.values.tobytes()
    assert metadata == {"scenario": '{"a": 1}', "ticks": str(rows), "status": "completed"}
    assert os.listdir(tmp_path) == ["run.parquet"]


def test_row_groups_are_of_some_batches(tmp_path):
    group = telemetry_file.GROUP_BATCHES * PART_ROWS
    streamed(path := tmp_path / "run.parquet", table(group + PART_ROWS + 13), 50).close({})
    described = pyarrow.parquet.ParquetFile(path).metadata
    groups = [described.row_group(i).num_rows for i in range(described.num_row_groups)]
    assert groups == [group, PART_ROWS + 13]


def test_a_run_with_parts_is_written_as_a_table_is(tmp_path):
    whole = table(1000)
    streamed(path := tmp_path / "run.parquet", whole, 50).close({"ticks": "1000"})
    arrow, group = whole.arrow({**FACTS, "ticks": "1000"}), telemetry_file.GROUP_BATCHES * PART_ROWS
    pyarrow.parquet.write_table(arrow, other := tmp_path / "other", row_group_size=group, **PARQUET_FORMAT)
    assert path.read_bytes() == other.read_bytes()


def test_parts_are_streams_that_any_arrow_reader_opens(tmp_path):
    whole = table(200)
    streamed(path := tmp_path / "run.parquet", whole, 50)
    (part,) = parts_beside(path)
    with pa.ipc.open_stream(part.read_bytes()) as stream:
        found = stream.read_all()
    assert found.equals(whole.rows(0, 192).arrow(FACTS), check_metadata=True)


def test_chunks_do_not_move_a_byte_of_the_file(tmp_path):
    whole, written = table(333), set()
    for chunk in (1, 20, 63, 64, 65, 200, 333):
        streamed(path := tmp_path / "run.parquet", whole, chunk).close({})
        written.add(path.read_bytes())
    assert len(written) == 1


def test_a_run_without_parts_is_written_as_a_table_is(tmp_path):
    whole = table(PART_ROWS - 1)
    streamed(path := tmp_path / "run.parquet", whole, 10).close({"ticks": "63"})
    whole.write_parquet(other := tmp_path / "other.parquet", {**FACTS, "ticks": "63"})
    assert path.read_bytes() == other.read_bytes()


def test_rows_that_wait_are_no_more_than_a_part(tmp_path):
    file = TelemetryFile(path := tmp_path / "run.parquet", SIGNALS, FACTS)
    whole = table(10 * PART_ROWS)
    for first in range(0, len(whole), 10):
        file.write(whole.rows(first, first + 10))
        assert sum(map(len, file._waiting)) < PART_ROWS
    file.close({})
    assert read_parquet(path)[0].values.tobytes() == whole.values.tobytes()


def test_columns_that_come_and_go_are_nan_where_they_are_not(tmp_path):
    kinds = [(SIGNALS, 30), ((*SIGNALS, GAIN), 100), ((*SIGNALS, SLIP), 1), ((*SIGNALS, SLIP, GAIN), 70)]
    file = TelemetryFile(path := tmp_path / "run.parquet", SIGNALS, FACTS)
    pieces = [table(rows, signals, seed) for seed, (signals, rows) in enumerate(kinds)]
    for piece in pieces:
        for first in range(0, len(piece), 33):
            file.write(piece.rows(first, first + 33))
        file.write(piece.rows(0, 0))  # a chunk in which nothing was run
    file.close({})
    again, _ = read_parquet(path)
    assert again.signals == (*SIGNALS, GAIN, SLIP)
    assert os.listdir(tmp_path) == ["run.parquet"]
    ends = np.cumsum([len(piece) for piece in pieces])
    for piece, start, end in zip(pieces, [0, *ends], ends, strict=False):
        for sig in again.signals:
            found = again[sig.name][start:end]
            if sig in piece.signals:
                assert found.tobytes() == piece[sig.name].tobytes()
            else:
                assert np.all(np.isnan(found))


def test_two_meanings_of_one_column_are_told_apart_and_the_parts_kept(tmp_path):
    other = Signal("gain", "N", 1, "something else")
    file = TelemetryFile(path := tmp_path / "run.parquet", (*SIGNALS, GAIN), FACTS)
    file.write(table(20, (*SIGNALS, GAIN)))
    file.write(table(20, (*SIGNALS, other)))
    with pytest.raises(SpheretwinError) as caught:
        file.close({})
    assert "expected gain as 2 numbers in 1 (a law's own), received 1 in N" in str(caught.value)
    assert "40 rows are kept in" in str(caught.value)
    assert not path.exists()
    assert [join([part], tmp_path / "one.parquet") for part in parts_beside(path)] == [20, 20]


def test_parts_are_joined_under_the_first_one_s_facts(tmp_path):
    whole = table(200)
    file = streamed(path := tmp_path / "run.parquet", whole, 50)
    parts = parts_beside(path)
    joined = tmp_path / "joined.parquet"
    assert join(parts, joined) == 192
    again, metadata = read_parquet(joined)
    assert again.values.tobytes() == whole.rows(0, 192).values.tobytes()
    assert metadata == FACTS
    assert parts_beside(path) == parts  # whose they are may still be at work
    file.close({})
    assert sorted(os.listdir(tmp_path)) == ["joined.parquet", "run.parquet"]


def arrow_stream(path, arrow):
    with pa.OSFile(str(path), "wb") as sink, pa.ipc.new_stream(sink, arrow.schema) as stream:
        stream.write_table(arrow)


def columns(*values, kind=None, described=True):
    words = {"unit": "m", "meaning": "a length", "labels": ""} if described else None
    arrays = [pa.array(column, type=kind) for column in values]
    return pa.table(arrays, schema=pa.schema([pa.field("x", array.type, metadata=words) for array in arrays]))


FOREIGN = {
    "text": lambda path: path.write_text("no stream"),
    "like a stream": lambda path: path.write_bytes(b"\xff\xff\xff\xff\x08\0\0\0" + bytes(8)),
    "parquet": lambda path: table(10).write_parquet(path, FACTS),
    "missing": lambda path: None,
    "folder": lambda path: path.mkdir(),
    "no columns": lambda path: arrow_stream(path, pa.table({})),
    "undescribed": lambda path: arrow_stream(path, columns([1.0], described=False)),
    "whole numbers": lambda path: arrow_stream(path, columns([1])),
    "texts": lambda path: arrow_stream(path, columns([["a"]], kind=pa.list_(pa.string(), 1))),
    "vectors of any length": lambda path: arrow_stream(path, columns([[1.0], []])),
    "two of a name": lambda path: arrow_stream(path, columns([1.0], [1.0])),
}


@pytest.mark.parametrize("kind", FOREIGN)
@pytest.mark.parametrize("after_a_good_one", [False, True])
def test_what_is_no_part_is_refused(kind, after_a_good_one, tmp_path):
    foreign, good = tmp_path / "000001.arrows", tmp_path / "000000.arrows"
    FOREIGN[kind](foreign)
    arrow_stream(good, table(10).arrow(FACTS))
    before = sorted(os.listdir(tmp_path))
    with pytest.raises(InputError, match="expected an Arrow stream of a run") as caught:
        join([good, foreign] if after_a_good_one else [foreign], tmp_path / "joined.parquet")
    assert str(foreign) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert sorted(os.listdir(tmp_path)) == before


def test_no_part_at_all_is_refused(tmp_path):
    with pytest.raises(InputError, match="at least one part"):
        join([], tmp_path / "joined.parquet")
    assert os.listdir(tmp_path) == []


# --- torn streams


@pytest.fixture(scope="module")
def stream(tmp_path_factory):
    """A table, the part that has it in three batches, and where each message of the part ends."""
    whole, ends = table(15, (*SIGNALS[:2], GAIN)), []
    parts = telemetry_parts.Parts(tmp_path_factory.mktemp("stream") / "run.parquet", FACTS)
    for first in (0, 5, 10):
        parts.append(whole.rows(first, first + 5))
        ends.append(parts.paths[0].stat().st_size)  # it has reached the operating system
    parts.close()
    content = parts.paths[0].read_bytes()
    parts.remove()
    return whole, content, [8 + int.from_bytes(content[4:8], "little"), *ends]


def test_wherever_a_stream_is_torn_its_whole_batches_are_taken(stream, tmp_path):
    whole, content, ends = stream
    part, path = tmp_path / "000000.arrows", tmp_path / "joined.parquet"
    for size in range(ends[1], len(content) + 1):
        part.write_bytes(content[:size])
        rows = 5 * sum(size >= end for end in ends[1:])
        assert join([part], path) == rows
        again, metadata = read_parquet(path)
        assert again.values.tobytes() == whole.rows(0, rows).values.tobytes()
        assert metadata == FACTS


def test_a_stream_that_is_torn_before_it_has_a_whole_batch_is_refused(stream, tmp_path):
    _, content, ends = stream
    (part := tmp_path / "000000.arrows").touch()
    for size in range(ends[1]):
        part.write_bytes(content[:size])
        with pytest.raises(InputError, match="expected a part with a whole batch of rows") as caught:
            join([part], tmp_path / "joined.parquet")
        assert str(part) in str(caught.value)
        assert "\n" not in str(caught.value)
    assert os.listdir(tmp_path) == ["000000.arrows"]


def test_wherever_the_last_part_is_torn_those_before_it_are_taken(stream, tmp_path):
    whole, content, ends = stream
    first, last, path = tmp_path / "000000.arrows", tmp_path / "000001.arrows", tmp_path / "joined.parquet"
    arrow_stream(first, (before := table(7)).arrow({"scenario": "the first"}))
    for size in (0, 3, 4, 7, 8, ends[0] - 1, ends[0], ends[0] + 1, ends[1] - 1, ends[1], ends[2] + 9):
        last.write_bytes(content[:size])
        rows = 5 * sum(size >= end for end in ends[1:])
        assert join([first, last], path) == 7 + rows
        again, metadata = read_parquet(path)
        assert metadata == {"scenario": "the first"}
        assert again["q_rad"][:7].tobytes() == before["q_rad"].tobytes()
        assert again["q_rad"][7:].tobytes() == whole["q_rad"][:rows].tobytes()
        assert (GAIN in again.signals) == (size >= ends[0])


def test_a_torn_part_before_the_last_is_refused(stream, tmp_path):
    _, content, ends = stream
    first, last = tmp_path / "000000.arrows", tmp_path / "000001.arrows"
    last.write_bytes(content)
    for size in (0, ends[0] - 1, ends[1] + 1):  # rows would be missing in the midst of the file
        first.write_bytes(content[:size])
        with pytest.raises(InputError, match=r"000000\.arrows: expected only the last part to be torn"):
            join([first, last], tmp_path / "joined.parquet")
    assert sorted(os.listdir(tmp_path)) == ["000000.arrows", "000001.arrows"]


def test_where_no_file_can_be_made_is_found_out_at_once(tmp_path):
    for path in (tmp_path, tmp_path / "missing" / "run.parquet"):
        with pytest.raises(InputError, match="output: expected"):
            TelemetryFile(path, SIGNALS, {})
    assert os.listdir(tmp_path) == []


def test_a_link_stays_a_link_and_parts_lie_beside_the_file_itself(tmp_path):
    (elsewhere := tmp_path / "disk").mkdir()
    (link := tmp_path / "run.parquet").symlink_to("disk/real.parquet")
    whole = table(200)
    file = streamed(link, whole, 50)
    assert len(parts_beside(elsewhere / "real.parquet")) == 1
    assert sorted(os.listdir(tmp_path)) == ["disk", "run.parquet"]
    file.close({})
    assert link.is_symlink()
    assert os.listdir(elsewhere) == ["real.parquet"]
    assert read_parquet(link)[0].values.tobytes() == whole.values.tobytes()


def test_a_file_that_was_there_stays_until_the_new_one_is_whole(tmp_path):
    (path := tmp_path / "run.parquet").write_text("what was there before")
    file = streamed(path, table(200), 50)
    assert path.read_text() == "what was there before"
    file.close({})
    assert len(read_parquet(path)[0]) == 200


# --- other processes

STREAM = """
import sys
import numpy as np
from pathlib import Path
from spheretwin.models.telemetry import file as telemetry_file
from spheretwin.models.telemetry.signals import width, common_signals
from spheretwin.models.telemetry.table import Table

SIGNALS = common_signals(18)
telemetry_file.PART_ROWS = 64
path, rows, seed, pause = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4] == "pause"
whole = Table(SIGNALS, np.random.default_rng(seed).normal(size=(rows, width(SIGNALS))))
file = telemetry_file.TelemetryFile(path, SIGNALS, {"scenario": '{"a": 1}', "ticks": "0"})
for first in range(0, rows, 10):
    file.write(whole.rows(first, first + 10))
if pause:
    print("written", flush=True)
    sys.stdin.read()
file.close({})
"""


def streaming(path, rows, seed=0, pause=False, **options):
    command = [sys.executable, "-c", STREAM, str(path), str(rows), str(seed), "pause" if pause else "go"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, text=True, **pipes, **options)


def kill(process):
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL


def test_a_process_killed_while_it_writes_leaves_its_first_rows(tmp_path):
    path = tmp_path / "run.parquet"
    process = streaming(path, 64 * 1500)
    deadline = time.monotonic() + 60
    while sum(part.stat().st_size for part in tmp_path.glob(".run.parquet.*.parts/*")) < size_of(64 * 6):
        assert time.monotonic() < deadline, "waited in vain"
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.001)
    kill(process)
    assert not path.exists()
    rows = join(parts_beside(path), path)
    assert rows % 64 == 0
    assert rows >= 64 * 5  # a sixth batch may be torn: the stream is longer than its rows
    assert read_parquet(path)[0].values.tobytes() == table(64 * 1500).rows(0, rows).values.tobytes()


def test_a_killed_process_loses_only_the_rows_that_waited(tmp_path):
    process = streaming(path := tmp_path / "run.parquet", 64 * 5 + 63, pause=True)
    assert process.stdout.readline() == "written\n"
    kill(process)
    assert join(parts_beside(path), path) == 64 * 5
    assert read_parquet(path)[0].values.tobytes() == table(64 * 5 + 63).rows(0, 64 * 5).values.tobytes()


def limited_to(size):
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def size_of(rows):
    return table(rows).values.nbytes


def full_disk(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def refusal(process):
    _, complaint = process.communicate(timeout=60)
    assert process.returncode == 1
    line = complaint.splitlines()[-1]
    assert line.startswith("spheretwin.models.base.errors.SpheretwinError: output: ")
    return line


def test_a_disk_that_is_full_at_the_end_keeps_all_rows_and_says_so(tmp_path):
    process = streaming(path := tmp_path / "run.parquet", 640, pause=True)
    assert process.stdout.readline() == "written\n"
    room = size_of(640) // 2  # random numbers do not compress by half
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (room, room))
    line = refusal(process)
    (part,) = parts_beside(path)
    assert f"640 rows are kept in {part.parent}" in line
    assert os.listdir(tmp_path) == [part.parent.name]
    assert join([part], path) == 640
    assert read_parquet(path)[0].values.tobytes() == table(640).values.tobytes()


def test_a_disk_that_is_full_in_the_midst_of_a_batch_keeps_those_before(tmp_path):
    path = tmp_path / "run.parquet"
    room = size_of(64 * 7 + 32)  # seven batches, the few kB that describe them, and some of the eighth
    line = refusal(streaming(path, 640, preexec_fn=limited_to(room)))
    (part,) = parts_beside(path)
    assert part.stat().st_size == room
    assert f"{64 * 7} rows are kept in {part.parent}" in line
    assert not path.exists()
    assert join([part], path) == 64 * 7
    assert read_parquet(path)[0].values.tobytes() == table(640).rows(0, 64 * 7).values.tobytes()


def test_a_disk_that_is_full_from_the_first_part_on_leaves_nothing_behind(tmp_path):
    (path := tmp_path / "run.parquet").write_text("what was there before")
    line = refusal(streaming(path, 640, preexec_fn=limited_to(size_of(64) // 2)))
    assert "could not be written" in line
    assert "kept" not in line
    assert os.listdir(tmp_path) == ["run.parquet"]
    assert path.read_text() == "what was there before"


@pytest.mark.parametrize("signals", [SIGNALS, (*SIGNALS, GAIN)], ids=["same", "new"])
def test_a_disk_that_fills_on_the_way_keeps_what_it_has_and_the_run_goes_on(signals, tmp_path, monkeypatch):
    file = streamed(path := tmp_path / "run.parquet", whole := table(3 * PART_ROWS), 10)
    monkeypatch.setattr(pa.ipc.RecordBatchStreamWriter, "write_table", full_disk)
    more = table(300, signals)
    for first in range(0, len(more), 10):
        file.write(more.rows(first, first + 10))
    monkeypatch.undo()
    with pytest.raises(SpheretwinError, match=r"No space left on device; 192 rows are kept in"):
        file.close({})
    assert not path.exists()
    (part,) = parts_beside(path)
    assert os.listdir(part.parent) == [part.name]
    assert join([part], path) == 192
    assert read_parquet(path)[0].values.tobytes() == whole.values.tobytes()


def test_two_processes_to_one_path_each_write_a_whole_file(tmp_path):
    path = tmp_path / "run.parquet"
    both = [streaming(path, rows, seed, pause=True) for rows, seed in ((300, 1), (500, 2))]
    for process in both:
        assert process.stdout.readline() == "written\n"
    assert len(list(tmp_path.glob(".run.parquet.*.parts"))) == 2
    for process, (rows, seed) in zip(both, ((300, 1), (500, 2)), strict=True):
        _, complaint = process.communicate(timeout=60)
        assert process.returncode == 0, complaint
        assert read_parquet(path)[0].values.tobytes() == table(rows, seed=seed).values.tobytes()
    assert os.listdir(tmp_path) == ["run.parquet"]


def test_two_processes_that_close_together_leave_one_of_the_two(tmp_path):
    path = tmp_path / "run.parquet"
    both = [streaming(path, 300, seed, pause=True) for seed in (1, 2)]
    for process in both:
        assert process.stdout.readline() == "written\n"
    with ThreadPoolExecutor(2) as pool:
        complaints = [said[1] for said in pool.map(lambda process: process.communicate(timeout=60), both)]
    assert [process.returncode for process in both] == [0, 0], complaints
    assert os.listdir(tmp_path) == ["run.parquet"]
    either = {table(300, seed=seed).values.tobytes() for seed in (1, 2)}
    assert read_parquet(path)[0].values.tobytes() in either
