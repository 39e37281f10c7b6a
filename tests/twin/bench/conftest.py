"""Preparations of a busy machine: a loop may be compiled for longer than a person would wait."""

import pytest

from spheretwin.bench import preparation
from tests.twin.bench.cases import begun
from tests.waiting import UNLIMITED_S


@pytest.fixture(autouse=True)
def _patience(monkeypatch):
    monkeypatch.setattr(preparation, "LIMIT_s", UNLIMITED_S)


@pytest.fixture
def made():
    """A bench whose time goes on."""
    with begun() as bench:
        yield bench
