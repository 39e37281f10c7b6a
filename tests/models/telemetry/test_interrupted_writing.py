"""Telemetry of a process that is killed and of a disk that fills up."""

import errno
import os
import resource
import signal
import subprocess
import sys
import weakref
from concurrent.futures import ThreadPoolExecutor

import pyarrow as pa
import pyarrow.parquet
import pytest

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.telemetry.parquet import join
from spheretwin.models.telemetry.partial_files import list_of
from spheretwin.models.telemetry.table import read_parquet
from tests.models.telemetry.streams import GAIN, PART_ROWS, SIGNALS, parts_beside, streamed, table

pytestmark = pytest.mark.usefixtures("short_parts")

STREAM = """
import sys
from pathlib import Path
from spheretwin.models.telemetry import parquet
from tests.models.telemetry.streams import PART_ROWS, streamed, table
parquet.PART_ROWS = PART_ROWS
path, rows, pause = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3] == "pause"
file = streamed(path, table(rows), 10)
if pause:
    print("written", flush=True)
    sys.stdin.read()
file.close({})
"""


def streaming(path, rows, pause=False, **options):
    command = [sys.executable, "-c", STREAM, str(path), str(rows), "pause" if pause else "go"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, text=True, **pipes, **options)


def kill(process):
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL


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
    _, complaint = process.communicate()
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
    late = table(10, signals)
    values = weakref.ref(late.values)
    file.write(late)
    del late
    assert values() is None  # however long the run goes on, its rows fill no memory
    monkeypatch.undo()
    with pytest.raises(SpheretwinError, match=r"No space left on device; 192 rows are kept in"):
        file.close({})
    assert not path.exists()
    (part,) = parts_beside(path)
    assert sorted(os.listdir(part.parent)) == [part.name, list_of(part).name]
    assert join([part], path) == 192
    assert read_parquet(path)[0].values.tobytes() == whole.values.tobytes()


@pytest.mark.release("two processes, 1 s; test_files.py has two writers of one path")
def test_two_processes_that_close_together_leave_one_of_the_two(tmp_path):
    path = tmp_path / "run.parquet"
    both = [streaming(path, rows, pause=True) for rows in (300, 200)]
    for process in both:
        assert process.stdout.readline() == "written\n"
    assert len(list(tmp_path.glob(".run.parquet.*.parts"))) == 2
    with ThreadPoolExecutor(2) as pool:
        complaints = [said[1] for said in pool.map(lambda process: process.communicate(), both)]
    assert [process.returncode for process in both] == [0, 0], complaints
    assert os.listdir(tmp_path) == ["run.parquet"]
    either = {table(rows).values.tobytes() for rows in (300, 200)}
    assert read_parquet(path)[0].values.tobytes() in either
