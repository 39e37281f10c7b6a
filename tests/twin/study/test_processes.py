"""Studies in processes of their own: killed and interrupted; no row is lost."""

import json
import signal
import subprocess
import sys

import pytest

from spheretwin import cli
from spheretwin.study.study import load
from tests.twin.study.cases import rows_of, run_rows, table
from tests.waiting import wait_for

SAME_IN_LESS = pytest.mark.release(
    "processes of 1 to 2 s; SIGKILL and SIGINT here, test_journal.py and test_trials.py show the same"
)
PROGRAM = [sys.executable, "-m", "spheretwin"]
LOADS = [0.1 * place for place in range(60)]
SOURCE = f"""
name = "short"
scenario = "sinusoid"
fields = {{duration = 2.0}}
law = [{{law = "pd"}}]
axis = [{{field = "disturbance.load", kind = "values", values = {LOADS}}}]
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Folder of the study, complete."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "short.toml").write_text(SOURCE)
    run_rows(load(str(folder / "short.toml")), folder)
    return folder


@pytest.fixture
def command(tmp_path, whole):
    """Command that sweeps the study into a folder of the test."""
    return [*PROGRAM, "sweep", str(whole / "short.toml"), "--out", str(tmp_path / "out"), "--json"]


def begun(command, folder):
    """A process that has finished some rows, and not all."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_for(lambda: journal_lines(folder) > 4, while_alive=process)
    assert process.poll() is None, process.communicate()
    return process


def journal_lines(folder):
    path = folder / "journal.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def gone_on_with(command, folder, whole, capfd):
    """Run the rest in this process; the table is that of a study that nothing came between."""
    code, (out, err) = cli.main(command[len(PROGRAM) :]), capfd.readouterr()
    assert code == cli.DONE, err
    assert table(folder) == table(whole)
    return json.loads(out)


@pytest.mark.parametrize(
    ("number", "threads"),
    [
        (signal.SIGKILL, "1"),
        pytest.param(signal.SIGKILL, "2", marks=SAME_IN_LESS),
        (signal.SIGINT, "2"),
        pytest.param(signal.SIGTERM, "2", marks=SAME_IN_LESS),
    ],
)
def test_a_signal_loses_no_finished_row(tmp_path, command, whole, capfd, number, threads):
    """An interruption finishes the rows in flight and writes the table; a killed process does neither."""
    folder = tmp_path / "out"
    process = begun([*command, "--threads", threads], folder)
    process.send_signal(number)
    out, err = process.communicate()
    finished = journal_lines(folder) - 1
    assert 4 <= finished < len(LOADS)
    if number == signal.SIGKILL:
        assert not (folder / "table.parquet").exists()
    else:
        assert process.returncode == cli.FAILED
        report = json.loads(out)
        assert (report["rows"], report["of"], len(rows_of(folder))) == (finished, len(LOADS), finished)
        assert f"interrupted after {finished} of 60 rows; the same command continues from there" in err
        assert "Traceback" not in err
    assert gone_on_with(command, folder, whole, capfd)["resumed"] == finished
