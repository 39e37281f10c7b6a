"""The actuator once, the rotor of every run in it: the first's as it is, the others' as tinted ghosts."""

from __future__ import annotations

import numpy as np
import rerun as rr

from spheretwin.models.telemetry.table import Table
from spheretwin.viz import palette
from spheretwin.viz.merged.series import send_point, style_point
from spheretwin.viz.recording.parts.actuator import FRAME_RATE_Hz, MovingActuator
from spheretwin.viz.recording.parts.part import Subject
from spheretwin.viz.scene.meshes import read_meshes
from spheretwin.viz.scene.paths import TIP, WORLD
from spheretwin.viz.scene.poses import shaft_tip
from spheretwin.viz.scene.still import log_shapes, style_traces

ROTOR = f"{WORLD}/rotor"
POINT = f"{TIP}/point"

# Of 255: through a ghost the rotor within it is seen, and its colour still.
GHOST_ALPHA = 90

_TINT = rr.Mesh3D.descriptor_albedo_factor()


class Body(MovingActuator):
    """As in a recording of the run alone, but with its tip, and the trace of it, in the run's colour.

    Parameters
    ----------
    subject : Subject
    number : int
        Written beside the tip.
    colour : Colour
    """

    def __init__(self, subject: Subject, number: int, colour: palette.Colour) -> None:
        super().__init__(subject)
        self._number, self.colour = number, colour

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log what keeps its shape."""
        self.log_shapes(recording)
        style_traces(recording, self.colour)
        style_point(recording, POINT, f"{self._number}", self.colour)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the ticks that fall on a frame."""
        super().write(recording, rows)
        frames = np.floor(rows["t_s"] * FRAME_RATE_Hz + 1e-6)
        first = np.unique(frames, return_index=True)[1]
        tips = shaft_tip(rows["q_rad"][first], self.subject.actuator)
        send_point(recording, POINT, rows["t_s"][first], tips)

    def log_shapes(self, recording: rr.RecordingStream) -> None:
        """Log all meshes."""
        facts = self.subject.facts
        log_shapes(recording, self.subject.actuator, facts.mjcf, facts.payload_kg)


class Ghost(Body):
    """A rotor alone, in the run's colour, that what is behind it is seen through."""

    def log_shapes(self, recording: rr.RecordingStream) -> None:
        """Log the rotor's meshes."""
        tint = rr.Mesh3D.from_fields(albedo_factor=[*self.colour, GHOST_ALPHA])
        for entity, mesh in read_meshes(self.subject.facts.mjcf).items():
            if entity.startswith(f"{ROTOR}/"):
                shape = [each for each in mesh.as_component_batches() if each.component_descriptor() != _TINT]
                recording.log(entity, [*shape, *tint.as_component_batches()], static=True)
