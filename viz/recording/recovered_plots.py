"""End of a recording that was not closed: headline, ranges and titles, markers, and a mark."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import Chunk

from spheretwin.models.telemetry.run_record import RunFacts
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.decimation import TimeBins
from spheretwin.viz.layout.extents import ExtentTracker, plotted_signals
from spheretwin.viz.layout.layout import layout
from spheretwin.viz.layout.styles import quantity_style, signal_style
from spheretwin.viz.layout.view import DERIVED, ENVELOPE, TIMELINE, VALUES, View, component
from spheretwin.viz.quantities import angle_between, quantities_of
from spheretwin.viz.recording.plots import ENVELOPE_RATE_Hz, Marks, log_end, log_summary
from spheretwin.viz.recording.summary import Summary

Array = NDArray[np.float64]

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
        names = {signal.name for signal in signals_at_start}
        quantities, signals = quantities_of(names), plotted_signals(signals_at_start)
        styles = {quantity.name: quantity_style(quantity) for quantity in quantities}
        styles |= {signal.name: signal_style(signal) for signal in signals_at_start if signal.name in signals}
        sizes = {**{quantity.name: quantity.size for quantity in quantities}, **signals}
        ends = np.cumsum(list(sizes.values())).tolist()
        places = {name: slice(end - sizes[name], end) for name, end in zip(sizes, ends, strict=True)}
        tracker, marks = ExtentTracker(sizes), Marks(view, styles, places)
        if self._t_ns:
            if view.decimated:
                t_s = np.concatenate(self._t_ns).astype(np.float64) * 1e-9
                parts = [np.split(np.concatenate(self._values[name]), 3, axis=1) for name in sizes]
                low, mean, high = (np.concatenate(blocks, axis=1) for blocks in zip(*parts, strict=True))
                tracker.add(t_s, low, high)
                marks.add(recording, t_s, mean)
            else:
                t_s, columns = self._rows(sizes, table)
                bins = TimeBins(ENVELOPE_RATE_Hz)
                for binned in (bins.add(t_s, columns), bins.flush()):
                    if binned:
                        tracker.add(binned.t_s, binned.low, binned.high)
                marks.add(recording, t_s, columns)
            marks.send(recording)
        error_deg = np.degrees(angle_between(table["q_rad"], table["q_ref_rad"]))
        summary = Summary(_run_facts(facts))
        summary.add(table, error_deg)
        log_summary(recording, summary.cut_off())
        log_end(recording, summary.last_s)
        recording.send_blueprint(layout(view, tracker.extents(summary.last_s)))

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
