"""Sweeps whose process, cluster or worker ends: what is finished is kept."""

import os
import signal
import subprocess
import sys

import pytest

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.study import journal, runner
from spheretwin.study.engines import engine
from tests.twin.study.cases import rows_of
from tests.twin.study.engines.clusters import STUDY, run
from tests.waiting import wait_for

LIMIT = 60
LONG_STUDY = STUDY.replace("samples = 120", "samples = 100_000")  # it does not end before it is stopped


def test_a_row_that_takes_its_process_along_is_told_of(study, machines, tmp_path, monkeypatch):
    monkeypatch.setattr(engine, "MOST_LOSSES", 1)
    (tmp_path / "own.py").write_text("import os\n\n\ndef dies(run):\n    os._exit(1)\n")
    fatal = study.model_copy(update={"metrics": (f"{tmp_path}/own.py:dies",), "telemetry": ()})
    with pytest.raises(SpheretwinError, match="expected row 0 to leave its process alive, received Worker"):
        run(fatal, tmp_path / "out", machines, limit=1)


def started(source, folder, *options):
    """The command line in a process of its own, when ten rows are in its journal."""
    program = "import sys; from spheretwin.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", program, "sweep", str(source), "--out", str(folder), "--engine", "ray"]
    going = subprocess.Popen([*command, *options], stderr=subprocess.PIPE, text=True, start_new_session=True)
    path = folder / journal.NAME
    wait_for(lambda: going.poll() is not None or (path.exists() and path.read_bytes().count(b"\n") > 10))
    return going


def goes_on_locally(source, folder, before):
    """Run the first rows of a study that was stopped: its results are kept, and the others are added."""
    found = runner.run(str(source), folder / "out", limit=LIMIT)
    assert found.resumed >= 10
    assert (folder / "out" / journal.NAME).read_bytes().startswith(before)
    runner.run(str(source), folder / "local", limit=LIMIT)
    assert rows_of(folder / "out")[:LIMIT] == rows_of(folder / "local")


def test_a_cluster_of_its_own_is_interrupted_and_the_study_goes_on(tmp_path):
    source = tmp_path / "long.toml"
    source.write_text(LONG_STUDY)
    going = started(source, tmp_path / "out", "--threads", "1")
    os.killpg(going.pid, signal.SIGINT)  # as a terminal does it, to all that it runs
    told = going.communicate()[1]
    assert going.returncode == 1
    assert "the same command continues from there" in told
    assert "Traceback" not in told
    before = (tmp_path / "out" / journal.NAME).read_bytes()
    goes_on_locally(source, tmp_path, before)


# The last one: it leaves no cluster.
def test_a_cluster_that_is_lost_is_told_of_in_one_line(machines, tmp_path):
    source = tmp_path / "long.toml"
    source.write_text(LONG_STUDY)
    going = started(source, tmp_path / "out", "--threads", "1", "--address", machines.address)
    machines.head_node.kill_gcs_server(check_alive=False)
    told = going.communicate()[1]
    assert going.returncode == 1
    (line,) = told.splitlines()
    assert "expected the cluster to stay, received no answer from it any more" in line
    goes_on_locally(source, tmp_path, (tmp_path / "out" / journal.NAME).read_bytes())
