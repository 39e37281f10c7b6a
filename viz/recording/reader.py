"""Reader of recordings: facts, telemetry bit for bit, events; of an unclosed one all complete data.

One that was not closed gets an end: headline, ranges and titles, markers, and a mark.
"""

from __future__ import annotations

import warnings
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import Chunk, RrdReader

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import LONGEST_WORD, InputError, SpheretwinError, shortened, without_breaks
from spheretwin.models.telemetry.run_record import RunFacts
from spheretwin.models.telemetry.signals import COMMON_NAMES, Signal
from spheretwin.models.telemetry.status import Event, Level
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.decimation import TimeBins
from spheretwin.viz.layout.extents import ExtentTracker
from spheretwin.viz.layout.layout import layout
from spheretwin.viz.layout.view import (
    DERIVED,
    ENVELOPE,
    SUMMARY,
    TIMELINE,
    VALUES,
    View,
    application,
    component,
)
from spheretwin.viz.quantities import angle_between
from spheretwin.viz.recording.contents import Contents
from spheretwin.viz.recording.currents import CoilColours, CurrentMap
from spheretwin.viz.recording.part import log_markdown, total
from spheretwin.viz.recording.plots import ENVELOPE_RATE_Hz, Marks, PlottedColumns, log_times
from spheretwin.viz.recording.recorder import recorded
from spheretwin.viz.recording.signals import RATE
from spheretwin.viz.recording.summary import Summary
from spheretwin.viz.rerun_internals import check_readable, whole_messages

# Recordings have times in whole nanoseconds.
_NS = 1e-9


class Recorded(NamedTuple):
    """Run data of a recording."""

    facts: dict[str, Any]
    """`RunFacts` as JSON has them, and versions."""
    table: Table
    """Telemetry, each column bit for bit."""
    events: list[Event]
    """Its log, in the order of time."""
    whole: bool
    """True if it was closed; otherwise the process was killed, or the end is missing."""
    checked: bool
    """True if it has checksums; they were compared."""


def read(path: Path) -> Recorded:
    """Read a recording of a run.

    Raises
    ------
    InputError
        It is no recording of a run of this package, is damaged, or has no complete tick.
    """
    return _read(path)[0]


def _read(path: Path) -> tuple[Recorded, Contents]:
    contents = Contents(path)
    with _chunks(path) as (chunks, whole):
        for chunk in chunks:
            contents.take(chunk)
        facts, table = contents.facts(), contents.table(ended=whole)
        log = contents.log(ended=whole)
    period_s = float(facts["sections"]["controller"]["period_s"])
    if not len(table) and not whole:
        raise InputError(f"recording {path}: expected at least one complete tick, received none")
    t_s = _exact(np.array([line[0] for line in log], dtype=np.float64), period_s)
    events = [(float(t), Level(level), text) for t, (_, level, text) in zip(t_s, log, strict=True)]
    events.sort(key=lambda event: event[0])
    return Recorded(facts, table, events, whole, contents.checked), contents


def rewrite(path: Path, target: Path) -> Recorded:
    """Write the complete data of a recording as a closed one, with its layout; return its run data.

    Raises
    ------
    InputError, SpheretwinError
        It cannot be read; the file cannot be written.
    """
    content, contents = _read(path)
    facts, signals = content.facts, contents.signals_at_start()
    own = tuple(signal for signal in signals if signal.name not in COMMON_NAMES)
    groups = next(signal.size for signal in signals if signal.name == "current_A")
    decimated = facts.get(RATE) is not None
    view = View(facts["duration_s"], facts["current_limit_A"], groups, own, live=False, decimated=decimated)
    with _chunks(path) as (chunks, _), recorded(target, application(view)) as recording:
        plots = RecoveredPlots()
        recording.send_chunks(plots.gather(chunks))
        plots.complete(recording, view, facts, content.table, signals)
        if content.checked:  # a closed recording states its numbers of rows and lines
            for entity, count in contents.counts.items():
                recording.log(entity, [total(count)], static=True)
    return content


@contextmanager
def _chunks(path: Path) -> Iterator[tuple[Iterable[Chunk], bool]]:
    """Whole chunks of a recording, and whether it was closed."""
    done = 0

    def counted(chunks: Iterable[Chunk]) -> Iterator[Chunk]:
        nonlocal done
        for chunk in chunks:
            yield chunk
            done += 1

    try:
        with whole_messages(path) as (readable, extent), warnings.catch_warnings():
            warnings.simplefilter("ignore", rr.error_utils.RerunWarning)  # a missing footer is reported here
            check_readable(readable, path)
            yield counted(RrdReader(readable).stream()), extent.ended
    except (SpheretwinError, KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # a panic inside Rerun is no `Exception`
        reason = shortened(without_breaks(error), LONGEST_WORD)
        place = f"chunk {done}" if done else "its footer or first chunk"
        raise InputError(
            f"recording {path}: expected one of a run, received one that cannot be read in {place}: {reason}"
        ) from None


def _exact(t_ns: NDArray[np.float64], period_s: float) -> NDArray[np.float64]:
    """Return times of ticks from whole nanoseconds, exact to the last bit: sessions make them as products."""
    return np.round(t_ns * _NS / period_s) * period_s


_VALUES = component(VALUES, 0)


class RecoveredPlots:
    """Plotted data of a recording, from which its missing end is made."""

    def __init__(self) -> None:
        self._t_ns: list[NDArray[np.int64]] = []
        self._values: dict[str, list[Array]] = defaultdict(list)

    def gather(self, chunks: Iterable[Chunk]) -> Iterator[Chunk]:
        """Yield chunks, and keep the derived quantities or envelopes among them."""
        for chunk in chunks:
            if chunk.entity_path in (f"/{DERIVED}", f"/{ENVELOPE}"):
                self._take(chunk.to_record_batch())
            yield chunk

    def _take(self, batch: pa.RecordBatch) -> None:
        if _VALUES not in batch.schema.names:  # styles
            return
        structs = batch.column(_VALUES).flatten()
        for field, column in zip(structs.type, structs.flatten(), strict=True):
            values = np.asarray(column.flatten(), dtype=np.float64).reshape(len(column), -1)
            self._values[field.name].append(values)
        self._t_ns.append(np.asarray(batch.column(TIMELINE).cast(pa.int64())))

    def complete(
        self,
        recording: rr.RecordingStream,
        view: View,
        facts: Mapping[str, Any],
        table: Table,
        signals_at_start: tuple[Signal, ...],
    ) -> None:
        """Log what is missing after the last complete row.

        Parameters
        ----------
        recording : RecordingStream
            Recording with the chunks that were gathered.
        view : View
            Properties of the run.
        facts : mapping
            Facts of the run as JSON has them.
        table : Table
            Rows of the recording.
        signals_at_start : tuple of Signal
            Signals of its first rows: a change of law brings others, which no plot shows.
        """
        columns = PlottedColumns(signals_at_start)
        sizes = columns.sizes
        tracker, marks = ExtentTracker(sizes), Marks(view, columns)
        if self._t_ns:
            if view.decimated:
                t_s = np.concatenate(self._t_ns).astype(np.float64) * 1e-9
                parts = [np.split(np.concatenate(self._values[name]), 3, axis=1) for name in sizes]
                low, mean, high = (np.concatenate(blocks, axis=1) for blocks in zip(*parts, strict=True))
                tracker.add(t_s, low, high)
                marks.add(recording, t_s, mean)
            else:
                t_s, rows = self._rows(sizes, table)
                bins = TimeBins(ENVELOPE_RATE_Hz)
                for binned in (bins.add(t_s, rows), bins.flush()):
                    if binned:
                        tracker.add(binned.t_s, binned.low, binned.high)
                marks.add(recording, t_s, rows)
            marks.send(recording)
        error_deg = np.degrees(angle_between(table["q_rad"], table["q_ref_rad"]))
        summary = Summary(_run_facts(facts))
        summary.add(table, error_deg)
        log_markdown(recording, SUMMARY, summary.cut_off())
        has_faults = log_times(recording, summary, summary.last_s)
        current_map = CurrentMap(view.groups, view.current_limit_A)
        colours = CoilColours(view.current_limit_A)
        if len(table):
            current_map.add(recording, table)
            colours.add(recording, table)
        colours.finish(recording)
        currents = current_map.finish(recording)
        recording.send_blueprint(
            layout(view, tracker.extents(summary.last_s, currents, has_faults=has_faults))
        )

    def _rows(self, sizes: Mapping[str, int], table: Table) -> tuple[Array, Array]:
        """Return times and columns of the rows that have derived quantities."""
        t_ns = np.concatenate(self._t_ns)
        rows = np.searchsorted(np.round(table["t_s"] * 1e9).astype(np.int64), t_ns)
        columns = [
            np.concatenate(self._values[name])
            if name in self._values
            else table[name].reshape(len(table), -1)[rows]
            for name in sizes
        ]
        return table["t_s"][rows], np.concatenate(columns, axis=1)


def _run_facts(facts: Mapping[str, Any]) -> RunFacts:
    fields = {name: value for name, value in facts.items() if name in RunFacts.__dataclass_fields__}
    return RunFacts(**{**fields, "mjcf": Path(facts["mjcf"])})
