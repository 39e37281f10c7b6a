"""Sweeps on a Ray cluster of two nodes: the same table, whatever happens to it on the way."""

import pytest

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.study import journal
from spheretwin.study.engines import engine, ray_worker
from tests.twin.study.engines.clusters import ROWS, run, same_table


def blocked_on(node_id, folder):
    """Return a runner of batches that never ends on one node; others begin when that one is at work."""

    def run_unless_blocked(job, numbers):
        import time

        import ray

        from spheretwin.study.engines import ray_worker

        is_blocked = ray.get_runtime_context().get_node_id() == node_id
        if is_blocked:
            (folder / "at_work").touch()
        while is_blocked or not (folder / "at_work").exists():
            time.sleep(0.01)
        return ray_worker.run_batch(job, numbers)

    return run_unless_blocked


def test_a_node_that_is_killed_half_way_loses_nothing(study, machines, wanted, tmp_path, monkeypatch):
    lost = []
    back = engine.Batches.lost
    monkeypatch.setattr(
        engine.Batches, "lost", lambda self, batch: (lost.append(list(batch)), back(self, batch))[1]
    )
    (node,) = machines.worker_nodes
    monkeypatch.setattr(ray_worker, "run_batch", blocked_on(node.node_id, tmp_path))
    killed = []

    def kill(done, of):
        if done >= of // 4 and not killed:
            killed.append(done)
            machines.remove_node(node, allow_graceful=False)

    try:
        found = run(study, tmp_path / "study", machines, done=kill)
    finally:
        machines.add_node(num_cpus=1)
    assert killed
    assert killed[0] < ROWS
    assert lost
    assert (found.rows, found.resumed) == (ROWS, 0)
    assert 0 < found.startup_s < found.wall_s
    lines = (tmp_path / "study" / journal.NAME).read_text().splitlines()
    assert len(lines) == 1 + ROWS  # its head, and each row once
    assert same_table(tmp_path / "study", wanted)
    (stored,) = (tmp_path / "study" / "telemetry").iterdir()
    assert stored.name == next((wanted / "telemetry").iterdir()).name


def test_a_fault_on_a_node_stops_the_study_and_keeps_what_is_finished(study, machines, tmp_path, monkeypatch):
    carried_out = ray_worker.run_batch

    def of_plants_that_differ(job, numbers):
        from spheretwin.study import agreement
        from spheretwin.study.engines import ray_worker

        agreement.BOUND = -1.0  # in the process of a node
        return ray_worker.run_batch(job, numbers)

    monkeypatch.setattr(ray_worker, "run_batch", of_plants_that_differ)
    with pytest.raises(SpheretwinError, match="to be the same on both plants"):
        run(study, tmp_path, machines)
    monkeypatch.setattr(ray_worker, "run_batch", carried_out)
    assert (tmp_path / "table.parquet").exists()
    assert len((tmp_path / journal.NAME).read_text().splitlines()) < 1 + ROWS
