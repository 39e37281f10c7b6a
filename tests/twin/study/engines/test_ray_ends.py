"""Sweep on a cluster of its own whose process is interrupted: what is finished is kept."""

import os
import signal

import pytest

from spheretwin.study import journal
from tests.twin.study.engines.clusters import LONG_STUDY, goes_on_locally, started


@pytest.mark.release("a Ray cluster for 47 s; test_ray_cluster.py and test_processes.py have its parts")
def test_a_cluster_of_its_own_is_interrupted_and_the_study_goes_on(tmp_path):
    source = tmp_path / "long.toml"
    source.write_text(LONG_STUDY)
    going = started(source, tmp_path / "out", "--threads", "1")
    os.killpg(going.pid, signal.SIGINT)  # as a terminal does it, to all that it runs
    stderr = going.communicate()[1]
    assert going.returncode == 1
    assert "the same command continues from there" in stderr
    assert "Traceback" not in stderr
    before = (tmp_path / "out" / journal.NAME).read_bytes()
    goes_on_locally(source, tmp_path, before)
