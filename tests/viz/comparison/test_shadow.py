"""Live view of a shadow: a viewer gets rows of 60 Hz, the verdict, and the windows and alarms of a watch."""

import urllib.request

import numpy as np
import pytest

from spheretwin.analysis.comparison import subject_of
from spheretwin.machine import Log
from spheretwin.machine.model import model_of
from spheretwin.machine.state_estimation import followed, signals
from spheretwin.viz.comparison.shadow import ALARMS, TEXT, WINDOWS, ShadowView
from spheretwin.viz.recording.live import RECORDING
from tests.viz.recording.panels import columns, series

ROWS, BLOCK = 1500, 20


@pytest.fixture(scope="module")
def log():
    t_s = 5.0 + 1e-3 * np.arange(ROWS)
    noise_rad = np.random.default_rng(0).normal(0, 1e-4, (ROWS, 3))
    angle_rad = 0.1 * np.sin(2 * np.pi * t_s)[:, None] * [1.0, -1.0, 2.0] + noise_rad
    return Log(t_s, np.zeros((ROWS, 18)), angle_rad)


def received(log, folder, *, watched):
    """Telemetry of the shadow of a log, and what a viewer gets that asks after the first block."""
    model = model_of("hold", {"hardware": "electronics"})
    view = ShadowView(subject_of(model.scenario, model.actuator), signals(False), watched=watched)
    viewers = []

    def show(block, telemetry, verdict):
        view.show(telemetry, block.current_A, verdict.markdown(block))
        if watched:
            view.judge([(float(block.t_s[-1]), 1.1, 0.2)], [(float(block.t_s[0]), "torque_scale -0.03")])
        viewers[:] = viewers or [urllib.request.urlopen(view.address.rstrip("/") + RECORDING)]

    blocks = (log.rows(first, first + BLOCK) for first in range(0, ROWS, BLOCK))
    _, result = followed(blocks, model, report=show)
    view.flush()
    view.close()
    path = folder / "received.rrd"
    path.write_bytes(viewers[0].read())
    return result.telemetry, columns(path)


def test_a_viewer_gets_the_first_row_of_each_frame_and_the_verdict(log, tmp_path):
    telemetry, read = received(log, tmp_path, watched=False)
    firsts = np.flatnonzero(np.diff(np.floor(telemetry["t_s"] * 60 + 1e-6), prepend=0))
    t_ns, drawn = series(read, "plots/angle", "Scalars:scalars")
    np.testing.assert_array_equal(t_ns, np.round(1e9 * telemetry["t_s"][firsts]))
    expected = np.hstack([telemetry["q_measured_rad"], telemetry["q_estimated_rad"]])[firsts]
    np.testing.assert_array_equal(drawn, expected)
    _, rates = series(read, "plots/qdot_estimated_rad_s", "Scalars:scalars")
    assert np.all(np.isnan(rates[0]))  # of the first row nothing is known: its band would hide all others
    mean, half = telemetry["qdot_estimated_rad_s"], 1.96 * telemetry["qdot_estimated_rad_s_std"]
    np.testing.assert_array_equal(rates[-2:, 3:], mean[firsts[-2:]])
    shades = np.abs(rates[-2:, :3] - mean[firsts[-2:]])
    np.testing.assert_allclose(shades, half[firsts[-2:]], rtol=1e-9)
    sides = np.sign(rates[-2:, :3] - mean[firsts[-2:]])
    np.testing.assert_array_equal(sides[0], -sides[1])  # from one limit to the other: the band is filled
    values, _ = read
    assert len(values["/machine/world/rotor", "Transform3D:quaternion"]) == 2  # a second, and the rest
    assert len(values["/twin/world/rotor", "Transform3D:quaternion"]) == 2
    texts = [text for part in values[f"/{TEXT}", "TextDocument:text"] for (text,) in part.to_pylist()]
    assert texts[-1].startswith("**log: model and measurement are not consistent.**")


def test_a_watch_has_a_lane_and_its_alarms_as_text(log, tmp_path):
    telemetry, read = received(log, tmp_path, watched=True)
    t_ns, windows = series(read, WINDOWS, "Scalars:scalars")
    ends = np.round(1e9 * telemetry["t_s"][BLOCK - 1 :: BLOCK])
    np.testing.assert_array_equal(t_ns, ends)
    np.testing.assert_array_equal(windows, [[1.1, 0.2, 1.0]] * len(ends))
    alarms = read[0][f"/{ALARMS}", "TextLog:text"]
    assert [text for part in alarms for (text,) in part.to_pylist()] == ["torque_scale -0.03"] * len(ends)
