"""Rows in processes of this machine: the same table, and an end in one line."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.study.study import made
from tests.twin.study.cases import LOADS, SHORT, rows_of, run, run_rows, table, telemetry
from tests.waiting import wait_for

METRIC = """
import json
import os
import subprocess
import sys
from pathlib import Path

def own(run):
    print("a line of the metric")
    if (run.scenario.disturbance.load == 2.0) and os.path.exists({marker!r}):
        os._exit(3)
    return float(run.telemetry["error_rad"][-1, 0])
"""


@pytest.fixture
def study(tmp_path):
    """A study of 24 rows with a metric of the user, which ends its process if a file is there."""
    (tmp_path / "own.py").write_text(METRIC.format(marker=str(tmp_path / "marker")))
    fields = {"name": "short", "scenario": "sinusoid", "fields": SHORT, "axis": list(LOADS), "samples": 8}
    more = {"metrics": ["rms_error_rad", "own.py:own"], "telemetry": [3]}
    return made({**fields, **more}, "short").model_copy(update={"folder": str(tmp_path)})


@pytest.mark.release("two processes of 2 s each")
def test_the_table_is_that_of_threads(study, tmp_path):
    wanted = run_rows(study, tmp_path / "local")
    assert run_rows(study, tmp_path / "processes", engine="processes", threads=2) == wanted
    assert table(tmp_path / "processes") == table(tmp_path / "local")
    assert telemetry(tmp_path / "processes") == telemetry(tmp_path / "local")
    assert {row["own"] for row in wanted} != {None}


def test_a_process_that_ends_is_reported_and_what_is_finished_is_kept(study, tmp_path):
    (tmp_path / "marker").touch()
    with pytest.raises(
        SpheretwinError, match=r"a process to finish rows \d+ to \d+, received its end with status 3"
    ):
        run(study, tmp_path / "out", engine="processes", threads=1)
    kept = rows_of(tmp_path / "out")
    assert 0 < len(kept) < 24
    os.remove(tmp_path / "marker")
    done = run(study, tmp_path / "out", threads=1)
    assert (done.rows, done.resumed) == (24, len(kept))


ENDLESS = """
import os, pathlib

def own(run):
    pathlib.Path({!r}).write_text(str(os.getpid()))
    while True:
        pass
"""

DRIVER = """
import sys
from spheretwin.study.runner import run
from spheretwin.study.study import load
run(load(sys.argv[1]), sys.argv[2], engine="processes", threads=1)
"""


def test_a_process_in_code_that_never_returns_ends_with_its_driver(study, tmp_path):
    (tmp_path / "own.py").write_text(ENDLESS.format(str(tmp_path / "started")))
    axes = [axis.model_dump(mode="json") for axis in study.axis]
    fields = {"name": "short", "scenario": "sinusoid", "samples": 8, "metrics": ["own.py:own"]}
    lines = [f"{name} = {json.dumps(value)}" for name, value in fields.items()]
    lines += ["fields = {duration = 0.02}", *(f"[[axis]]\n{_toml(axis)}" for axis in axes)]
    (tmp_path / "short.toml").write_text("\n".join(lines))
    command = [sys.executable, "-P", "-c", DRIVER, str(tmp_path / "short.toml"), str(tmp_path / "out")]
    with subprocess.Popen(command) as driver:
        started = tmp_path / "started"
        process = int(wait_for(lambda: started.exists() and started.read_text(), while_alive=driver))
        driver.kill()
    wait_for(lambda: not _is_running(process))


def _toml(axis):
    return "\n".join(f"{name} = {json.dumps(value)}" for name, value in axis.items() if value is not None)


def _is_running(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{process}/stat")
    return not (state.exists() and ") Z " in state.read_text())  # ended, and not collected yet
