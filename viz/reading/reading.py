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
from spheretwin.viz.layout.paths import DESCRIBED, EVENTS, SCENARIO, TELEMETRY, TIMELINE, VALUES
from spheretwin.viz.layout.view import View, application
from spheretwin.viz.reading.messages import whole_messages
from spheretwin.viz.reading.survival import check_readable
from spheretwin.viz.recording.parts.described import FACTS, signals_of
from spheretwin.viz.recording.parts.events import Event

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
        self.arrived: dict[int, list[Signal]] = {}
        self.columns: list[_Column] = []
        self.log: list[tuple[int, str, str]] = []

    def take(self, chunk: Chunk) -> None:
        """Take what a chunk holds of the run; poses and colours are made of it."""
        path = chunk.entity_path.removeprefix("/")
        batch = chunk.to_record_batch() if path in (SCENARIO, TELEMETRY, EVENTS) else None
        if batch is None:
            return
        names = batch.schema.names
        if path == SCENARIO and FACTS in names:
            self.facts = json.loads(_text(batch, FACTS))
        elif path == TELEMETRY:
            for name in names:
                kind, _, arrival = name.rpartition("_")
                if kind == DESCRIBED:
                    self.arrived[int(arrival)] = signals_of(_text(batch, name))
                elif kind == VALUES:
                    self.columns += _columns(_times(batch), batch.column(name).flatten())
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
    with _chunks(path) as (chunks, _), whole_file(target) as temporary:
        recording = rr.RecordingStream(application(view))
        recording.set_log_time_enabled(False)
        recording.set_sinks(rr.FileSink(temporary), default_blueprint=layout(view))
        recording.send_chunks(chunks)
        recording.flush()
        recording.disconnect()
    return recorded


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


def _columns(t_ns: NDArray[np.int64], values: pa.StructArray) -> Iterator[_Column]:
    """Signals of a struct that are in its rows at all."""
    for field, column in zip(values.type, values.flatten(), strict=True):
        if column.null_count < len(column):
            yield _Column(field.name, t_ns, np.asarray(column.flatten()).reshape(len(column), -1))


def _times(batch: pa.RecordBatch) -> NDArray[np.int64]:
    return np.asarray(batch.column(TIMELINE).cast(pa.int64()))


def _exact(t_ns: NDArray[np.float64], period_s: float) -> NDArray[np.float64]:
    """Times of ticks from whole nanoseconds, to the last bit: sessions make them as products."""
    return np.round(t_ns * _NS / period_s) * period_s


def _table(found: _Found) -> Table:
    """All columns by tick; NaN where a run had no such column."""
    signals = tuple(signal for _, arrived in sorted(found.arrived.items()) for signal in arrived)
    ticks = np.unique(np.concatenate([column.t_ns for column in found.columns] or [np.empty(0, np.int64)]))
    values = allocated(len(ticks), width(signals))
    values[:] = np.nan
    first = offsets(signals)
    for column in found.columns:
        rows, place = np.searchsorted(ticks, column.t_ns), first[column.signal]
        values[rows, place : place + column.values.shape[1]] = column.values
    return Table(signals, values)
