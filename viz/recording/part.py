"""A part of a recording: what it logs at the start, of every chunk, and at the end."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import ClassVar

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.telemetry.run_record import RunFacts
from spheretwin.models.telemetry.signals import COMMON_NAMES, Signal
from spheretwin.models.telemetry.status import Event, Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.view import CHECKSUM, LIVE_WINDOW_S, OVERVIEW, TIMELINE, TOTAL, View
from spheretwin.viz.rerun_internals import ArrowComponent
from spheretwin.viz.scene.entities import size_of
from spheretwin.viz.scene.meshes import Meshes, read_meshes


class RowSet(Enum):
    """Set of rows that a part receives."""

    ALL = "all"
    """Every row, at once: for what thins them itself, or must not miss any."""
    SELECTED = "kept"
    """Rows that the recording keeps, whole; with a reduced rate they are known some seconds later."""


@dataclass(frozen=True)
class RecordingSubject:
    """Run to record, and options of the recording."""

    actuator: Actuator
    """Has as many groups as the telemetry has currents."""
    signals: tuple[Signal, ...]
    """Columns of the telemetry at the start; a change of law may bring others."""
    facts: RunFacts
    live: bool = False
    """True if it is a live view."""
    shown: str = OVERVIEW
    """The view of it that is open at first."""
    run: str = ""
    """Identity of this recording."""
    window_s: float = LIVE_WINDOW_S
    """Time before the cursor that the plots of a live view show."""
    rate_Hz: float | None = None
    """Rate of the rows that are kept besides the extremes; None for every row."""

    @cached_property
    def meshes(self) -> Meshes:
        """Meshes of the model, which a run does not need.

        Raises
        ------
        InputError
            A mesh is missing or damaged.
        """
        return read_meshes(self.facts.mjcf)

    @property
    def view(self) -> View:
        """Properties of the run on which the layout depends."""
        return View(
            self.facts.duration_s,
            self.facts.current_limit_A,
            len(self.actuator.groups),
            tuple(signal for signal in self.signals if signal.name not in COMMON_NAMES),
            self.live,
            self.shown,
            size_of(self.actuator),
            self.run,
            window_s=self.window_s,
            decimated=self.live or self.rate_Hz is not None,
        )


class RecordingPart:
    """Part of a recording, which logs nothing; subclasses override the methods.

    Parameters
    ----------
    subject : RecordingSubject
        Run to record.

    Attributes
    ----------
    rows : RowSet
        Set of rows that `write` receives.
    in_live_view : bool
        False if the part is for readers of files only.
    """

    rows: ClassVar[RowSet] = RowSet.ALL
    in_live_view: ClassVar[bool] = True

    def __init__(self, subject: RecordingSubject) -> None:
        self.subject = subject

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log what stays the same."""

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Log the rows of one chunk, of which there is at least one."""

    def note(self, recording: rr.RecordingStream, event: Event) -> None:
        """Log an event that the rows do not show."""

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Log how the run ended."""

    def close(self, recording: rr.RecordingStream) -> None:
        """Log the totals at the end."""


Index = list[rr.TimeColumn]

_SCALARS = next(iter(rr.Scalars.columns(scalars=np.zeros(1)))).component_descriptor()


def time_index(t_s: NDArray[np.float64]) -> Index:
    """Return times in whole nanoseconds: Rerun would truncate seconds to a nanosecond too early."""
    return [rr.TimeColumn(TIMELINE, duration=nanoseconds(t_s).astype("timedelta64[ns]"))]


def nanoseconds(t_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return times as a recording has them."""
    return np.round(t_s * 1e9).astype(np.int64)


def scalars(values: NDArray[np.float64], size: int) -> rr.ComponentColumn:
    """Return the result of `rr.Scalars.columns` for (n, size) values, at half of its cost."""
    batch = rr.components.ScalarBatch(values.ravel())
    return rr.ComponentColumn(_SCALARS, batch, offsets=size * np.arange(len(values) + 1, dtype=np.int32))


# The viewer has Inter for Latin, Greek and Cyrillic, and few symbols.
_NOT_IN_FONT = re.compile("[^\n -~\u00a0-\u0377\u0384-\u03e1\u0400-\u04ff\u2010-\u2027\u2212✔⚠✗▶]")


def drawable(text: str) -> str:
    r"""Return a text with an escape such as ``\u6f22`` for each character that the viewer's font lacks.

    A viewer without a screen ends at such a character; other viewers draw the same mark for all of them.
    """
    return _NOT_IN_FONT.sub(lambda match: ascii(match[0])[1:-1], text)


def log_markdown(recording: rr.RecordingStream, entity: str, text: str) -> None:
    """Log a text in Markdown that replaces an earlier one."""
    document = rr.TextDocument(drawable(text), media_type=rr.MediaType.MARKDOWN)
    recording.log(entity, document, static=True)


def struct_component(fields: Mapping[str, pa.Array]) -> ArrowComponent:
    """Return values with named fields as a component."""
    return ArrowComponent(pa.StructArray.from_arrays(list(fields.values()), list(fields)))


def _integers(values: Sequence[int] | NDArray[np.uint64]) -> ArrowComponent:
    return ArrowComponent(pa.array(values, type=pa.uint64()))


def checksums(values: NDArray[np.uint64]) -> rr.ComponentColumn:
    """Return the component with number and checksum of each line."""
    return rr.ComponentColumn(CHECKSUM, _integers(values))


def range_checksum(first: int, count: int, checksum: int) -> rr.ComponentColumn:
    """Return the component with the checksum of some rows, by the number of the first and their count."""
    return rr.ComponentColumn(CHECKSUM, _integers([first, count, checksum]), lengths=[3])


def total(count: int) -> rr.DescribedComponentBatch:
    """Return the component with the number of rows or lines of a complete recording."""
    return rr.DescribedComponentBatch(_integers([count]), rr.ComponentDescriptor(TOTAL))


def vectors(values: NDArray[np.float64], size: int) -> pa.Array:
    """Arrow form of (n, size) values: `size` numbers a row, whose places need no room."""
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), size)


def no_vectors(rows: int, size: int) -> pa.Array:
    """Return a null array in place of (n, size) values."""
    return pa.nulls(rows, pa.list_(pa.float64(), size))


_STRIPS = {
    2: rr.components.LineStrip2DBatch([]).as_arrow_array().type,
    3: rr.components.LineStrip3DBatch([]).as_arrow_array().type,
}


def strips(segments: NDArray[np.float64]) -> pa.Array:
    """Arrow form of equally long line strips (n, points, 2 or 3); Rerun's own conversion is slow."""
    dimensions = segments.shape[2]
    flat = pa.array(segments.ravel().astype(np.float32))
    points = pa.FixedSizeListArray.from_arrays(flat, type=_STRIPS[dimensions].value_type)
    starts = np.arange(len(segments) + 1, dtype=np.int32) * segments.shape[1]
    return pa.ListArray.from_arrays(pa.array(starts), points, type=_STRIPS[dimensions])
