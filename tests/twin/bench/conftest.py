"""A bench of a busy machine: to compile, or to wait for the interpreter, takes longer than a person waits."""

import pytest

from spheretwin.bench import cycle, preparation
from tests.twin.bench.cases import begun
from tests.waiting import UNLIMITED_S


@pytest.fixture(autouse=True)
def _patience(monkeypatch):
    monkeypatch.setattr(preparation, "LIMIT_s", UNLIMITED_S)
    for limit in ("COMMAND_s", "TICKS_s"):  # test_stall.py sets its own
        monkeypatch.setattr(cycle, limit, UNLIMITED_S)


@pytest.fixture
def made():
    """A bench whose time goes on."""
    with begun() as bench:
        yield bench
