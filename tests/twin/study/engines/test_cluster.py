"""Sweeps on a Ray cluster of two nodes: the same table, whatever happens to it on the way."""

import os
from pathlib import Path

import pytest

from spheretwin.twin import study as studies
from spheretwin.twin.study import journal
from spheretwin.twin.study.engines import batches, cluster
from spheretwin.twin.study.study import Study, load

ROOT = Path(__file__).parents[4]

STUDY = """
name = "small"
scenario = "sinusoid"
samples = 300
telemetry = [7]
[fields]
duration = 0.5
hardware = "prototype"
[[axis]]
field = "plant.modelling_error"
kind = "uniform"
low = -0.2
high = 0.5
[[axis]]
field = "disturbance.load"
kind = "values"
values = [0.0, 1.0]
"""

ROWS = 600


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Study:
    path = tmp_path_factory.mktemp("study") / "small.toml"
    path.write_text(STUDY)
    return load(str(path))


@pytest.fixture(scope="module")
def wanted(study, tmp_path_factory):
    """Folder of the same study over threads."""
    folder = tmp_path_factory.mktemp("threads")
    studies.run(study, folder)
    return folder


@pytest.fixture(scope="module")
def machines():
    """Two nodes of a core each, on 127.0.0.1 alone."""
    environment = dict(os.environ)
    cluster._ray(local=True)
    from ray.cluster_utils import Cluster

    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    nodes.add_node(num_cpus=1)
    yield nodes
    nodes.shutdown()
    os.environ.clear()
    os.environ.update(environment)


def run(study, folder, machines, **options):
    return studies.run(study, folder, engine="ray", address=machines.address, **options)


def same_table(folder, wanted):
    return (folder / "table.parquet").read_bytes() == (wanted / "table.parquet").read_bytes()


def test_the_table_is_that_of_threads(study, machines, wanted, tmp_path):
    found = run(study, tmp_path, machines)
    assert (found.rows, found.resumed) == (ROWS, 0)
    assert 0 < found.startup_s < found.wall_s
    assert same_table(tmp_path, wanted)
    (kept,) = (tmp_path / "telemetry").iterdir()
    assert kept.name == next((wanted / "telemetry").iterdir()).name


def test_a_node_that_is_killed_half_way_loses_nothing(study, machines, wanted, tmp_path, monkeypatch):
    lost = []
    back = batches.Batches.lost
    monkeypatch.setattr(
        batches.Batches, "lost", lambda self, batch: (lost.append(list(batch)), back(self, batch))[1]
    )
    killed = []

    def kill(done, of):
        if done >= of // 4 and not killed:
            killed.append(done)
            machines.remove_node(next(iter(machines.worker_nodes)), allow_graceful=False)

    try:
        found = run(study, tmp_path, machines, done=kill)
    finally:
        machines.add_node(num_cpus=1)
    assert killed
    assert killed[0] < ROWS
    assert lost
    assert found.rows == ROWS
    lines = (tmp_path / journal.NAME).read_text().splitlines()
    assert len(lines) == 1 + ROWS  # its head, and each row once
    assert same_table(tmp_path, wanted)
