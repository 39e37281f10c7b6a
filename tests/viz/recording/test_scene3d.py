"""Moving parts of the 3D scene: traces, torques as arrows, marks of failures, and their bytes."""

import dataclasses

import mujoco
import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models.kinematics import rate_jacobian, rotation
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.table import Table
from spheretwin.provenance import facts_of
from spheretwin.session import Session
from spheretwin.simulation import follow
from spheretwin.viz.layout.view import TIMELINE
from spheretwin.viz.recording import stream
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.viz.recording.scene3d import Ending, MovingActuator, Torques, Traces
from spheretwin.viz.scene.entities import SCALE, TRACES, TRAIL_S, AXES_LENGTH_m, METRES_PER_Nm
from spheretwin.viz.scene.meshes import FAILURE, FAILURE_TEXT, PAYLOAD, TORQUES

PAYLOAD_kg = 0.1


def recorded(path, name, **changes):
    """Telemetry and status of a run that was recorded."""
    session = Session(scenarios.load(name, {"plant.engine": "lagrangian", **changes}))
    rows = []
    with Recorder(
        session.actuator, session.signals, facts_of(session.initial_scenario), path=path
    ) as recorder:
        recorder.write(first := session.advance(1))
        rows.append(first.values.copy())
        while session.status == "running" and session.tick < session.scenario.ticks:
            recorder.write(chunk := session.advance(min(97, session.scenario.ticks - session.tick)))
            rows.append(chunk.values.copy())
        status = "completed" if session.status == "running" else session.status
        recorder.finish(status)
    return Table(session.signals, np.concatenate(rows)), status


def rows_of(path, entity, component):
    """Times in ms and values of a component, a list for each row, in the order of time."""
    rows = []
    for chunk in RrdReader(path).stream().filter(content=f"/{entity}", has_timeline=TIMELINE):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            times = batch.column(TIMELINE).cast(pa.int64()).to_pylist()
            rows += zip(times, batch.column(component).to_pylist(), strict=True)
    return [(t_ns // 1_000_000, values) for t_ns, values in sorted(rows, key=lambda row: row[0])]


def static(path, entity, component):
    for chunk in RrdReader(path).stream().filter(content=f"/{entity}", is_static=True):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            return batch.column(component).to_pylist()[0]
    raise AssertionError(f"no {component} at {entity}")


@pytest.fixture(scope="module")
def loaded(tmp_path_factory):
    """A run with a payload under load."""
    path = tmp_path_factory.mktemp("moving") / "run.rrd"
    changes = {"duration": 2.2, "plant.payload_kg": PAYLOAD_kg, "disturbance.load": 1.0}
    telemetry, status = recorded(path, "sinusoid", **changes)
    assert status == "completed"
    return path, telemetry


@pytest.mark.parametrize("trace", TRACES, ids=lambda trace: trace.entity)
def test_traces_follow_the_shaft_tip_without_gaps(loaded, actuator, trace):
    path, telemetry = loaded
    rows = rows_of(path, trace.entity, "LineStrips3D:strips")
    ticks, strips = [tick for tick, _ in rows], np.array([strip for _, (strip,) in rows])
    assert len(rows) == pytest.approx(trace.rate_Hz * telemetry["t_s"][-1], abs=2)
    tips = np.array([rotation(pose) @ actuator.shaft_tip_m for pose in telemetry[trace.signal][ticks]])
    # Recordings keep positions in single precision.
    np.testing.assert_allclose(strips[:, 1], tips, atol=1e-8)
    np.testing.assert_array_equal(strips[1:, 0], strips[:-1, 1])


def test_the_ages_of_what_is_shown_of_the_way_meet(actuator):
    way = [trace for trace in TRACES if trace.signal == "q_rad"]
    assert [trace.newest_s for trace in way] == [0.0, *(trace.oldest_s for trace in way[:-1])]
    assert way[-1].oldest_s == TRAIL_S
    saturation = [max(trace.colour) - min(trace.colour) for trace in way]
    widths = [trace.width for trace in way]
    assert saturation == sorted(set(saturation), reverse=True)
    assert widths == sorted(set(widths), reverse=True)


def arrows(path):
    """Ticks, torques in N·m by name, and origins in m of the arrows."""
    names = static(path, TORQUES, "Points3D:labels")
    ticks, vectors = zip(*rows_of(path, TORQUES, "Arrows3D:vectors"), strict=True)
    _, origins = zip(*rows_of(path, TORQUES, "Transform3D:translation"), strict=True)
    torques = {name: [] for name in names}
    for row in vectors:
        for name, vector in zip(names, row, strict=False):  # what has no arrow is last
            torques[name].append(np.array(vector) / METRES_PER_Nm)
    return list(ticks), {name: np.array(values) for name, values in torques.items()}, np.array(origins)[:, 0]


def test_arrows_of_the_coils_are_their_torque_at_the_tip(loaded, actuator):
    path, telemetry = loaded
    ticks, torques, origins = arrows(path)
    # Single precision of a few tenths of a newton metre, and of a tenth of a metre.
    np.testing.assert_allclose(torques["coils"], telemetry["torque_Nm"][ticks], atol=1e-7)
    tips = np.array([rotation(pose) @ actuator.shaft_tip_m for pose in telemetry["q_rad"][ticks]])
    np.testing.assert_allclose(origins, tips, atol=1e-8)


def test_arrows_of_the_load_do_the_work_of_the_disturbance_that_is_subtracted(loaded):
    path, telemetry = loaded
    ticks, torques, _ = arrows(path)
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
    ticks, torques, _ = arrows(path)
    assert np.linalg.norm(torques["gravity"], axis=1).max() > 0.02
    for tick, torque in zip(ticks, torques["gravity"], strict=True):
        data.qpos[:] = telemetry["q_rad"][tick]
        mujoco.mj_forward(model, data)  # at rest: what biases the hinges is weight alone
        generalised = rate_jacobian(telemetry["q_rad"][tick]).T @ torque
        # Single precision.
        np.testing.assert_allclose(generalised, -data.qfrc_bias, atol=1e-8)


def test_gravity_of_the_model_s_own_along_another_line_pulls_along_it(tmp_path, actuator):
    text = actuators.MJCF_PATH.read_text(encoding="utf-8")
    text = text.replace('meshdir="assets"', f'meshdir="{actuators.FOLDER / "assets"}"')
    mine = tmp_path / "mine.xml"
    mine.write_text(text.replace("<option ", '<option gravity="3 -2 -5" '), encoding="utf-8")
    session = Session(scenarios.load("hold", {"plant.engine": "lagrangian"}))
    facts = dataclasses.replace(
        facts_of(session.initial_scenario), mjcf=mine, gravity_m_s2=None, payload_kg=PAYLOAD_kg
    )
    rows = Table(session.signals, np.zeros((1, width(session.signals))))
    rows["q_rad"][:] = pose = np.array([0.3, -0.5, 1.1])
    with Recorder(session.actuator, session.signals, facts, path=tmp_path / "run.rrd") as recorder:
        recorder.write(rows)
    _, torques, _ = arrows(tmp_path / "run.rrd")
    arm = rotation(pose) @ actuator.payload_mount_m
    np.testing.assert_allclose(
        torques["gravity"][0], np.cross(arm, PAYLOAD_kg * np.array([3, -2, -5])), atol=1e-8
    )


def test_without_load_and_payload_there_is_one_arrow(tmp_path):
    recorded(path := tmp_path / "run.rrd", "hold", duration=0.2, **{"disturbance.load": 0.0})
    _, torques, _ = arrows(path)
    assert list(torques) == ["coils", "load"]
    assert len(torques["coils"]) > 1
    assert len(torques["load"]) == 0


def test_the_axes_give_the_scale_of_the_arrows(loaded):
    assert SCALE.endswith("axes are 0.5 N·m long")
    np.testing.assert_allclose(0.5 * METRES_PER_Nm, AXES_LENGTH_m, rtol=1e-15)


def test_a_payload_is_a_solid_in_the_colour_of_its_torque(loaded):
    path, _ = loaded
    assert static(path, PAYLOAD, "Cylinders3D:fill_mode") == [3]  # solid
    payload, weight = (
        static(path, *at) for at in ((PAYLOAD, "Cylinders3D:colors"), (TORQUES, "Arrows3D:colors"))
    )
    assert payload[0] == weight[1]


def mark(path):
    """Time in ms, position and text of each mark of a failure."""
    positions = rows_of(path, FAILURE, "Points3D:positions")
    texts = rows_of(path, FAILURE_TEXT, "Points3D:labels")
    return [(t_ms, *at, *text) for (t_ms, at), (_, text) in zip(positions, texts, strict=True)]


def test_a_failure_is_marked_where_it_happens(tmp_path, actuator):
    changes = {"controller.law": "pd", "disturbance.load": 5.0}
    telemetry, status = recorded(path := tmp_path / "run.rrd", "sinusoid", **changes)
    assert status == "left_workspace"
    ((t_ms, position, text),) = mark(path)
    assert t_ms == len(telemetry) - 1
    np.testing.assert_allclose(position, rotation(telemetry["q_rad"][-1]) @ actuator.shaft_tip_m, atol=1e-8)
    assert text == f"left workspace at {telemetry['t_s'][-1]:.3f} s"


def test_a_run_that_is_complete_or_interrupted_has_no_mark(tmp_path, loaded):
    assert mark(loaded[0]) == []
    session = Session(scenarios.load("hold", {"plant.engine": "lagrangian"}))
    facts, path = facts_of(session.initial_scenario), tmp_path / "run.rrd"
    with Recorder(session.actuator, session.signals, facts, path=path) as recorder:
        recorder.write(session.advance(5))
        recorder.finish("interrupted")
    assert mark(path) == []


@pytest.mark.parametrize("lost", [np.nan, 1e7, 1e99, np.inf])
def test_a_run_that_diverged_is_marked_at_its_last_pose(tmp_path, actuator, lost):
    session = Session(scenarios.load("hold", {"plant.engine": "lagrangian"}))
    facts, path = facts_of(session.initial_scenario), tmp_path / "run.rrd"
    rows = session.advance(40)
    last = rows["q_rad"][30].copy()
    rows["q_rad"][31:] = lost
    rows["torque_Nm"][31:] = lost
    with Recorder(session.actuator, session.signals, facts, path=path) as recorder:
        recorder.write(Table(session.signals, rows.values[:35].copy()))
        recorder.write(Table(session.signals, rows.values[35:].copy()))
        recorder.finish("diverged")
    ((t_ms, position, text),) = mark(path)
    assert (t_ms, text) == (39, "diverged at 0.039 s")
    np.testing.assert_allclose(position, rotation(last) @ actuator.shaft_tip_m, atol=1e-8)


def size(path, duration_s, **changes):
    """Bytes of a recording of the sinusoid."""
    fields = {"plant.engine": "lagrangian", "duration": duration_s, **changes}
    session = Session(scenarios.load("sinusoid", fields))
    with Recorder(
        session.actuator, session.signals, facts_of(session.initial_scenario), path=path
    ) as recorder:
        follow(session, session.scenario.ticks, [recorder])
    return path.stat().st_size


def test_what_moves_takes_fifteen_kilobytes_a_second(tmp_path, monkeypatch):
    monkeypatch.setattr(stream, "PARTS", (MovingActuator, Traces, Torques, Ending))
    bytes_each_s = (size(tmp_path / "long.rrd", 45.0) - size(tmp_path / "short.rrd", 15.0)) / 30
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
    assert size(tmp_path / "tick.rrd", 0.001, **changes) < most


def test_labels_stand_at_the_heads_of_their_arrows(loaded):
    path, _ = loaded
    heads, labels = (rows_of(path, TORQUES, name) for name in ("Arrows3D:vectors", "Points3D:positions"))
    assert labels == heads
    assert static(path, TORQUES, "Points3D:labels") == ["coils", "gravity", "load"]
