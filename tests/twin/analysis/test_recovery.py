"""An export of a recording has the content of its telemetry file: status and journal."""

import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.analysis.recorded_run import export, logged, read
from spheretwin.analysis.run_summary import figures
from spheretwin.models.telemetry.run_record import Change
from spheretwin.models.telemetry.status import Level
from spheretwin.outputs import Outputs
from spheretwin.session import Session
from spheretwin.simulation import follow
from tests.twin.analysis.runs import WITH_EVENTS

# By its path: the tests are no package.

BY_HAND = (
    Change(300, "disturbance.load", 1.5),
    Change(300, "controller.surface_slope", [40.0, 50.0, 60.0]),
    Change(700, "controller.law", "pd"),
)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A run that was changed on the way, by its scenario and by hand."""
    folder = tmp_path_factory.mktemp("changed")
    telemetry, recording = folder / "run.parquet", folder / "run.rrd"
    with Session(scenarios.load("hold", WITH_EVENTS)) as session:
        sinks = Outputs(session, recording, telemetry, live=False)
        follow(session, session.scenario.ticks, sinks.sinks, journal=BY_HAND)
        assert sinks.close() == []
    return telemetry, recording


def test_a_recording_says_how_far_the_run_went_and_what_was_set(files):
    telemetry, recording = (read(path).record for path in files)
    assert recording.ticks == telemetry.ticks == 2200
    assert recording.journal == telemetry.journal == BY_HAND
    assert recording.status == telemetry.status


def test_an_export_of_a_recording_is_reviewed_and_replayed(files, tmp_path):
    telemetry, recording = map(read, files)
    export(recording, out := tmp_path / "out.parquet")
    again = read(out)
    assert again.record.ticks == 2200
    assert {**figures(again), "path": ""} == {**figures(telemetry), "path": ""}
    replayed = tmp_path / "replayed.parquet"
    assert cli.main(["simulate", "--replay", str(out), "--telemetry", str(replayed), "--json"]) == 0
    assert np.array_equal(read(replayed).table.values, telemetry.table.values, equal_nan=True)


def test_only_lines_that_are_changes_are_taken():
    lines = ["the run is complete", "coil.07 open", "a set to", "law set to pd", "not a name set to 1"]
    log = [(0.001 * tick, Level.INFO, text) for tick, text in enumerate(lines)]
    assert logged(log, {}, 1e-3, 10) == (Change(3, "law", "pd"),)
