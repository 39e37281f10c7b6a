"""Short parts of telemetry files."""

import pytest

from spheretwin.models.telemetry import parquet
from tests.models.telemetry.streams import PART_ROWS


@pytest.fixture
def short_parts(monkeypatch):
    monkeypatch.setattr(parquet, "PART_ROWS", PART_ROWS)
