"""Files of a run: a fault of one leaves the others, and a refusal leaves nothing."""

import os
import signal
from unittest.mock import Mock

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin import simulation as simulations
from spheretwin.analysis.recorded_run import read
from spheretwin.cli.common import interruptible
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.run_record import Change
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.records.outputs import Outputs
from spheretwin.session import Session
from spheretwin.simulation import follow
from spheretwin.viz.recording import live

LOADS = ("disturbance.load", "disturbance.random_bound_Nm")


@pytest.fixture
def session():
    return Session(scenarios.load("hold", {"duration": 0.05}))


def test_a_recording_that_cannot_be_put_in_its_place_costs_no_telemetry(session, tmp_path):
    record, telemetry = tmp_path / "x.rrd", tmp_path / "x.parquet"
    files = Outputs(session, record, telemetry, live=False)
    follow(session, 50, files.sinks)
    record.mkdir()
    (fault,) = files.close()
    (left_over,) = tmp_path.glob(".x.rrd.*.part")
    assert f"{fault}".startswith(f"output: {record} could not be written, ")
    assert f"{fault}".endswith(f"{left_over}")
    assert (files.record, files.telemetry) == (None, telemetry)
    assert len(read_parquet(telemetry)[0]) == 50


def test_telemetry_that_is_refused_leaves_no_recording(session, tmp_path):
    with pytest.raises(InputError, match="writable"):
        Outputs(session, tmp_path / "x.rrd", tmp_path / "missing" / "x.parquet", live=False)
    assert os.listdir(tmp_path) == []


def test_a_live_view_has_the_tab_and_the_window_that_were_requested(session, monkeypatch):
    view = Mock()
    monkeypatch.setattr(live, "LiveView", view)
    assert Outputs(session, None, None, live=True, view="control", live_window_s=3.0).close() == []
    assert view.call_args.kwargs == {"shown": "control", "window_s": 3.0}


def test_signals_that_the_parent_has_ignored_stay_ignored():
    before = {number: signal.getsignal(number) for number in (signal.SIGHUP, signal.SIGTERM)}
    try:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        with interruptible() as asked:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not asked()
            os.kill(os.getpid(), signal.SIGTERM)
            assert asked()
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
        assert signal.getsignal(signal.SIGTERM) == before[signal.SIGTERM]
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_the_descriptor_that_signals_wake_is_the_one_of_before():
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    before = signal.set_wakeup_fd(writing)
    try:
        with interruptible():
            pass
        assert signal.set_wakeup_fd(before) == writing
    finally:
        signal.set_wakeup_fd(before)
        os.close(reading)
        os.close(writing)


@pytest.mark.parametrize("chunk", [1, 10, 50])
def test_files_that_begin_later_have_the_rows_and_the_log_from_then_on(tmp_path, monkeypatch, chunk):
    """Faults, events and changes at the first tick and at edges of chunks come once, earlier ones never."""
    starts_s, ends_s = (0.005, 0.019, 0.02, 0.03), (0.01, 0.02, 0.029, 0.049)
    times_s = (0.019, 0.02, 0.039, 0.04)
    faults = [
        {"target": f"coil.{i:02d}", "mode": "open", "start_s": start_s, "end_s": end_s}
        for i, (start_s, end_s) in enumerate(zip(starts_s, ends_s, strict=True))
    ]
    events = [{"t_s": t_s, "set": "disturbance.load", "value": t_s} for t_s in times_s]
    session = Session(scenarios.load("hold", {"duration": 0.05, "fault": faults, "event": events}))
    monkeypatch.setattr(simulations, "CHUNK_STEPS", chunk * session.scenario.substeps)
    files = Outputs(session, tmp_path / "x.rrd", tmp_path / "x.parquet", live=False, first_tick=20)
    changes = [Change(round(1e3 * t_s), "disturbance.random_bound_Nm", t_s) for t_s in times_s]
    assert follow(session, 50, files.sinks, journal=changes) == "completed"
    assert files.close() == []
    recording = read(tmp_path / "x.rrd")
    for table in (recording.table, read_parquet(tmp_path / "x.parquet")[0]):
        np.testing.assert_allclose(table["t_s"], np.arange(20, 50) * 1e-3, rtol=1e-12)
    expected = [
        *((start_s, f"coil.{i:02d} open") for i, start_s in enumerate(starts_s)),
        # The end at the first tick is none of the file: the part works in all of its rows.
        *((end_s, f"coil.{i:02d} works again") for i, end_s in enumerate(ends_s) if end_s != 0.02),
        *((t_s, f"{name} set to {t_s}") for t_s in times_s for name in LOADS),
    ]
    logged = [(round(t_s, 9), text) for t_s, _, text in recording.log if text.startswith(("coil", *LOADS))]
    assert sorted(logged) == sorted(entry for entry in expected if entry[0] >= 0.02)
