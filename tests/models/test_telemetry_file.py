"""Telemetry streamed to a file: the table of the run, whatever becomes of the process, the disk, the law."""

import os
import resource
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pyarrow.parquet
import pytest

from spheretwin.models import telemetry_file
from spheretwin.models.errors import InputError, SpheretwinError
from spheretwin.models.telemetry import SIGNALS, Signal, Table, read_parquet, width
from spheretwin.models.telemetry_file import TelemetryFile, join

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
    return sorted(folder.glob("*.parquet"))


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


def test_row_groups_are_of_four_parts(tmp_path):
    streamed(path := tmp_path / "run.parquet", table(333), 50).close({})
    described = pyarrow.parquet.ParquetFile(path).metadata
    groups = [described.row_group(i).num_rows for i in range(described.num_row_groups)]
    assert groups == [4 * 64, 64 + 13]


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
    assert "2 parts are kept in" in str(caught.value)
    assert not path.exists()
    assert [len(read_parquet(part)[0]) for part in parts_beside(path)] == [20, 20]


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


def test_what_is_no_part_is_refused(tmp_path):
    with pytest.raises(InputError, match="at least one part"):
        join([], tmp_path / "joined.parquet")
    (foreign := tmp_path / "000000.parquet").write_text("no parquet")
    with pytest.raises(InputError, match="expected a Parquet file of a run"):
        join([foreign], tmp_path / "joined.parquet")
    assert os.listdir(tmp_path) == ["000000.parquet"]


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
    assert len(parts_beside(elsewhere / "real.parquet")) == 3
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
from spheretwin.models import telemetry_file
from spheretwin.models.telemetry import SIGNALS, Table, width
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


def test_a_killed_process_leaves_parts_that_join_to_the_first_rows(tmp_path):
    path = tmp_path / "run.parquet"
    process = streaming(path, 64 * 1500)
    deadline = time.monotonic() + 60
    while not (found := list(tmp_path.glob(".run.parquet.*.parts/00000[4-9].parquet"))):
        assert time.monotonic() < deadline, "waited in vain"
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    assert not path.exists()
    rows = join(parts := parts_beside(path), path)
    assert len(parts) >= 5
    assert found[0] in parts
    assert rows == 64 * len(parts)
    assert read_parquet(path)[0].values.tobytes() == table(64 * 1500).rows(0, rows).values.tobytes()


def limited_to(size):
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def part_size(rows):
    return len(table(rows).values.tobytes())  # random numbers do not compress: at least this much


def refusal(process):
    _, complaint = process.communicate(timeout=60)
    assert process.returncode == 1
    line = complaint.splitlines()[-1]
    assert line.startswith("spheretwin.models.errors.SpheretwinError: output: ")
    return line


def test_a_disk_that_is_full_at_the_end_keeps_all_parts_and_says_so(tmp_path):
    path = tmp_path / "run.parquet"
    size = 3 * part_size(64)  # room for each part, not for the file
    line = refusal(streaming(path, 640, preexec_fn=limited_to(size)))
    parts = parts_beside(path)
    assert len(parts) == 10
    assert f"10 parts are kept in {parts[0].parent}" in line
    assert not path.exists()
    assert join(parts, path) == 640
    assert read_parquet(path)[0].values.tobytes() == table(640).values.tobytes()


def test_a_disk_that_is_full_from_the_first_part_on_leaves_nothing_behind(tmp_path):
    (path := tmp_path / "run.parquet").write_text("what was there before")
    line = refusal(streaming(path, 640, preexec_fn=limited_to(part_size(64) // 2)))
    assert "could not be written" in line
    assert "kept" not in line
    assert os.listdir(tmp_path) == ["run.parquet"]
    assert path.read_text() == "what was there before"


def test_a_disk_that_fills_on_the_way_keeps_what_it_has_and_the_run_goes_on(tmp_path, monkeypatch):
    whole, writes = table(640), []

    def write_parquet(rows, path, metadata):
        if len(writes) == 3:
            raise SpheretwinError("output: no space left on device")
        writes.append(path)
        original(rows, path, metadata)

    original = Table.write_parquet
    monkeypatch.setattr(Table, "write_parquet", write_parquet)
    file = streamed(path := tmp_path / "run.parquet", whole, 10)
    with pytest.raises(SpheretwinError, match=r"no space left on device; 3 parts are kept in"):
        file.close({})
    assert not path.exists()
    monkeypatch.undo()
    assert join(parts_beside(path), path) == 3 * PART_ROWS
    assert read_parquet(path)[0].values.tobytes() == whole.rows(0, 3 * PART_ROWS).values.tobytes()


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
