"""Studies in processes of their own: killed, interrupted, out of room, two at once; no row is lost."""

import json
import resource
import signal
import subprocess
import sys

import pytest

from spheretwin import cli
from tests.twin.study.cases import rows_of, run_rows, study, table, values
from tests.waiting import wait_for

PROGRAM = [sys.executable, "-m", "spheretwin"]
LOADS = [0.1 * place for place in range(60)]
MANY = study(values("disturbance.load", *LOADS), law=[{"law": "pd"}], fields={"duration": 2.0})
SOURCE = f"""
name = "short"
scenario = "sinusoid"
fields = {{duration = 2.0}}
law = [{{law = "pd"}}]
axis = [{{field = "disturbance.load", kind = "values", values = {LOADS}}}]
"""


@pytest.fixture
def command(tmp_path):
    """What sweeps the study into a folder of the test's."""
    source = tmp_path / "short.toml"
    source.write_text(SOURCE)
    return [*PROGRAM, "sweep", str(source), "--out", str(tmp_path / "out"), "--json"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    run_rows(MANY, folder)
    return folder


def begun(command, folder, **options):
    """A process that has finished some rows, and not all."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)
    try:
        wait_for(lambda: journal_lines(folder) > 4 or process.poll() is not None)
        assert process.poll() is None, process.communicate()
    except AssertionError:
        process.kill()
        process.communicate()
        raise
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


@pytest.mark.parametrize("threads", ["1", "2"])
def test_kill_loses_no_finished_row(tmp_path, command, whole, capfd, threads):
    folder = tmp_path / "out"
    process = begun([*command, "--threads", threads], folder)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    finished = journal_lines(folder) - 1
    assert 4 <= finished < len(LOADS)
    assert not (folder / "table.parquet").exists()
    assert gone_on_with(command, folder, whole, capfd)["resumed"] == finished


@pytest.mark.release(
    "processes that are interrupted or killed, 1.3 to 4 s; test_kill_loses_no_finished_row has one"
)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_finishes_the_rows_in_flight_and_writes_the_table(
    tmp_path, command, whole, capfd, number
):
    folder = tmp_path / "out"
    process = begun([*command, "--threads", "2"], folder)
    process.send_signal(number)
    out, err = process.communicate()
    assert process.returncode == cli.FAILED
    report = json.loads(out)
    assert (
        4 <= report["rows"] == journal_lines(folder) - 1 == len(rows_of(folder)) < report["of"] == len(LOADS)
    )
    assert f"interrupted after {report['rows']} of 60 rows; the same command continues from there" in err
    assert "Traceback" not in err
    assert gone_on_with(command, folder, whole, capfd)["resumed"] == report["rows"]


@pytest.mark.release(
    "processes that are interrupted or killed, 1.3 to 4 s; test_kill_loses_no_finished_row has one"
)
def test_a_second_process_is_refused_and_the_first_goes_on(tmp_path, command, whole, capfd):
    folder = tmp_path / "out"
    process = begun([*command, "--threads", "1"], folder)
    process.send_signal(signal.SIGSTOP)  # so that it does not end before the other begins
    second, printed = cli.main(command[len(PROGRAM) :]), capfd.readouterr()
    process.send_signal(signal.SIGCONT)
    assert second == cli.BAD_INPUT
    assert printed.err.startswith("spheretwin: study: expected one process at a time")
    assert printed.err.count("\n") == 1
    process.communicate()
    assert process.returncode == cli.DONE
    assert table(folder) == table(whole)


def test_where_files_may_not_grow_the_study_ends_in_one_line_and_loses_nothing(
    tmp_path, command, whole, capfd
):
    # As a full disk, for one process: no file of it may be longer than this.
    def limited():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))

    folder = tmp_path / "out"
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=limited)
    assert done.returncode == cli.FAILED
    assert done.stderr.startswith("spheretwin: study: ")
    assert done.stderr.endswith("could not be written, File too large; the rows before are kept\n")
    assert done.stderr.count("\n") == 1
    finished = journal_lines(folder) - 1
    assert 2 < finished < len(LOADS)
    assert gone_on_with(command, folder, whole, capfd)["resumed"] == finished
