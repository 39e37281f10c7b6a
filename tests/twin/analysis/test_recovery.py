"""An export of a recording has the content of its telemetry file: status and journal."""

import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.analysis.recorded_run import export, logged, read
from spheretwin.analysis.recovery import hold_rows
from spheretwin.analysis.run_summary import figures
from spheretwin.models.telemetry.run_record import Change
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.status import Level
from spheretwin.models.telemetry.table import Table
from spheretwin.records.outputs import Outputs
from spheretwin.session import Session
from spheretwin.simulation import follow
from tests.twin.analysis.runs import WITH_EVENTS

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


def test_a_recording_in_place_of_telemetry_is_named_with_the_way_to_convert_it(files, capsys):
    _, recording = files
    assert cli.main(["simulate", "--replay", str(recording)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "expected a telemetry file (.parquet) of a run, received a recording" in line
    assert f"`spheretwin review {recording} --export FILE.parquet` writes its telemetry" in line


def test_only_lines_that_are_changes_are_taken():
    lines = ["the run is complete", "coil.07 open", "a set to", "law set to pd", "not a name set to 1"]
    log = [(0.001 * tick, Level.INFO, text) for tick, text in enumerate(lines)]
    assert logged(log, {}, 1e-3, 10) == (Change(3, "law", "pd"),)


def test_rows_between_those_that_were_recorded_are_the_latest_ones():
    signals = (Signal("t_s", "s", 1, "time"), Signal("x", "1", 1, "a number"))
    some = Table(signals, np.array([[0.002, 7.0], [0.005, 8.0], [0.006, 9.0]]))
    every = hold_rows(some, 1e-3)
    np.testing.assert_allclose(every["t_s"], [0.002, 0.003, 0.004, 0.005, 0.006], rtol=1e-15)
    assert every["x"].tolist() == [7.0, 7.0, 7.0, 8.0, 9.0]
