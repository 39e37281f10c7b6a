"""Data for readers of a recording: facts of the run, descriptions and values of the signals."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from functools import lru_cache

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.telemetry.checksums import text_checksum, values_checksum
from spheretwin.models.telemetry.run_record import RunFacts, versions
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.plots import LOOKS, signal_style
from spheretwin.viz.layout.view import CHECKSUM, DESCRIBED, SCENARIO, STYLES, TELEMETRY, VALUES, component
from spheretwin.viz.recording.part import (
    RecordingPart,
    RecordingSubject,
    RowSet,
    no_vectors,
    range_checksum,
    struct_component,
    time_index,
    total,
    vectors,
)
from spheretwin.viz.rerun_internals import ArrowComponent

FACTS = "facts"
FACTS_CHECKSUM = f"{FACTS}_{CHECKSUM}"
"""Names of the components below."""

DESCRIBED_CHECKSUM = f"{DESCRIBED}_{CHECKSUM}"

RATE = "record_rate_Hz"
"""Among the facts: rate of the rows that are kept besides the extremes; null for every row."""


def facts_as_json(facts: RunFacts, rate_Hz: float | None) -> rr.AnyValues:
    """Return the facts of a run, the versions that made it, and the rate of the rows."""
    text = json.dumps({**asdict(facts), RATE: rate_Hz, "versions": versions()}, default=str)
    return rr.AnyValues(facts=text, facts_checksum=text_checksum(text))


def signals_as_json(arrival: int, signals: Sequence[Signal]) -> list[rr.DescribedComponentBatch]:
    """Return signals that arrived together, in the order of their columns, and the checksum of their text."""
    text = json.dumps([asdict(signal) for signal in signals])
    texts = {DESCRIBED: text, DESCRIBED_CHECKSUM: text_checksum(text)}
    return [
        rr.DescribedComponentBatch(
            rr.components.TextBatch(content), rr.ComponentDescriptor(component(kind, arrival))
        )
        for kind, content in texts.items()
    ]


def signals_of(text: str) -> list[Signal]:
    """Signals as they were written."""
    return [
        Signal(**{**fields, **{name: tuple(fields[name]) for name in ("labels", "states")}})
        for fields in json.loads(text)
    ]


class ScenarioText(RecordingPart):
    """The resolved scenario."""

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log text and facts."""
        facts = self.subject.facts
        recording.send_recording_name(f"{facts.name}, {facts.law}")
        text = rr.TextDocument(_as_markdown(facts), media_type=rr.MediaType.MARKDOWN)
        recording.log(SCENARIO, text, static=True)
        recording.log(SCENARIO, facts_as_json(facts, self.subject.rate_Hz), static=True)


def _as_markdown(facts: RunFacts) -> str:
    """A table for each section."""
    lines = [f"# {facts.name}", "", facts.description, ""]
    for title, fields in facts.sections.items():
        lines += [f"## {title}", "", "| field | value |", "|---|---|"]
        lines += [f"| {key} | {'' if value is None else value} |" for key, value in fields.items()]
        lines.append("")
    return "\n".join(lines)


# An axis, and no line over itself.
TIME = "t_s"


class Signals(RecordingPart):
    """All columns of the telemetry, those of a row together: a killed process leaves complete rows."""

    rows = RowSet.SELECTED

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._arrived: list[list[Signal]] = []
        self._rows = 0

    def begin(self, recording: rr.RecordingStream) -> None:
        """Say what the signals are."""
        self._describe(recording, self.subject.signals)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the values of a chunk."""
        self._describe(recording, rows.signals)
        names = {signal.name for signal in rows.signals}
        columns = [
            rr.ComponentColumn(component(VALUES, arrival), _values(rows, signals, names))
            for arrival, signals in enumerate(self._arrived)
            if any(signal.name in names for signal in signals)
        ]
        self._check(recording, rows)
        recording.send_columns(TELEMETRY, time_index(rows["t_s"]), columns)

    def close(self, recording: rr.RecordingStream) -> None:
        """Log the number of rows."""
        recording.log(TELEMETRY, [total(self._rows)], static=True)

    def _check(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the checksum of the rows of a chunk, before the rows: no row is ever without one."""
        sums = range_checksum(self._rows, len(rows), values_checksum(self._in_order(rows)))
        recording.send_columns(TELEMETRY, time_index(rows["t_s"][:1]), [sums])
        self._rows += len(rows)

    def _in_order(self, rows: Table) -> NDArray[np.float64]:
        """Return the values of a chunk, signals in order of arrival: a law may bring back earlier ones."""
        names = {signal.name for signal in rows.signals}
        order = [signal for arrived in self._arrived for signal in arrived if signal.name in names]
        if list(rows.signals) == order:
            return rows.values
        return np.concatenate([rows[signal.name].reshape(len(rows), -1) for signal in order], axis=1)

    def _describe(self, recording: rr.RecordingStream, signals: tuple[Signal, ...]) -> None:
        """Describe signals that arrive for the first time, as after a change of law."""
        known = {signal.name for arrived in self._arrived for signal in arrived}
        new = [signal for signal in signals if signal.name not in known]
        if not new:
            return
        arrival = len(self._arrived)
        self._arrived.append(new)
        recording.log(TELEMETRY, _description(arrival, tuple(new)), static=True)
        recording.flush()  # before their rows: partial files describe their signals


@lru_cache(maxsize=16)
def _description(arrival: int, signals: tuple[Signal, ...]) -> list[rr.DescribedComponentBatch]:
    """Return what readers and viewers need to know of signals that arrived together."""
    styles = struct_component({signal.name: _style(signal) for signal in signals if signal.name != TIME})
    style_batch = rr.DescribedComponentBatch(styles, rr.ComponentDescriptor(component(STYLES, arrival)))
    return [*signals_as_json(arrival, signals), style_batch]


def _values(rows: Table, signals: list[Signal], names: set[str]) -> ArrowComponent:
    """Return the values of signals that arrived together; null for those that the rows no longer have."""
    return struct_component(
        {
            signal.name: vectors(rows[signal.name], signal.size)
            if signal.name in names
            else no_vectors(len(rows), signal.size)
            for signal in signals
        }
    )


def _style(signal: Signal) -> pa.Array:
    """Return the style of a signal's lines: properties of `rr.SeriesLines` as lists in a struct."""
    style = signal_style(signal)
    return pa.StructArray.from_arrays([_look(getattr(style, look)) for look in LOOKS], list(LOOKS))


def _look(batch: rr.ComponentBatchLike | None) -> pa.Array:
    """Return one list; null if the viewer may choose."""
    if batch is None:
        return pa.nulls(1, pa.list_(pa.uint8(), 1))
    values = batch.as_arrow_array()
    return pa.FixedSizeListArray.from_arrays(values, len(values))
