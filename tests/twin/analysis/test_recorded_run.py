"""A run is the same from either of its files, to the last bit; of a killed one, complete rows are read."""

import csv
import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.analysis import recovery
from spheretwin.analysis.recorded_run import export, open_run, read
from spheretwin.analysis.run_summary import figures, peaks
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.parquet import TelemetryFile
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.records.outputs import Outputs
from spheretwin.records.provenance import record_of
from spheretwin.run import figures_of
from spheretwin.session import Session
from spheretwin.simulation import simulate
from tests.twin.analysis.runs import PLANT, WITH_EVENTS, written


def same_but_path(run):
    return {**figures(run), "path": ""}


def test_a_recording_says_what_the_telemetry_says_to_the_last_bit(files):
    telemetry, recording = map(read, files)
    assert recording.table.signals == telemetry.table.signals
    assert recording.table.values.tobytes() == telemetry.table.values.tobytes()
    reported = same_but_path(recording)
    assert reported == same_but_path(telemetry)
    lines = [event["text"] for event in reported["events"]]
    assert "controller.law set to pd" in lines
    assert any("coil.07 open" in line for line in lines)
    assert lines[-1] == "the run is complete"


@pytest.mark.parametrize("period_s", [5e-4, 7e-4, 2e-3])
def test_ticks_of_any_period_keep_their_bits(tmp_path, period_s):
    telemetry, recording = map(read, written(tmp_path, **{"duration": 0.3, "controller.period_s": period_s,
                                                          "plant.step_s": 1e-4}))  # fmt: skip
    assert recording.table.values.tobytes() == telemetry.table.values.tobytes()


def test_a_review_reports_the_figures_of_the_run(files):
    run = simulate(scenarios.load("hold", WITH_EVENTS))
    reviewed = figures(read(files[0]))
    expected = figures_of(run)
    assert {name: reviewed[name] for name in expected} == expected
    assert reviewed["energy_J"] == reviewed["copper_loss_J"] + reviewed["mechanical_work_J"]
    assert reviewed["simulated_s"] == pytest.approx(2.2, rel=1e-12)  # a sum of periods
    for column, of_axis in zip(run.telemetry["error_rad"].T, reviewed["error_peaks"].values(), strict=True):
        assert [tuple(peak.values()) for peak in of_axis] == [*map(tuple, peaks(column, 1e-3))]


def test_a_run_without_its_law_file_is_reviewed(tmp_path):
    law = tmp_path / "mine.py"
    law.write_text(
        "from spheretwin.control.laws.pd import PD\n\nclass Mine(PD):\n    law: str = 'x'\n", encoding="utf-8"
    )
    telemetry, _ = written(tmp_path, **{"duration": 0.05, "controller.law": "pd"})
    table, metadata = read_parquet(telemetry)
    scenario = json.loads(metadata["scenario"])
    scenario["controller"]["law"] = f"{law}:Mine"
    law.unlink()
    table.write_parquet(telemetry, {**metadata, "scenario": json.dumps(scenario)})
    assert figures(read(telemetry))["law"] == f"{law}:Mine"
    opened = open_run(telemetry).scenario
    assert opened.controller.law == f"{law}:Mine"
    assert opened.description == scenario["description"] != ""
    assert (opened.name, opened.duration) == ("hold", 0.05)


@pytest.mark.parametrize("kind", [0, 1], ids=["telemetry", "recording"])
def test_columns_come_back_bit_for_bit(files, tmp_path, kind):
    run = read(files[kind])
    export(run, path := tmp_path / "columns.parquet")
    assert read(path).table.values.tobytes() == run.table.values.tobytes()
    export(run, path := tmp_path / "columns.csv")
    header, *rows = csv.reader(path.read_text(encoding="utf-8").splitlines())
    assert header == [*run.table.scalars()]
    assert np.array(rows, dtype=float).tobytes() == run.table.values.tobytes()
    assert header[:2] == ["t_s", "q_rad_alpha"]


# --- what killed processes leave


def killed_telemetry(folder, rows):
    """What is left of a run's telemetry where the process was killed after some rows."""
    session = Session(scenarios.load("hold", {**PLANT, "duration": 5.0}))
    file = TelemetryFile(folder / "run.parquet", session.signals, record_of(session).metadata())
    file.write(session.advance(rows))
    return file


def test_telemetry_of_a_killed_process_is_read_and_recovered(tmp_path, capsys):
    file = killed_telemetry(tmp_path, 5000)
    path, out = tmp_path / "run.parquet", tmp_path / "whole.parquet"
    run = read(path)
    assert (len(run.table), run.whole, run.record.status) == (4096, False, None)
    assert cli.main(["review", str(path), "--json"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["runs"][0]["rows"] == 4096
    assert "was not closed: 4096 rows, 4.096 s of the run, were recovered" in printed.err
    assert cli.main(["recover", str(path), "--out", str(out)]) == 0
    assert "recovered 4096 rows, 4.096 s" in capsys.readouterr().out
    assert read(out).table.values.tobytes() == run.table.values.tobytes()
    file.close({})


KILLED = """
import os, signal, sys, time
from pathlib import Path
from spheretwin import scenario as scenarios
from spheretwin.records.outputs import Outputs
from spheretwin.session import Session
from spheretwin.simulation import follow

folder = Path(sys.argv[1])
session = Session(scenarios.load("hold", {"plant.engine": "lagrangian", "duration": 6.0}))
files = Outputs(session, folder / "run.rrd", folder / "run.parquet", live=False)
follow(session, 5000, files.sinks)
(part,) = folder.glob(".run.rrd.*.part")
while part.stat().st_size < 2_000_000:  # what every run has is 1 MB of it, a thousand rows are 0.6 MB
    time.sleep(0.01)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_process_that_was_killed_leaves_both_files_readable(tmp_path):
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)])
    assert done.returncode == -signal.SIGKILL
    telemetry, recording = read(tmp_path / "run.parquet"), read(tmp_path / "run.rrd")
    assert (telemetry.whole, recording.whole) == (False, False)
    rows = min(len(telemetry.table), len(recording.table))
    assert rows >= 1000
    for run in (telemetry, recording):
        assert figures(run)["law"] == "afsm"
    assert recording.table.values[:rows].tobytes() == telemetry.table.values[:rows].tobytes()


def test_a_run_without_a_tick_is_reviewed(tmp_path):
    session = Session(scenarios.load("hold", {**PLANT, "duration": 0.1}))
    paths = tmp_path / "run.rrd", tmp_path / "run.parquet"
    assert Outputs(session, *paths, live=False).close() == []
    for path in paths:
        reviewed = figures(read(path))
        assert (reviewed["rows"], reviewed["max_abs_error_rad"], reviewed["energy_J"]) == (0, None, None)


OF_CUTS = pytest.mark.release("cuts recordings for 2 to 3 s; test_a_process_that_was_killed_* has one cut")


@OF_CUTS
def test_wherever_a_recording_is_cut_its_whole_ticks_are_read(files, tmp_path):
    """A killed process has no footer, and may have half a message."""
    whole, content = read(files[1]).table, files[1].read_bytes()
    path, out, rows = tmp_path / "run.rrd", tmp_path / "whole.rrd", []
    for size in np.linspace(0.1, 1.0, 10) * len(content):
        (tmp_path / ".run.rrd.00.part").write_bytes(content[: int(size) - 40])
        try:
            run = read(path)
        except InputError:  # cut within the meshes
            rows.append(0)
            continue
        rows.append(len(run.table))
        assert not run.whole
        columns = range(run.table.values.shape[1])
        assert np.array_equal(run.table.values, whole.values[: rows[-1], columns], equal_nan=True)
        assert recovery.recover(path, out) == (rows[-1], run.simulated_s, True)
        again = read(out)
        assert again.whole
        assert again.table.values.tobytes() == run.table.values.tobytes()
    assert rows == sorted(rows)
    assert len(set(rows) - {0, len(whole)}) > 0
    assert rows[-1] == len(whole)


def test_a_recording_of_something_else_is_refused(tmp_path):
    import rerun as rr

    recording = rr.RecordingStream("else")
    recording.save(path := tmp_path / "else.rrd")
    recording.log("telemetry/q_rad", rr.Scalars(1.0), static=True)
    recording.flush()
    recording.disconnect()
    with pytest.raises(InputError, match="expected one of a run"):
        read(path)


def test_a_complete_file_is_not_recovered(files, tmp_path):
    for path in files:
        with pytest.raises(InputError, match="received a complete"):
            recovery.recover(path, tmp_path / "out")
    assert os.listdir(tmp_path) == []


def test_partial_files_of_several_processes_are_refused(tmp_path):
    for number in "01":
        (tmp_path / f".run.rrd.{number}.part").touch()
    with pytest.raises(InputError, match="partial files of 2 processes"):
        read(tmp_path / "run.rrd")


@pytest.mark.parametrize("time_s", [np.nan, np.inf, 0.0])
def test_rows_out_of_order_are_damage(files, tmp_path, time_s):
    table, metadata = read_parquet(files[0])
    table.values[500, 0] = time_s
    table.write_parquet(path := tmp_path / "run.parquet", metadata)
    with pytest.raises(InputError, match="expected rows whose times rise"):
        read(path)
