"""Rows in processes of this machine: the same table, and an end in one line."""

import os

import pytest

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.study.study import made
from tests.twin.study.cases import LOADS, SHORT, rows_of, run, run_rows, table, telemetry

METRIC = """
import os

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
