"""Poses of the actuator, torques, traces of the tip, and the mark of a failure."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models import mjcf
from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.run_record import RunFacts
from spheretwin.models.telemetry.status import Level, Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme
from spheretwin.viz.decimation import FirstRows
from spheretwin.viz.recording.part import RecordingPart, RecordingSubject, strips, time_index
from spheretwin.viz.scene.entities import (
    TORQUE_STYLES,
    TRACES,
    FRAME_RATE_Hz,
    LONGEST_m,
    METRES_PER_Nm,
    TipTrace,
    body_quaternions,
    gravity_torque,
    labels,
    load_torque,
    size_of,
    static_scene,
)
from spheretwin.viz.scene.meshes import FAILURE, FAILURE_TEXT, TORQUES, WORLD
from spheretwin.viz.scene.places import shaft_tip

LARGEST_rad = 1e6
"""Beyond it a pose is meaningless, and its sine has no correct digits."""


class Frames(FirstRows):
    """Selects the first row of each frame, if it has a pose.

    Parameters
    ----------
    rate_Hz : float
        Rate of the frames.
    """

    def __init__(self, rate_Hz: float = FRAME_RATE_Hz) -> None:
        super().__init__(rate_Hz)

    def of(self, rows: Table, angles: str = "q_rad") -> NDArray[np.intp]:
        """Return the places of the rows of a chunk that are drawn, at the hinge angles of a signal."""
        first = self.first_places(rows["t_s"])
        return first[posed(rows[angles][first])]


def posed(q: Array) -> NDArray[np.bool_]:
    """Return True for each pose; the last rows of a run that diverged may have none."""
    small: NDArray[np.bool_] = np.all(np.abs(q) < LARGEST_rad, axis=1)
    return small


class MovingActuator(RecordingPart):
    """Meshes, and the poses of every frame, at the hinge angles of a signal."""

    def __init__(self, subject: RecordingSubject, angles: str = "q_rad") -> None:
        super().__init__(subject)
        self._angles, self._frames = angles, Frames()

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the static parts."""
        scene = static_scene(self.subject.meshes, self.subject.actuator, self.subject.facts.payload_kg > 0)
        recording.send_chunks(scene)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the ticks that fall on a frame."""
        new = self._frames.of(rows, self._angles)
        if not len(new):
            return
        index = time_index(rows["t_s"][new])
        for body, quaternion in body_quaternions(rows[self._angles][new]).items():
            recording.send_columns(f"{WORLD}/{body}", index, rr.Transform3D.columns(quaternion=quaternion))


# A ball around the tip, and its text on top of a pole, clear of the texts of the torques.
MARK_RADIUS_m, POLE_m = 0.006, 0.1


class Ending(RecordingPart):
    """A mark at the shaft's tip from the last tick on, where that is a failure."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._t_s = 0.0
        self._q_rad = np.zeros((1, 3))

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Keep the last pose; of a run that diverged, the last that is one."""
        self._t_s = float(rows["t_s"][-1])
        poses = rows["q_rad"][posed(rows["q_rad"])]
        if len(poses):
            self._q_rad = poses[-1:]

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Mark a failure."""
        if status.level != Level.ERROR:
            return
        tip = shaft_tip(self._q_rad, self.subject.actuator)
        top = tip + size_of(self.subject.actuator) * np.array([0.0, 0.0, POLE_m])
        mark = [
            *rr.Points3D.columns(positions=tip, colors=[theme.FAILURE], radii=[MARK_RADIUS_m]),
            *rr.LineStrips3D.columns(
                strips=np.stack([tip, top], axis=1),
                colors=[theme.FAILURE],
                radii=rr.Radius.ui_points(1.5),
            ),
        ]
        text = f"{status.replace('_', ' ')} at {self._t_s:.3f} s"
        label = rr.Points3D.columns(
            positions=top,
            colors=[theme.label_colour(theme.FAILURE)],
            radii=rr.Radius.ui_points(0.0),
            labels=[text],
        )
        index = time_index(np.array([self._t_s]))
        recording.send_columns(FAILURE, index, mark)
        recording.send_columns(FAILURE_TEXT, index, label)


RATE_Hz = 20.0


class Torques(RecordingPart):
    """Torques of the coils, of a payload's weight, and of the load if there is one."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._frames = Frames(RATE_Hz)
        self._gravity_m_s2 = _gravity(subject.facts)

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log names and colours; the load is the last, so that it can be left out."""
        shown = [TORQUE_STYLES[name] for name in ("coils", *self._weight(), "load")]
        colours = [torque.colour for torque in shown]
        style = rr.Arrows3D.from_fields(colors=colours, radii=rr.Radius.ui_points(2.5))
        recording.log(TORQUES, style, labels([torque.label for torque in shown], colours), static=True)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the ticks that fall on a frame."""
        new = self._frames.of(rows)
        if not len(new):
            return
        q, load_Nm = rows["q_rad"][new], rows["disturbance_Nm"][new]
        torques = [rows["torque_Nm"][new]]
        if self._weight():
            actuator, facts = self.subject.actuator, self.subject.facts
            torques.append(gravity_torque(q, facts.payload_kg, actuator.payload_mount_m, self._gravity_m_s2))
        torques.append(load_torque(q, load_Nm))
        metres = size_of(self.subject.actuator) * METRES_PER_Nm
        vectors = np.clip(metres * np.stack(torques, axis=1), -LONGEST_m, LONGEST_m)
        visible = np.ones(vectors.shape[:2], dtype=bool)
        visible[:, -1] = np.any(load_Nm != 0, axis=1)
        count = visible.sum(axis=1)
        columns = [
            *rr.Arrows3D.columns(vectors=vectors[visible]).partition(count),
            # Labels at the heads: the same numbers once more, which takes no bytes.
            *rr.Points3D.columns(positions=vectors[visible]).partition(count),
            *rr.Transform3D.columns(translation=shaft_tip(q, self.subject.actuator)),
        ]
        recording.send_columns(TORQUES, time_index(rows["t_s"][new]), columns)

    def _weight(self) -> tuple[str, ...]:
        return ("gravity",) if self.subject.facts.payload_kg else ()


def _gravity(facts: RunFacts) -> Array:
    """Gravity in the stator frame, (3,) in m/s²."""
    if facts.gravity_m_s2 is not None:
        return np.array([0.0, 0.0, -facts.gravity_m_s2])
    return np.array(mjcf.gravity(mjcf.read(facts.mjcf).described.opt))


def style_path(recording: rr.RecordingStream, entity: str, colour: theme.Colour, width: float = 1.5) -> None:
    """Log the style of a path that is sent later."""
    style = rr.LineStrips3D.from_fields(colors=[colour], radii=rr.Radius.ui_points(width))
    recording.log(entity, style, static=True)


def send_path(
    recording: rr.RecordingStream,
    entity: str,
    t_s: Array,
    positions: Array,
    before: Array,
) -> None:
    """Send the path of a point as a short segment a row.

    Parameters
    ----------
    recording : RecordingStream
    entity : str
    t_s : (n,) array, s
    positions : (n, 3) array, m
    before : (1, 3) or (0, 3) array, m
        Its position before, if there is one.
    """
    starts = np.concatenate([before if len(before) else positions[:1], positions[:-1]])
    segments = strips(np.stack([starts, positions], axis=1))
    recording.send_columns(entity, time_index(t_s), rr.LineStrips3D.columns(strips=segments))


class Traces(RecordingPart):
    """Traces of the tip: one short segment for each frame; the view shows those of each trace's ages."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._frames = {trace: Frames(trace.rate_Hz) for trace in TRACES}
        self._last: dict[TipTrace, Array] = {}

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the style of each trace."""
        for trace in TRACES:
            style_path(recording, trace.entity, trace.colour, trace.width)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the ticks that fall on a frame."""
        for trace, frames in self._frames.items():
            new = frames.of(rows)
            if len(new):
                self._send(recording, trace, rows["t_s"][new], rows[trace.signal][new])

    def _send(self, recording: rr.RecordingStream, trace: TipTrace, t_s: Array, q: Array) -> None:
        tips = shaft_tip(q, self.subject.actuator)
        send_path(recording, trace.entity, t_s, tips, self._last.get(trace, tips[:1]))
        self._last[trace] = tips[-1:]
