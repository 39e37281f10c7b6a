"""Size of a recording: it grows no faster than the telemetry's numbers."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.models.telemetry.signals import width
from spheretwin.provenance import facts_of
from spheretwin.session import Session
from spheretwin.simulation import follow
from spheretwin.viz.recording import plots
from spheretwin.viz.recording.recorder import Recorder


def size_and_raw(path, duration_s, rate_Hz):
    """Bytes of a recording, and of the numbers of all of its run's rows."""
    changes = {"plant.engine": "lagrangian", "duration": duration_s}
    with Session(scenarios.load("sinusoid", changes)) as session:
        facts, ticks = facts_of(session.initial_scenario), session.initial_scenario.ticks
        with Recorder(session.actuator, session.signals, facts, path=path, rate_Hz=rate_Hz) as recorder:
            follow(session, ticks, [recorder])
        raw = ticks * width(session.signals) * np.float64().itemsize
    return np.array([path.stat().st_size, raw])


# Shares of the raw numbers: all that is drawn of them has to fit into what their compression saves; of 1000
# rows a second, 60 and those that stand out are a tenth.
@pytest.mark.parametrize(("rate_Hz", "share"), [(None, 1.0), (60.0, 0.15)])
def test_a_recording_grows_no_faster_than_its_numbers(tmp_path, monkeypatch, rate_Hz, share):
    monkeypatch.setattr(plots, "OPENED_AFTER_s", np.inf)  # a slow machine would add a layout
    brief, long = (size_and_raw(tmp_path / f"{each:g}.rrd", each, rate_Hz) for each in (10.0, 20.0))
    grown, raw = long - brief
    assert grown <= share * raw
