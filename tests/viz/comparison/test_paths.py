"""Paths in a recording: unbroken, and the same for any chunks."""

from types import SimpleNamespace

import numpy as np
import pytest
import rerun as rr

from spheretwin.models.telemetry.signals import Signal
from spheretwin.viz.comparison.ghosts import Tip
from spheretwin.viz.scene.entities import FRAME_RATE_Hz, shaft_tip
from tests.viz.recording.recordings import timed
from tests.viz.tables import table_of

SIGNALS = (Signal("t_s", "s", 1, "time"), Signal("q_rad", "rad", 3, "angles"))
FRAMES = 30


@pytest.mark.parametrize("cuts", [(), (11,), (1, 2, 29)])
def test_each_segment_of_a_path_begins_where_the_one_before_ended(tmp_path, actuator, cuts):
    q_rad = 0.02 * np.arange(FRAMES)[:, None] * [1.0, -0.5, 2.0]
    table = table_of(SIGNALS, (np.arange(FRAMES) + 0.5) / FRAME_RATE_Hz, q_rad=q_rad)
    recording = rr.RecordingStream("paths")
    recording.save(path := tmp_path / "run.rrd")
    tip = Tip(SimpleNamespace(actuator=actuator), "tip", "q_rad", "", (1, 2, 3))
    for first, last in zip((0, *cuts), (*cuts, FRAMES), strict=True):
        tip.write(recording, table.rows(first, last))
    recording.flush()
    recording.disconnect()
    strips = [row for _, row in timed(path, "tip/path", "LineStrips3D:strips")]
    ends = np.array(strips).reshape(FRAMES, 2, 3)
    tips = shaft_tip(table["q_rad"], actuator)
    # Single precision.
    np.testing.assert_allclose(ends[:, 1], tips, atol=1e-7)
    np.testing.assert_allclose(ends[1:, 0], tips[:-1], atol=1e-7)
