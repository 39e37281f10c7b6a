"""Files of one run that several files of tests read."""

import pytest

from tests.twin.analysis.runs import WITH_EVENTS, written


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """Telemetry and recording of a run with events of every kind."""
    return written(tmp_path_factory.mktemp("files"), **WITH_EVENTS)
