"""Moving parts of the 3D scene: traces, torques as arrows, marks of failures, and their bytes."""

import dataclasses
from itertools import pairwise

import mujoco
import numpy as np
import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models.kinematics import rate_jacobian, rotation
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.recording import stream
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.viz.recording.scene3d import Ending, MovingActuator, Torques, Traces
from spheretwin.viz.scene.entities import TRACES, METRES_PER_Nm
from spheretwin.viz.scene.meshes import FAILURE, FAILURE_TEXT, TORQUES
from spheretwin.viz.scene.places import shaft_tip
from tests.models.model_files import edited
from tests.viz.recording.recordings import opened, recorded, session_and_facts, static, timed

PAYLOAD_kg = 0.1


@pytest.fixture(scope="module")
def loaded(tmp_path_factory):
    """A run with a payload under load, recorded in chunks."""
    path = tmp_path_factory.mktemp("moving") / "run.rrd"
    changes = {"duration": 2.2, "plant.payload_kg": PAYLOAD_kg, "disturbance.load": 1.0}
    session, recorder = opened(path, "sinusoid", **changes)
    telemetry = session.advance(2200)
    with recorder:
        for first, last in pairwise((0, 1, *range(98, 2200, 97), 2200)):
            recorder.write(telemetry.rows(first, last))
        recorder.finish("completed")
    return path, telemetry


@pytest.mark.parametrize("trace", TRACES, ids=lambda trace: trace.entity)
def test_traces_follow_the_shaft_tip_without_gaps(loaded, actuator, trace):
    path, telemetry = loaded
    ticks, strips = zip(*timed(path, trace.entity, "LineStrips3D:strips"), strict=True)
    tips = shaft_tip(telemetry[trace.signal][list(ticks)], actuator)
    ends = np.array(strips)[:, 0]
    np.testing.assert_allclose(ends[:, 1], tips, atol=1e-8)  # single precision
    np.testing.assert_array_equal(ends[1:, 0], ends[:-1, 1])


def arrows(path):
    """Ticks, and torques in N·m by name, of the arrows."""
    names = static(path, TORQUES, "Points3D:labels")
    ticks, vectors = zip(*timed(path, TORQUES, "Arrows3D:vectors"), strict=True)
    torques = {name: [] for name in names}
    for row in vectors:
        for name, vector in zip(names, row, strict=False):  # what has no arrow is last
            torques[name].append(np.array(vector) / METRES_PER_Nm)
    return list(ticks), {name: np.array(values) for name, values in torques.items()}


def test_arrows_of_the_load_do_the_work_of_the_disturbance_that_is_subtracted(loaded):
    path, telemetry = loaded
    ticks, torques = arrows(path)
    for tick, torque in zip(ticks, torques["load"], strict=True):
        generalised = rate_jacobian(telemetry["q_rad"][tick]).T @ torque
        np.testing.assert_allclose(generalised, -telemetry["disturbance_Nm"][tick], atol=1e-7)


def test_arrows_of_gravity_are_what_the_engine_finds_for_the_payload(loaded):
    path, telemetry = loaded
    model = mujoco.MjModel.from_xml_path(str(actuators.MJCF_PATH))
    payload = model.body("payload").id
    model.body_mass[payload] = PAYLOAD_kg
    model.body_ipos[payload] = 0.0
    data = mujoco.MjData(model)
    ticks, torques = arrows(path)
    assert np.linalg.norm(torques["gravity"], axis=1).max() > 0.02
    for tick, torque in zip(ticks, torques["gravity"], strict=True):
        data.qpos[:] = telemetry["q_rad"][tick]
        mujoco.mj_forward(model, data)  # at rest: what biases the hinges is weight alone
        generalised = rate_jacobian(telemetry["q_rad"][tick]).T @ torque
        # Single precision.
        np.testing.assert_allclose(generalised, -data.qfrc_bias, atol=1e-8)


def test_gravity_of_the_model_s_own_along_another_line_pulls_along_it(tmp_path, actuator):
    mine = edited(tmp_path, ("<option ", '<option gravity="3 -2 -5" '))
    session, facts = session_and_facts()
    facts = dataclasses.replace(facts, mjcf=mine, gravity_m_s2=None, payload_kg=PAYLOAD_kg)
    rows = Table(session.signals, np.zeros((1, width(session.signals))))
    rows["q_rad"][:] = pose = np.array([0.3, -0.5, 1.1])
    with Recorder(session.actuator, session.signals, facts, path=tmp_path / "run.rrd") as recorder:
        recorder.write(rows)
    _, torques = arrows(tmp_path / "run.rrd")
    arm = rotation(pose) @ actuator.payload_mount_m
    np.testing.assert_allclose(
        torques["gravity"][0], np.cross(arm, PAYLOAD_kg * np.array([3, -2, -5])), atol=1e-8
    )


def mark(path):
    """Time in ms, position and text of each mark of a failure."""
    positions = timed(path, FAILURE, "Points3D:positions")
    texts = timed(path, FAILURE_TEXT, "Points3D:labels")
    return [(t_ms, *at, *text) for (t_ms, at), (_, text) in zip(positions, texts, strict=True)]


@pytest.mark.parametrize("lost", [np.nan, 1e7, 1e99, np.inf])
def test_a_run_that_diverged_is_marked_at_its_last_pose(tmp_path, actuator, lost):
    session, recorder = opened(path := tmp_path / "run.rrd")
    rows = session.advance(40)
    last = rows["q_rad"][30].copy()
    rows["q_rad"][31:] = lost
    rows["torque_Nm"][31:] = lost
    with recorder:
        recorder.write(Table(session.signals, rows.values[:35].copy()))
        recorder.write(Table(session.signals, rows.values[35:].copy()))
        recorder.finish("diverged")
    ((t_ms, position, text),) = mark(path)
    assert (t_ms, text) == (39, "diverged at 0.039 s")
    np.testing.assert_allclose(position, rotation(last) @ actuator.shaft_tip_m, atol=1e-8)


def test_what_moves_takes_fifteen_kilobytes_a_second(tmp_path, monkeypatch):
    monkeypatch.setattr(stream, "PARTS", (MovingActuator, Traces, Torques, Ending))
    brief, long = tmp_path / "brief.rrd", tmp_path / "long.rrd"
    for path, duration_s in ((brief, 15.0), (long, 45.0)):
        recorded(path, "sinusoid", duration=duration_s)
    bytes_each_s = (long.stat().st_size - brief.stat().st_size) / 30
    # A fifth of what a thinned recording may take; below half of it, something is missing.
    assert 7_500 < bytes_each_s < 15_000


FAULT = {"target": "coil.04", "mode": "open", "start_s": 0.0}


# Meshes, layout, texts, descriptions of the signals, and a single row. The prototype has 13 more signals,
# and plots of them, of which each is told in some ten kilobytes.
@pytest.mark.parametrize(
    ("changes", "most"),
    [({}, 1_000_000), ({"hardware": "electronics", "plant.engine": "mujoco", "fault": [FAULT]}, 1_150_000)],
    ids=["ideal", "electronics"],
)
def test_what_a_recording_holds_whatever_its_length_is_bounded(tmp_path, changes, most):
    recorded(path := tmp_path / "tick.rrd", "sinusoid", duration=0.001, **changes)
    assert path.stat().st_size < most
