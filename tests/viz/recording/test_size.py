"""Size of a recording: what is drawn besides the telemetry's numbers takes a fifth of their bytes."""

import numpy as np
import pytest

from spheretwin.models.telemetry.signals import width
from spheretwin.simulation import follow
from spheretwin.viz.recording import plots, stream
from spheretwin.viz.recording.currents import CoilCurrents
from spheretwin.viz.recording.plots import PlotData
from tests.viz.recording.recordings import opened


def size_and_raw(path, duration_s, rate_Hz):
    """Bytes of a recording, and of the numbers of all of its run's rows."""
    session, recorder = opened(path, "sinusoid", rate_Hz, duration=duration_s)
    ticks = session.initial_scenario.ticks
    with session, recorder:
        follow(session, ticks, [recorder])
    return np.array([path.stat().st_size, ticks * width(session.signals) * np.float64().itemsize])


# Shares of the raw numbers: 760 bytes a row that do not compress. Every row has 13 derived quantities
# in single precision, 18 bars in half precision and 18 colours: 142 bytes, and some 40 of times and places.
# Of 1000 rows a second, 60 and those that stand out are a tenth. Telemetry, poses, traces, map and states fit
# into what the compression of the numbers saves.
@pytest.mark.parametrize(
    ("rate_Hz", "share", "absent"), [(None, 1.2, ()), (60.0, 0.15, ()), (None, 1.0, (CoilCurrents, PlotData))]
)
def test_pictures_take_a_bounded_share_of_the_numbers(tmp_path, monkeypatch, rate_Hz, share, absent):
    monkeypatch.setattr(plots, "OPENED_AFTER_s", np.inf)  # a slow machine would add a layout
    monkeypatch.setattr(stream, "PARTS", [part for part in stream.PARTS if part not in absent])
    brief, long = (size_and_raw(tmp_path / f"{each:g}.rrd", each, rate_Hz) for each in (10.0, 20.0))
    grown, raw = long - brief
    assert grown <= share * raw
