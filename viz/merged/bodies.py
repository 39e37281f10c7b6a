"""The actuator once, the rotor of every run in it: the first's as it is, the others' as tinted ghosts."""

from __future__ import annotations

import numpy as np
import rerun as rr

from spheretwin.models.telemetry.table import Table
from spheretwin.viz import palette
from spheretwin.viz.merged.series import send_path, send_point, style_path, style_point
from spheretwin.viz.recording.columns import time_index
from spheretwin.viz.recording.parts.moving.actuator import MovingActuator
from spheretwin.viz.recording.parts.moving.frames import Frames
from spheretwin.viz.recording.parts.part import Part, Subject
from spheretwin.viz.scene.meshes import read_meshes
from spheretwin.viz.scene.paths import WORLD
from spheretwin.viz.scene.poses import body_quaternions, shaft_tip

ROTOR = f"{WORLD}/rotor"

# Of 255: through a ghost the rotor within it is seen, and its colour still.
GHOST_ALPHA = 90

_TINT = rr.Asset3D.descriptor_albedo_factor()


class Ghost(Part):
    """A rotor alone, in one colour, that what is behind it is seen through.

    Parameters
    ----------
    subject : Subject
    colour : Colour
    """

    def __init__(self, subject: Subject, colour: palette.Colour) -> None:
        super().__init__(subject)
        self._colour, self._frames = colour, Frames()

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the rotor's meshes."""
        for entity, piece in read_meshes(self.subject.facts.mjcf).others.items():
            if entity.startswith(f"{ROTOR}/"):
                asset, *places = piece.archetypes()
                tint = rr.Asset3D.from_fields(albedo_factor=[*self._colour, GHOST_ALPHA])
                shape = [
                    each for each in asset.as_component_batches() if each.component_descriptor() != _TINT
                ]
                recording.log(entity, [*shape, *tint.as_component_batches()], *places, static=True)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the ticks that fall on a frame."""
        new = self._frames.of(rows)
        if np.any(new):
            pose = rr.Transform3D.columns(quaternion=body_quaternions(rows["q_rad"][new])["rotor"])
            recording.send_columns(ROTOR, time_index(rows["t_s"][new]), pose)


class Tip(Part):
    """The end of the shaft, or where it should be: the path behind it, and it itself where it has a label.

    Parameters
    ----------
    subject : Subject
    entity : str
    signal : str
        Hinge angles, rad.
    label : str
        Beside the point; empty without one.
    colour : Colour
    """

    def __init__(
        self, subject: Subject, entity: str, signal: str, label: str, colour: palette.Colour
    ) -> None:
        super().__init__(subject)
        self._entity, self._signal, self._label, self._colour = entity, signal, label, colour
        self._frames, self._last = Frames(), np.empty((0, 3))

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log how both look."""
        if self._label:
            style_point(recording, f"{self._entity}/point", self._label, self._colour)
        style_path(recording, f"{self._entity}/path", self._colour)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the ticks that fall on a frame."""
        new = self._frames.of(rows)
        if np.any(new):
            t_s, tips = rows["t_s"][new], shaft_tip(rows[self._signal][new], self.subject.actuator)
            if self._label:
                send_point(recording, f"{self._entity}/point", t_s, tips)
            send_path(recording, f"{self._entity}/path", t_s, tips, self._last)
            self._last = tips[-1:]


def body(subject: Subject, colour: palette.Colour, *, ghost: bool) -> Part:
    """What of a run is drawn: the whole actuator, or its rotor as a ghost."""
    return Ghost(subject, colour) if ghost else MovingActuator(subject)
