"""Addresses, nodes and options that a sweep on a Ray cluster refuses, in one line."""

import socket
import sys

import pytest

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.study import journal, runner
from spheretwin.study.engines import ray_cluster
from tests.package_copy import copy_package
from tests.twin.study.engines.clusters import ROWS, run, same_table

# A copy of the package is found before the installed one, whichever way that is installed.
FIRST = """
import sys

sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in repr(finder)]
"""


def test_a_node_with_other_sources_is_refused_in_one_line(study, machines, wanted, tmp_path):
    package = copy_package(tmp_path / "other")
    with (package / "loop.py").open("a") as file:
        file.write("# another one\n")
    (tmp_path / "other" / "sitecustomize.py").write_text(FIRST)
    environment = {"PYTHONPATH": str(tmp_path / "other")}
    other = machines.add_node(num_cpus=1, env_vars=environment)
    try:
        with pytest.raises(SpheretwinError, match="received other sources; none of its rows") as refusal:
            run(study, tmp_path / "out", machines)
    finally:
        machines.remove_node(other)
    assert "\n" not in str(refusal.value)
    kept, of_local = (
        (folder / journal.NAME).read_text().splitlines() for folder in (tmp_path / "out", wanted)
    )
    assert set(kept) <= set(of_local)


def test_an_address_where_nobody_answers_loses_nothing(study, machines, wanted, tmp_path):
    runner.run(study, tmp_path, limit=20)
    kept = (tmp_path / journal.NAME).read_bytes()
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{unused.getsockname()[1]}"
        with pytest.raises(InputError, match=f"at {address}, received no answer"):
            runner.run(study, tmp_path, engine="ray", address=address)
    assert (tmp_path / journal.NAME).read_bytes() == kept
    found = run(study, tmp_path, machines)
    assert (found.rows, found.resumed) == (ROWS, 20)
    assert same_table(tmp_path, wanted)


def test_who_answers_but_is_no_cluster_is_refused(study, tmp_path, monkeypatch):
    # The probe of one that is silent for ever is cut off: how soon makes no difference.
    monkeypatch.setattr(ray_cluster, "CONNECT_S", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(InputError, match="received an answer, but none of Ray's within 1 s"):
            runner.run(study, tmp_path, engine="ray", address=address)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"engine": "rya"}, "expected local, ray as engine, received 'rya'; did you mean ray"),
        ({"address": "auto"}, "expected engine ray for an address, received local"),
        ({"engine": "ray", "address": "ray://there:10001"}, "expected auto, HOST or HOST:PORT"),
    ],
)
def test_what_cannot_be_meant_is_refused(study, tmp_path, options, told):
    with pytest.raises(InputError) as refusal:
        runner.run(study, tmp_path, **options)
    assert told in str(refusal.value)


def test_an_installation_without_ray_names_the_extra(study, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(InputError, match=r"expected the extra `spheretwin\[cluster\]`"):
        runner.run(study, tmp_path, engine="ray")
