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


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"engine": "rya"}, "expected local, ray as engine, received 'rya'; did you mean ray"),
        ({"address": "auto"}, "expected engine ray for an address, received local"),
        ({"engine": "ray", "address": "ray://there:10001"}, "expected auto, HOST or HOST:PORT"),
    ],
)
def test_what_cannot_be_meant_is_refused(study, tmp_path, options, message):
    with pytest.raises(InputError) as refusal:
        runner.run(study, tmp_path, **options)
    assert message in str(refusal.value)


def test_an_installation_without_ray_names_the_extra(study, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(
        InputError, match="expected Ray for the engine ray, which the extra cluster installs: "
    ):
        runner.run(study, tmp_path, engine="ray")
