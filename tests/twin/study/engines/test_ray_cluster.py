"""Sweeps on a Ray cluster of two nodes: the same table, whatever happens to it on the way."""

import socket

import pytest

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.study import journal, runner
from spheretwin.study.engines import engine, processes
from tests.package_copy import copy_package
from tests.twin.study.cases import table
from tests.twin.study.engines.clusters import LONG_STUDY, ROWS, goes_on_locally, run, started

pytestmark = pytest.mark.release(
    "a Ray cluster for 15 to 83 s; test_ray_batches.py and test_ray_refusals.py need none"
)

# A copy of the package is found before the installed one, whichever way that is installed.
FIRST = """
import sys

sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in repr(finder)]
"""


def blocked_on(node_id, folder):
    """Return a runner of batches that never ends on one node; others begin when that one is at work."""

    def run_unless_blocked(job, numbers):
        import time

        import ray

        is_blocked = ray.get_runtime_context().get_node_id() == node_id
        if is_blocked:
            (folder / "at_work").touch()
        while is_blocked or not (folder / "at_work").exists():
            time.sleep(0.01)
        return processes.run_batch(job, numbers)

    return run_unless_blocked


def test_a_node_that_is_killed_half_way_loses_nothing(study, machines, wanted, tmp_path, monkeypatch):
    lost = []
    back = engine.Batches.lost
    monkeypatch.setattr(
        engine.Batches, "lost", lambda self, batch: (lost.append(list(batch)), back(self, batch))[1]
    )
    (node,) = machines.worker_nodes
    monkeypatch.setattr(processes, "run_batch", blocked_on(node.node_id, tmp_path))
    killed = []

    def kill(done, of):
        if done >= of // 4 and not killed:
            killed.append(done)
            machines.remove_node(node, allow_graceful=False)

    try:
        result = run(study, tmp_path / "study", machines, done=kill)
    finally:
        machines.add_node(num_cpus=1)
    assert 0 < killed[0] < ROWS
    assert lost
    assert (result.rows, result.resumed) == (ROWS, 0)
    assert 0 < result.startup_s < result.wall_s
    lines = (tmp_path / "study" / journal.NAME).read_text().splitlines()
    assert len(lines) == 1 + ROWS  # its head, and each row once
    assert table(tmp_path / "study") == table(wanted)
    (stored,) = (tmp_path / "study" / "telemetry").iterdir()
    assert stored.name == next((wanted / "telemetry").iterdir()).name


def test_a_fault_on_a_node_stops_the_study_and_keeps_what_is_finished(study, machines, tmp_path, monkeypatch):
    def of_plants_that_differ(job, numbers):
        from spheretwin.study import agreement

        agreement.BOUND = -1.0  # in the process of a node
        return processes.run_batch(job, numbers)

    monkeypatch.setattr(processes, "run_batch", of_plants_that_differ)
    with pytest.raises(SpheretwinError, match="to be the same on both plants"):
        run(study, tmp_path, machines)
    assert (tmp_path / "table.parquet").exists()
    assert len((tmp_path / journal.NAME).read_text().splitlines()) < 1 + ROWS


def test_a_row_that_takes_its_process_along_is_told_of(study, machines, tmp_path, monkeypatch):
    monkeypatch.setattr(engine, "MOST_LOSSES", 1)
    (tmp_path / "own.py").write_text("import os\n\n\ndef dies(run):\n    os._exit(1)\n")
    fatal = study.model_copy(update={"metrics": (f"{tmp_path}/own.py:dies",), "telemetry": ()})
    with pytest.raises(SpheretwinError, match="expected row 0 to leave its process alive, received Worker"):
        run(fatal, tmp_path / "out", machines, limit=1)


def test_a_node_with_other_sources_is_refused_in_one_line(study, machines, wanted, tmp_path):
    package = copy_package(tmp_path / "other")
    with (package / "session.py").open("a") as file:
        file.write("# another one\n")
    (tmp_path / "other" / "sitecustomize.py").write_text(FIRST)
    other = machines.add_node(num_cpus=1, env_vars={"PYTHONPATH": str(tmp_path / "other")})
    try:
        with pytest.raises(SpheretwinError, match="received other sources; none of its rows") as refusal:
            run(study, tmp_path / "out", machines)
    finally:
        machines.remove_node(other)
    assert "\n" not in str(refusal.value)
    lines = (set((path / journal.NAME).read_text().splitlines()) for path in (tmp_path / "out", wanted))
    assert next(lines) <= next(lines)


def test_an_address_where_nobody_answers_loses_nothing(study, machines, wanted, tmp_path):
    runner.run(study, tmp_path, limit=20)
    stored = (tmp_path / journal.NAME).read_bytes()
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{unused.getsockname()[1]}"
        with pytest.raises(InputError, match=f"at {address}, received no answer"):
            runner.run(study, tmp_path, engine="ray", address=address)
    assert (tmp_path / journal.NAME).read_bytes() == stored
    result = run(study, tmp_path, machines)
    assert (result.rows, result.resumed) == (ROWS, 20)
    assert table(tmp_path) == table(wanted)


# The last one: it leaves no cluster.
def test_a_cluster_that_is_lost_is_told_of_in_one_line(machines, tmp_path):
    source = tmp_path / "long.toml"
    source.write_text(LONG_STUDY)
    going = started(source, tmp_path / "out", "--threads", "1", "--address", machines.address)
    machines.head_node.kill_gcs_server(check_alive=False)
    stderr = going.communicate()[1]
    assert going.returncode == 1
    (line,) = stderr.splitlines()
    assert "expected the cluster to stay, received no answer from it any more" in line
    goes_on_locally(source, tmp_path, (tmp_path / "out" / journal.NAME).read_bytes())
