"""Addresses, nodes and options that a sweep on a Ray cluster refuses, in one line."""

import socket
import sys

import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.study import runner
from spheretwin.study.engines import ray_cluster


def test_who_answers_but_is_no_cluster_is_refused(study, tmp_path, monkeypatch):
    # The probe of one that is silent for ever is cut off: how soon makes no difference.
    monkeypatch.setattr(ray_cluster, "CONNECT_S", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(InputError, match="received an answer, but none of Ray's within 1 s"):
            runner.run(study, tmp_path, engine="ray", address=address)


def test_the_address_of_a_client_is_refused(study, tmp_path):
    with pytest.raises(InputError, match="expected auto, HOST or HOST:PORT"):
        runner.run(study, tmp_path, engine="ray", address="ray://there:10001")


def test_an_installation_without_ray_names_the_extra(study, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    message = "expected Ray for the engine ray, which the extra cluster installs: "
    with pytest.raises(InputError, match=message):
        runner.run(study, tmp_path, engine="ray")
