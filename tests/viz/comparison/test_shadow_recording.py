"""Recording of a shadow: its lines are the telemetry, its bodies the measured and the estimated poses."""

import numpy as np
import pytest

from spheretwin.analysis.comparison import subject_of
from spheretwin.machine import Log, shadow
from spheretwin.machine.model import model_of
from spheretwin.machine.state_estimation import Verdict
from spheretwin.viz.comparison import shadow_recording
from spheretwin.viz.comparison.shadow_recording import CONFIDENCE
from spheretwin.viz.scene.entities import body_quaternions
from tests.viz.recording.panels import columns


@pytest.fixture(scope="module")
def estimated():
    generator = np.random.default_rng(0)
    t_s = 1e-3 * np.arange(400)
    angle_rad = 0.1 * np.sin(2 * np.pi * t_s)[:, None] * [1.0, -1.0, 2.0]
    angle_rad = angle_rad + generator.normal(0, 1e-4, (400, 3))
    angle_rad[100:120, 1] = np.nan
    model = model_of("hold", {"hardware": "electronics"})
    log = Log(t_s, np.zeros((400, 18)), angle_rad, accepted=("gaps",))
    return log, shadow(log, model), model


@pytest.fixture(scope="module")
def recorded(estimated, tmp_path_factory):
    path = tmp_path_factory.mktemp("shadow") / "shadow.rrd"
    log, result, model = estimated
    subject = subject_of(model.scenario, model.actuator)
    text = Verdict(result.chi2, result.consistent).markdown(log)
    shadow_recording.write(path, result.telemetry, np.zeros((400, 18)), subject, text)
    return columns(path)[0]


def rows_of(recorded, entity, component):
    return [row for part in recorded[entity, component] for row in part.to_pylist()]


def lines(recorded, entity):
    """Values of the lines of a plot, a column each."""
    return np.array(rows_of(recorded, entity, "Scalars:scalars"), dtype=float)


def test_each_line_is_its_column(recorded, estimated):
    telemetry = estimated[1].telemetry
    angles = np.hstack([telemetry["q_measured_rad"], telemetry["q_estimated_rad"]])
    np.testing.assert_array_equal(lines(recorded, "/plots/angle"), angles)
    innovations = lines(recorded, "/plots/innovation")
    np.testing.assert_array_equal(innovations[:, :3], telemetry["innovation_normalised"])
    np.testing.assert_array_equal(innovations[:, 3:], np.tile([CONFIDENCE, -CONFIDENCE], (400, 1)))
    mean = 1e3 * telemetry["disturbance_estimated_Nm"]
    half = 1e3 * CONFIDENCE * telemetry["disturbance_estimated_Nm_std"]
    drawn = lines(recorded, "/plots/disturbance_estimated_Nm").reshape(-1, 3, 3)
    for place, expected in enumerate((mean, mean + half, mean - half)):
        np.testing.assert_allclose(drawn[:, :, place], expected, rtol=1e-15)


def test_the_machine_is_drawn_as_measured_and_the_twin_as_estimated(recorded, estimated):
    telemetry = estimated[1].telemetry
    for root, angles in (("machine", "q_measured_rad"), ("twin", "q_estimated_rad")):
        drawn = np.array(rows_of(recorded, f"/{root}/world/rotor", "Transform3D:quaternion"))[:, 0]
        valid = np.all(np.isfinite(telemetry[angles]), axis=1)
        poses = body_quaternions(telemetry[angles][valid])["rotor"]
        nearest = [np.min(np.linalg.norm(poses - pose, axis=1)) for pose in drawn]
        # Quaternions of a recording have single precision.
        assert np.max(nearest) < 1e-6
        assert len(drawn) > 5


def test_the_text_has_the_verdict_and_the_accepted_findings(recorded):
    *_, (text,) = rows_of(recorded, "/verdict", "TextDocument:text")
    assert "consistent" in text
    assert "Accepted findings of `log check`: gaps." in text
