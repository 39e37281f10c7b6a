"""The torques on the rotor, as arrows at the shaft's tip."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models import mjcf
from spheretwin.models.telemetry.facts import RunFacts
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.recording.columns import time_index
from spheretwin.viz.recording.parts.moving.frames import Frames
from spheretwin.viz.recording.parts.part import Part, Subject
from spheretwin.viz.scene.marks import labels, size_of
from spheretwin.viz.scene.paths import TORQUES
from spheretwin.viz.scene.poses import shaft_tip
from spheretwin.viz.scene.torques import SHOWN, LONGEST_m, METRES_PER_Nm, gravity_torque, load_torque

RATE_Hz = 20.0


class Torques(Part):
    """Of the coils, of a payload's weight, and of the load where there is one."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._frames = Frames(RATE_Hz)
        self._gravity_m_s2 = _gravity(subject.facts)

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log names and colours; the load is the last, so that it can be left out."""
        shown = [SHOWN[name] for name in ("coils", *self._weight(), "load")]
        colours = [torque.colour for torque in shown]
        style = rr.Arrows3D.from_fields(colors=colours, radii=rr.Radius.ui_points(2.5))
        recording.log(TORQUES, style, labels([torque.label for torque in shown], colours), static=True)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the ticks that fall on a frame."""
        new = self._frames.of(rows)
        if not np.any(new):
            return
        q, load_Nm = rows["q_rad"][new], rows["disturbance_Nm"][new]
        torques = [rows["torque_Nm"][new]]
        if self._weight():
            actuator, facts = self.subject.actuator, self.subject.facts
            torques.append(gravity_torque(q, facts.payload_kg, actuator.payload_mount_m, self._gravity_m_s2))
        torques.append(load_torque(q, load_Nm))
        metres = size_of(self.subject.actuator) * METRES_PER_Nm
        vectors = np.clip(metres * np.stack(torques, axis=1), -LONGEST_m, LONGEST_m)
        drawn = np.ones(vectors.shape[:2], dtype=bool)
        drawn[:, -1] = np.any(load_Nm != 0, axis=1)
        count = drawn.sum(axis=1)
        columns = [
            *rr.Arrows3D.columns(vectors=vectors[drawn]).partition(count),
            # Labels at the heads: the same numbers once more, which takes no bytes.
            *rr.Points3D.columns(positions=vectors[drawn]).partition(count),
            *rr.Transform3D.columns(translation=shaft_tip(q, self.subject.actuator)),
        ]
        recording.send_columns(TORQUES, time_index(rows["t_s"][new]), columns)

    def _weight(self) -> tuple[str, ...]:
        return ("gravity",) if self.subject.facts.payload_kg else ()


def _gravity(facts: RunFacts) -> NDArray[np.float64]:
    """Gravity in the stator frame, (3,) in m/s²."""
    if facts.gravity_m_s2 is not None:
        return np.array([0.0, 0.0, -facts.gravity_m_s2])
    return np.array(mjcf.gravity(mjcf.read(facts.mjcf).described.opt))
