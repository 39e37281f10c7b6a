"""Files of a run: a fault of one leaves the others, and a refusal leaves nothing."""

import os
import signal

import pytest

from spheretwin import scenario as scenarios
from spheretwin.cli.common import interruptible
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.outputs import Outputs
from spheretwin.session import Session
from spheretwin.simulation import follow


@pytest.fixture
def session():
    return Session(scenarios.load("hold", {"duration": 0.05}))


def test_a_recording_that_cannot_be_put_in_its_place_costs_no_telemetry(session, tmp_path):
    record, telemetry = tmp_path / "x.rrd", tmp_path / "x.parquet"
    files = Outputs(session, record, telemetry, live=False)
    follow(session, 50, files.sinks)
    record.mkdir()
    (fault,) = files.close()
    (kept,) = tmp_path.glob(".x.rrd.*.part")
    assert f"{fault}".startswith(f"output: {record} could not be written, ")
    assert f"{fault}".endswith(f"{kept}")
    assert (files.record, files.telemetry) == (None, telemetry)
    assert len(read_parquet(telemetry)[0]) == 50


def test_telemetry_that_is_refused_leaves_no_recording(session, tmp_path):
    with pytest.raises(InputError, match="writable"):
        Outputs(session, tmp_path / "x.rrd", tmp_path / "missing" / "x.parquet", live=False)
    assert os.listdir(tmp_path) == []


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
