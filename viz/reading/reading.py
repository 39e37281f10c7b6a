"""A recording read back: facts, telemetry bit for bit, events; of one that was not closed, what is whole."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import Chunk, RrdReader

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.files import whole_file
from spheretwin.models.base.wording import without_breaks
from spheretwin.models.telemetry.signals import COMMON_NAMES, Signal, offsets, width
from spheretwin.models.telemetry.status import Level
from spheretwin.models.telemetry.table import Table, allocated
from spheretwin.viz.layout.layout import layout
from spheretwin.viz.layout.paths import EVENTS, SCENARIO, TELEMETRY, TIMELINE
from spheretwin.viz.layout.view import View, application
from spheretwin.viz.reading.messages import whole_messages
from spheretwin.viz.reading.survival import check_readable
from spheretwin.viz.recording.parts.described import COMPLETE, FACTS, SIGNAL, signal_of
from spheretwin.viz.recording.parts.events import Event

VALUES = "Scalars:scalars"

# A recording has its times in whole nanoseconds.
_NS = 1e-9


class Recorded(NamedTuple):
    """What a recording says of its run."""

    facts: dict[str, Any]
    """`RunFacts` as JSON has them, and versions."""
    table: Table
    """Telemetry, each column bit for bit."""
    events: list[Event]
    """Its log, in the order of time."""
    whole: bool
    """Whether it was closed; else the process was killed, or its end cut off."""


class _Column(NamedTuple):
    """Rows of one signal that were recorded at once."""

    signal: str
    t_ns: NDArray[np.int64]
    values: NDArray[np.float64]


class _Found:
    """What the chunks of a recording hold."""

    def __init__(self) -> None:
        self.facts: dict[str, Any] | None = None
        self.signals: dict[str, tuple[int, Signal]] = {}
        self.columns: list[_Column] = []
        self.log: list[tuple[int, str, str]] = []

    def take(self, chunk: Chunk) -> None:
        """Take what a chunk holds of the run; poses and colours are made of it."""
        path = chunk.entity_path.removeprefix("/")
        root, _, name = path.partition("/")
        batch = chunk.to_record_batch() if root in (SCENARIO, TELEMETRY, EVENTS) else None
        if batch is None:
            return
        names = batch.schema.names
        if path == SCENARIO and FACTS in names:
            self.facts = json.loads(_text(batch, FACTS))
        elif root == TELEMETRY and SIGNAL in names:
            place, signal = signal_of(_text(batch, SIGNAL))
            self.signals[name] = place, signal
        elif root == TELEMETRY and VALUES in names:
            values = np.asarray(batch.column(VALUES).flatten())
            self.columns.append(_Column(name, _times(batch), values.reshape(len(batch), -1)))
        elif path == EVENTS and TIMELINE in names:
            levels, texts = (batch.column(f"TextLog:{each}").to_pylist() for each in ("level", "text"))
            self.log += [
                (int(t_ns), level[0], text[0])
                for t_ns, level, text in zip(_times(batch), levels, texts, strict=True)
            ]


def read(path: Path) -> Recorded:
    """Read a recording of a run.

    Raises
    ------
    InputError
        It is no recording of a run of this package, or not one tick of it is whole.
    """
    with _chunks(path) as (chunks, whole):
        found = _Found()
        for chunk in chunks:
            found.take(chunk)
    if found.facts is None:
        raise InputError(f"recording {path}: expected one of a run, received one without a run's facts")
    table, period_s = _table(found), float(found.facts["sections"]["controller"]["period_s"])
    if not len(table) and not whole:
        raise InputError(f"recording {path}: expected a whole tick, received one that ends before its first")
    t_s = _exact(np.array([line[0] for line in found.log], dtype=np.float64), period_s)
    events = [(float(t), Level(level), text) for t, (_, level, text) in zip(t_s, found.log, strict=True)]
    return Recorded(found.facts, table, sorted(events, key=lambda event: event[0]), whole)


def rewrite(path: Path, target: Path) -> Recorded:
    """Write what is whole of a recording as one that is closed, with its layout; returns what it says.

    Raises
    ------
    InputError, SpheretwinError
        It cannot be read; the file cannot be written.
    """
    recorded = read(path)
    facts, signals = recorded.facts, recorded.table.signals
    own = tuple(signal for signal in signals if signal.name not in COMMON_NAMES)
    groups = next(signal.size for signal in signals if signal.name == "current_A")
    view = View(facts["duration_s"], facts["current_limit_A"], groups, own, live=False)
    last_ns = round(recorded.table["t_s"][-1] / _NS)
    with _chunks(path) as (chunks, _), whole_file(target) as temporary:
        recording = rr.RecordingStream(application(view))
        recording.set_log_time_enabled(False)
        recording.set_sinks(rr.FileSink(temporary), default_blueprint=layout(view))
        recording.send_chunks(chunk for chunk in chunks if not _is_of_rows_after(chunk, last_ns))
        recording.flush()
        recording.disconnect()
    return recorded


def _is_of_rows_after(chunk: Chunk, t_ns: int) -> bool:
    """Whether a chunk holds a signal at ticks that are not whole."""
    of_rows = chunk.entity_path.startswith(f"/{TELEMETRY}/") and not chunk.is_static
    return of_rows and int(_times(chunk.to_record_batch())[0]) > t_ns


@contextmanager
def _chunks(path: Path) -> Iterator[tuple[Iterable[Chunk], bool]]:
    """Whole chunks of a recording, and whether it was closed."""
    try:
        with whole_messages(path) as (readable, extent), warnings.catch_warnings():
            warnings.simplefilter("ignore", rr.error_utils.RerunWarning)  # that it has no footer is told here
            check_readable(readable, path)
            yield RrdReader(readable).stream(), extent.ended
    except (SpheretwinError, KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # a panic inside Rerun is no `Exception`
        raise InputError(f"recording {path}: expected one of a run, {without_breaks(error)}") from None


def _text(batch: pa.RecordBatch, component: str) -> str:
    return str(batch.column(component).to_pylist()[0][0])


def _times(batch: pa.RecordBatch) -> NDArray[np.int64]:
    return np.asarray(batch.column(TIMELINE).cast(pa.int64()))


def _exact(t_ns: NDArray[np.float64], period_s: float) -> NDArray[np.float64]:
    """Times of ticks from whole nanoseconds, to the last bit: sessions make them as products."""
    return np.round(t_ns * _NS / period_s) * period_s


def _table(found: _Found) -> Table:
    """All columns by tick; NaN where a run had no such column."""
    signals = tuple(signal for _, signal in sorted(found.signals.values(), key=lambda each: each[0]))
    columns = _complete(found)
    ticks = np.unique(np.concatenate([column.t_ns for column in columns] or [np.empty(0, np.int64)]))
    values = allocated(len(ticks), width(signals))
    values[:] = np.nan
    first = offsets(signals)
    for column in columns:
        rows, place = np.searchsorted(ticks, column.t_ns), first[column.signal]
        values[rows, place : place + column.values.shape[1]] = column.values
    return Table(signals, values)


def _complete(found: _Found) -> list[_Column]:
    """Columns of the rows that are whole; of the last ones some may be missing."""
    whole = {column.t_ns[0] for column in found.columns if column.signal == COMPLETE}
    return [column for column in found.columns if column.t_ns[0] in whole]
