"""Data for readers of a recording: facts of the run, descriptions and values of the signals."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import lru_cache
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.telemetry.checksums import text_checksum, values_checksum
from spheretwin.models.telemetry.run_record import RunFacts, versions
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.styles import as_struct, signal_style
from spheretwin.viz.layout.view import CHECKSUM, DESCRIBED, SCENARIO, STYLES, TELEMETRY, VALUES, component
from spheretwin.viz.recording.part import (
    RecordingPart,
    RecordingSubject,
    RowSet,
    drawable,
    log_markdown,
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
        recording.send_recording_name(drawable(f"{facts.name}, {facts.law}"))
        log_markdown(recording, SCENARIO, _as_markdown(facts))
        recording.log(SCENARIO, facts_as_json(facts, self.subject.rate_Hz), static=True)


def _as_markdown(facts: RunFacts) -> str:
    """Tables of the fields: those that were chosen or changed, then those of each section."""
    lines = [f"# {facts.name}", "", facts.description, ""]
    lines += _table("Chosen, or different from the defaults", facts.changed)
    for title, fields in facts.sections.items():
        lines += _table(title, fields)
    return "\n".join(lines)


def _table(title: str, fields: Mapping[str, Any]) -> list[str]:
    rows = [f"| {name} | {text} |" for name, text in field_texts(fields)]
    return [f"## {title}", "", "| field | value |", "|---|---|", *rows, ""]


def field_texts(fields: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield name and text of each field, also of those in tables and in lists of tables."""
    for name, value in fields.items():
        if isinstance(value, list) and any(isinstance(entry, Mapping) for entry in value):
            value = {str(place): entry for place, entry in enumerate(value)}
        if isinstance(value, Mapping):
            yield from ((f"{name}.{inner}", text) for inner, text in field_texts(value))
        else:
            yield name, _value_text(value)


def _value_text(value: Any) -> str:
    if value is None or value == []:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return ", ".join(map(_value_text, value))
    return f"{value:.12g}" if isinstance(value, float) else str(value)


# An axis, and no line over itself.
TIME = "t_s"


class Signals(RecordingPart):
    """All columns of the telemetry, those of a row together: a killed process leaves complete rows."""

    rows = RowSet.SELECTED
    in_live_view = False

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
    styles = struct_component(
        {signal.name: as_struct(signal_style(signal).lines()) for signal in signals if signal.name != TIME}
    )
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
