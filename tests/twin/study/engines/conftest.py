"""A Ray cluster of two nodes, and the results of the local engine to compare with."""

import os

import pytest

from spheretwin.study import runner
from spheretwin.study.engines import ray_cluster
from spheretwin.study.study import Study, load
from tests.twin.study.engines.clusters import STUDY


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Study:
    path = tmp_path_factory.mktemp("study") / "small.toml"
    path.write_text(STUDY)
    return load(str(path))


@pytest.fixture(scope="module")
def wanted(study, tmp_path_factory):
    """Folder of the same study on the local engine."""
    folder = tmp_path_factory.mktemp("local")
    runner.run(study, folder)
    return folder


@pytest.fixture(scope="module")
def machines():
    """Two nodes of a core each, on 127.0.0.1 alone."""
    ray_cluster._ray(local=True)
    environment = dict(os.environ)  # with the token of this process, which Ray reads once
    from ray.cluster_utils import Cluster

    # A killed node is missed within seconds, not a quarter of a minute.
    missed = {"health_check_period_ms": 500, "health_check_failure_threshold": 4}
    node = {"num_cpus": 1, "object_store_memory": ray_cluster.OBJECTS_BYTES}
    head = {**node, "include_dashboard": False, "_system_config": missed}
    nodes = Cluster(initialize_head=True, head_node_args=head)
    nodes.add_node(**node)
    yield nodes
    nodes.shutdown()
    os.environ.clear()
    os.environ.update(environment)
