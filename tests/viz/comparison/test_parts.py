"""Parts of comparisons: a reference once, lines with every row, unbroken paths."""

from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr

from spheretwin.models.telemetry.signals import Signal, common_signals
from spheretwin.viz.comparison import ghosts
from spheretwin.viz.comparison.ghosts import Tip
from spheretwin.viz.comparison.runs import leaders
from spheretwin.viz.scene.entities import FRAME_RATE_Hz
from spheretwin.viz.scene.places import shaft_tip
from tests.viz.comparison.compared import SIGNALS, T_s
from tests.viz.recording.recordings import timed
from tests.viz.tables import chunks, table_of


def reference(rows, period_s, rate=1.0):
    t_s = np.arange(rows) * period_s
    return table_of(common_signals(3), t_s, q_ref_rad=np.sin(rate * t_s)[:, None])


@pytest.mark.parametrize(
    ("references", "expected"),
    [
        ([(100, 1e-3), (300, 7e-4), (50, 2e-3)], [1]),
        ([(100, 1e-3), (90, 1e-3, 2.0), (80, 1e-3), (95, 1e-3, 2.0)], [0, 3]),
        ([(1, 1e-3), (1, 1e-3)], [0]),
    ],
)
def test_the_longest_of_equal_references_is_shown_at_whatever_rate(references, expected):
    assert leaders([reference(*each) for each in references]) == expected


class Sent:
    """Stands in for a stream: what is sent."""

    def __init__(self):
        self.rows, self.static = [], []

    def log(self, entity, *values, static):
        self.static.append((entity, values, static))

    def send_columns(self, entity, indexes, columns):
        (index,), (values,) = indexes, columns
        t_ns = np.asarray(index.as_arrow_array().cast(pa.int64()))
        self.rows.append((t_ns, np.asarray(values.as_arrow_array().flatten())))


@pytest.mark.parametrize("rows", [1, 999, 1000, 1001, 4000])
@pytest.mark.parametrize("name", SIGNALS)
def test_every_tick_is_sent_once(monkeypatch, name, rows):
    monkeypatch.setattr(ghosts, "MOST_ROWS", 1000)
    sent, values = Sent(), SIGNALS[name][:rows]
    ghosts.send_lines(sent, "run/compare/x", T_s[:rows], ghosts.Line("1 run", values, (1, 2, 3)))
    assert [len(t_ns) for t_ns, _ in sent.rows] == [1000] * (rows // 1000) + [rows % 1000] * (rows % 1000 > 0)
    np.testing.assert_array_equal(np.concatenate([t_ns for t_ns, _ in sent.rows]), np.round(T_s[:rows] * 1e9))
    np.testing.assert_array_equal(np.concatenate([drawn for _, drawn in sent.rows]), values)


TIP_SIGNALS = (Signal("t_s", "s", 1, "time"), Signal("q_rad", "rad", 3, "angles"))
FRAMES = 30


@pytest.mark.parametrize("cuts", [(), (11,), (1, 2, 29)])
def test_each_segment_of_a_path_begins_where_the_one_before_ended(tmp_path, actuator, cuts):
    q_rad = 0.02 * np.arange(FRAMES)[:, None] * [1.0, -0.5, 2.0]
    table = table_of(TIP_SIGNALS, (np.arange(FRAMES) + 0.5) / FRAME_RATE_Hz, q_rad=q_rad)
    recording = rr.RecordingStream("paths")
    recording.save(path := tmp_path / "run.rrd")
    tip = Tip(SimpleNamespace(actuator=actuator), "tip", "q_rad", "", (1, 2, 3))
    for rows in chunks(table, cuts):
        tip.write(recording, rows)
    recording.flush()
    recording.disconnect()
    strips = [row for _, row in timed(path, "tip/path", "LineStrips3D:strips")]
    ends = np.array(strips).reshape(FRAMES, 2, 3)
    tips = shaft_tip(table["q_rad"], actuator)
    # Single precision.
    np.testing.assert_allclose(ends[:, 1], tips, atol=1e-7)
    np.testing.assert_allclose(ends[1:, 0], tips[:-1], atol=1e-7)
