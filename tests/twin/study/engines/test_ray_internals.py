"""The internal switch of Ray exists and has its effect; a change of Ray fails here, not in a sweep."""

import sys

from spheretwin.study.engines import processes, ray_cluster


def test_a_silenced_driver_prints_no_message_of_a_node(monkeypatch, capsys):
    ray = ray_cluster._ray(local=True)  # on import Ray reads how a cluster authenticates
    worker = ray._private.worker
    assert hasattr(worker, "_worker_logs_enabled"), "Ray has no switch _worker_logs_enabled any more"
    monkeypatch.setattr(worker, "_worker_logs_enabled", True)
    message = {"pid": "raylet", "ip": "10.0.0.1", "lines": ["a node is lost"]}
    worker.print_worker_logs(message, sys.stdout)
    assert "a node is lost" in capsys.readouterr().out
    ray_cluster._silence(ray)
    worker.print_worker_logs(message, sys.stdout)
    assert capsys.readouterr().out == ""


def test_what_one_node_lacks_is_a_difference():
    version = {"a package": "1"}
    assert processes._differ("a package", version, {})
    assert processes._differ("a package", {}, version)
    assert not processes._differ("a package", version, dict(version))
