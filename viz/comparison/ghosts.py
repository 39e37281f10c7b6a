"""Bodies of several runs in one scene: the first run's actuator, the others' rotors as tinted ghosts."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple, cast

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme
from spheretwin.viz.recording.part import RecordingPart, RecordingSubject, scalars, time_index
from spheretwin.viz.recording.recorder import MOST_ROWS
from spheretwin.viz.recording.scene3d import Frames, send_path, style_path
from spheretwin.viz.scene.entities import body_quaternions
from spheretwin.viz.scene.meshes import WORLD
from spheretwin.viz.scene.places import shaft_tip


class SubtreeStream:
    """Stream that logs everything below one path of a recording.

    Parameters
    ----------
    recording : RecordingStream
    path : str
        Without a slash at its end.
    """

    def __init__(self, recording: rr.RecordingStream, path: str) -> None:
        self._recording, self._path = recording, path

    def log(self, entity: str, *values: Any, **options: Any) -> None:
        """Log below the path."""
        self._recording.log(f"{self._path}/{entity}", *values, **options)

    def send_columns(self, entity: str, indexes: Any, columns: Any) -> None:
        """Send many rows below the path."""
        self._recording.send_columns(f"{self._path}/{entity}", indexes, columns)

    def send_chunks(self, chunks: Iterable[Chunk]) -> None:
        """Send chunks below the path."""
        self._recording.send_chunks(
            chunk.with_entity_path(f"{self._path}/{chunk.entity_path.removeprefix('/')}") for chunk in chunks
        )

    def flush(self) -> None:
        """Send pending data."""
        self._recording.flush()


def below(recording: rr.RecordingStream, path: str) -> rr.RecordingStream:
    """Return a stream that logs below a path."""
    return cast(rr.RecordingStream, SubtreeStream(recording, path))


class PartBelow(RecordingPart):
    """Part of a recording below a path.

    Parameters
    ----------
    path : str
    part : RecordingPart
    """

    def __init__(self, path: str, part: RecordingPart) -> None:
        super().__init__(part.subject)
        self._path, self._part = path, part

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log what stays the same."""
        self._part.begin(below(recording, self._path))

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Log the rows of one chunk."""
        self._part.write(below(recording, self._path), rows)

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Log how the run ended."""
        self._part.finish(below(recording, self._path), status)


def write_part(recording: rr.RecordingStream, table: Table, part: RecordingPart) -> None:
    """Write a part of the recording of a table, in chunks."""
    part.begin(recording)
    for first in range(0, len(table), MOST_ROWS):
        part.write(recording, table.rows(first, first + MOST_ROWS))
    part.finish(recording, Status.COMPLETED)


class Line(NamedTuple):
    """A line of a plot for some rows, and its style."""

    label: str
    values: Array
    colour: theme.Colour
    width: float = 1.5


def send_lines(recording: rr.RecordingStream, entity: str, t_s: Array, *lines: Line) -> None:
    """Send the lines of one entity; of rows that share a pixel, the lowest and the highest are drawn."""
    look = rr.SeriesLines(
        names=[line.label for line in lines],
        colors=[line.colour for line in lines],
        widths=[line.width for line in lines],
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )
    recording.log(entity, look, static=True)
    values = np.stack([line.values for line in lines], axis=1)
    for first in range(0, len(t_s), MOST_ROWS):
        rows = slice(first, first + MOST_ROWS)
        recording.send_columns(entity, time_index(t_s[rows]), [scalars(values[rows], len(lines))])


def style_point(recording: rr.RecordingStream, entity: str, label: str, colour: theme.Colour) -> None:
    """Log the style of a point that is sent later."""
    thick = rr.Radius.ui_points(6.0)
    recording.log(entity, rr.Points3D.from_fields(labels=[label], colors=[colour], radii=thick), static=True)


def send_point(recording: rr.RecordingStream, entity: str, t_s: Array, positions: Array) -> None:
    """Send where a point is, (n, 3) in m."""
    recording.send_columns(entity, time_index(t_s), rr.Points3D.columns(positions=positions))


ROTOR = f"{WORLD}/rotor"

# Of 255: the rotor within a ghost is visible, and so is the ghost's colour.
GHOST_ALPHA = 90

_TINT = rr.Asset3D.descriptor_albedo_factor()


class Ghost(RecordingPart):
    """Transparent rotor in one colour.

    Parameters
    ----------
    subject : RecordingSubject
    colour : Colour
    angles : str
        Signal of the hinge angles, rad.
    """

    def __init__(self, subject: RecordingSubject, colour: theme.Colour, angles: str = "q_rad") -> None:
        super().__init__(subject)
        self._colour, self._angles, self._frames = colour, angles, Frames()

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the rotor's meshes."""
        for entity, piece in self.subject.meshes.others.items():
            if entity.startswith(f"{ROTOR}/"):
                asset, *places = piece.archetypes()
                tint = rr.Asset3D.from_fields(albedo_factor=[*self._colour, GHOST_ALPHA])
                shape = [
                    batch for batch in asset.as_component_batches() if batch.component_descriptor() != _TINT
                ]
                recording.log(entity, [*shape, *tint.as_component_batches()], *places, static=True)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the ticks that fall on a frame."""
        new = self._frames.of(rows, self._angles)
        if len(new):
            pose = rr.Transform3D.columns(quaternion=body_quaternions(rows[self._angles][new])["rotor"])
            recording.send_columns(ROTOR, time_index(rows["t_s"][new]), pose)


class Tip(RecordingPart):
    """Tip of the shaft, actual or desired: its path, and a point if it has a label.

    Parameters
    ----------
    subject : RecordingSubject
    entity : str
    signal : str
        Hinge angles, rad.
    label : str
        Beside the point; empty without one.
    colour : Colour
    """

    def __init__(
        self, subject: RecordingSubject, entity: str, signal: str, label: str, colour: theme.Colour
    ) -> None:
        super().__init__(subject)
        self._entity, self._signal, self._label, self._colour = entity, signal, label, colour
        self._frames, self._last = Frames(), np.empty((0, 3))

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log the styles of point and path."""
        if self._label:
            style_point(recording, f"{self._entity}/point", self._label, self._colour)
        style_path(recording, f"{self._entity}/path", self._colour)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the ticks that fall on a frame."""
        new = self._frames.of(rows)
        if len(new):
            t_s, tips = rows["t_s"][new], shaft_tip(rows[self._signal][new], self.subject.actuator)
            if self._label:
                send_point(recording, f"{self._entity}/point", t_s, tips)
            send_path(recording, f"{self._entity}/path", t_s, tips, self._last)
            self._last = tips[-1:]
