"""Contents of a recording: facts, telemetry and log, gathered from its chunks and compared with checksums."""

from __future__ import annotations

import json
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from rerun.chunk import Chunk

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.checksums import line_checksums, line_numbers, text_checksum, values_checksum
from spheretwin.models.telemetry.signals import Signal, offsets, width
from spheretwin.models.telemetry.table import Table, allocated
from spheretwin.viz.layout.view import (
    CHECKSUM,
    DESCRIBED,
    EVENTS,
    SCENARIO,
    TELEMETRY,
    TIMELINE,
    TOTAL,
    VALUES,
    component,
)
from spheretwin.viz.recording.part import nanoseconds
from spheretwin.viz.recording.signals import DESCRIBED_CHECKSUM, FACTS, FACTS_CHECKSUM, signals_of

Line = tuple[int, str, str]
"""Time in ns, level, text."""

Checksums = NDArray[np.uint64]


class _Text(NamedTuple):
    """A text, and its checksum if there is one."""

    text: str
    checksum: str | None


class _Rows(NamedTuple):
    """Rows of one chunk: values by signal."""

    t_ns: NDArray[np.int64]
    values: dict[str, NDArray[np.float64]]


class _Range(NamedTuple):
    """Checksum of some rows, by their numbers."""

    first: int
    rows: int
    checksum: int


class _Lines(NamedTuple):
    """Lines of one chunk of the log, and checksums if there are any."""

    lines: list[Line]
    checksums: Checksums | None


class Contents:
    """Run data in the chunks of a recording; poses and colours are not read.

    Parameters
    ----------
    path : Path
        The recording, for messages.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._facts: _Text | None = None
        self._described: dict[int, _Text] = {}
        self._rows: list[_Rows] = []
        self._ranges: list[_Range] = []
        self._lines: list[_Lines] = []
        self._totals: dict[str, int] = {}

    def take(self, chunk: Chunk) -> None:
        """Read the content of a chunk.

        Raises
        ------
        InputError
            It is an entity of the run without what belongs to it.
        """
        entity = chunk.entity_path.removeprefix("/")
        takers = {SCENARIO: self._take_scenario, TELEMETRY: self._take_telemetry, EVENTS: self._take_events}
        if entity not in takers:
            return
        try:
            takers[entity](chunk.to_record_batch())
        except (KeyError, ValueError, TypeError, IndexError, AttributeError, pa.ArrowException):
            raise self._damaged(f"entity {entity}") from None

    @property
    def checked(self) -> bool:
        """True if the recording has checksums."""
        texts = [*([self._facts] if self._facts else []), *self._described.values()]
        return bool(
            self._totals
            or self._ranges
            or any(text.checksum for text in texts)
            or any(lines.checksums is not None for lines in self._lines)
        )

    @property
    def counts(self) -> dict[str, int]:
        """Rows of the telemetry and lines of the log, by entity."""
        return {
            TELEMETRY: sum(len(rows.t_ns) for rows in self._rows),
            EVENTS: sum(len(lines.lines) for lines in self._lines),
        }

    def facts(self) -> dict[str, Any]:
        """Return the facts of the run.

        Raises
        ------
        InputError
            There are none, or they are damaged.
        """
        if self._facts is None and self.checked:
            raise self._damaged(f"entity {SCENARIO}, component {FACTS}")
        if self._facts is None:
            raise InputError(
                f"recording {self._path}: expected one of a run, received one without a run's facts"
            )
        facts = json.loads(self._checked_text(self._facts, SCENARIO, FACTS))
        if not isinstance(facts, dict):
            raise self._damaged(f"entity {SCENARIO}, component {FACTS}")
        return facts

    def signals_at_start(self) -> tuple[Signal, ...]:
        """Return the signals of the first rows; a change of law may have brought others."""
        return tuple(signals_of(self._described[0].text)) if 0 in self._described else ()

    def table(self, *, ended: bool) -> Table:
        """Return all rows by tick, NaN if a run had no such column then.

        Parameters
        ----------
        ended : bool
            Whether the recording was closed: it must state its number of rows.

        Raises
        ------
        InputError
            A row is damaged or missing.
        """
        signals = self._signals()
        if self.checked:
            self._check_ranges(signals, ended=ended)
        ticks = np.unique(np.concatenate([rows.t_ns for rows in self._rows] or [np.empty(0, np.int64)]))
        values = allocated(len(ticks), width(signals))
        values[:] = np.nan
        first = offsets(signals)
        for rows in self._rows:
            places = np.searchsorted(ticks, rows.t_ns)
            for name, columns in rows.values.items():
                values[places, first[name] : first[name] + columns.shape[1]] = columns
        return Table(signals, values)

    def log(self, *, ended: bool) -> list[Line]:
        """Return the lines of the log, in the order in which they were written.

        Parameters
        ----------
        ended : bool
            Whether the recording was closed: it must state its number of lines.

        Raises
        ------
        InputError
            A line is damaged or missing.
        """
        if self.checked:
            self._check_line_numbers(ended=ended)
            for lines, checksums in self._lines:
                assert checksums is not None  # the numbers were checked
                first = int(line_numbers(checksums[:1])[0]) if len(checksums) else 0
                changed = np.flatnonzero(line_checksums(lines, first) != checksums)
                if len(changed):
                    raise self._damaged(f"entity {EVENTS}, line {first + changed[0]}")
        return [line for lines in self._lines for line in lines.lines]

    # --- gathering

    def _take_scenario(self, batch: pa.RecordBatch) -> None:
        if FACTS in batch.schema.names or FACTS_CHECKSUM in batch.schema.names:
            self._facts = _Text(_text(batch, FACTS), _text_or_none(batch, FACTS_CHECKSUM))

    def _take_telemetry(self, batch: pa.RecordBatch) -> None:
        self._take_total(TELEMETRY, batch)
        values: dict[str, NDArray[np.float64]] = {}
        for name in batch.schema.names:
            kind, _, arrival = name.rpartition("_")
            if kind == DESCRIBED:
                checksum = _text_or_none(batch, component(DESCRIBED_CHECKSUM, int(arrival)))
                self._described[int(arrival)] = _Text(_text(batch, name), checksum)
            elif kind == VALUES:
                values |= _columns(batch.column(name).flatten())
        if values:
            self._rows.append(_Rows(_times(batch), values))
        if CHECKSUM in batch.schema.names:
            self._ranges += [_Range(*fields) for fields in batch.column(CHECKSUM).to_pylist() if fields]

    def _take_events(self, batch: pa.RecordBatch) -> None:
        self._take_total(EVENTS, batch)
        if TIMELINE in batch.schema.names:
            levels, texts = (batch.column(f"TextLog:{name}").to_pylist() for name in ("level", "text"))
            lines = [
                (t_ns, level[0], text[0])
                for t_ns, level, text in zip(_times(batch).tolist(), levels, texts, strict=True)
            ]
            self._lines.append(_Lines(lines, _checksums(batch)))

    def _take_total(self, entity: str, batch: pa.RecordBatch) -> None:
        if TOTAL in batch.schema.names:
            self._totals[entity] = int(_only(batch, TOTAL))

    # --- comparing

    def _signals(self) -> tuple[Signal, ...]:
        signals: list[Signal] = []
        for arrival, text in sorted(self._described.items()):
            signals += signals_of(self._checked_text(text, TELEMETRY, component(DESCRIBED, arrival)))
        return tuple(signals)

    def _checked_text(self, text: _Text, entity: str, name: str) -> str:
        if self.checked and text.checksum != text_checksum(text.text):
            raise self._damaged(f"entity {entity}, component {name}")
        return text.text

    def _check_line_numbers(self, *, ended: bool) -> None:
        """Refuse numbers with a gap, lines without numbers, and fewer than a closed recording states."""
        present = [lines.checksums for lines in self._lines if lines.checksums is not None]
        if len(present) < len(self._lines):
            raise self._damaged(f"entity {EVENTS}, component {CHECKSUM}")
        numbers = np.sort(line_numbers(np.concatenate(present or [np.empty(0, np.uint64)])))
        missing = np.flatnonzero(numbers != np.arange(len(numbers)))
        if len(missing):
            raise self._damaged(f"entity {EVENTS}, line {missing[0]}")
        self._check_total(EVENTS, len(numbers), ended=ended)

    def _check_ranges(self, signals: tuple[Signal, ...], *, ended: bool) -> None:
        """Refuse rows that do not match their checksums, and fewer rows than a closed recording states."""
        ranges = sorted(self._ranges)
        ends = list(accumulate(row_range.rows for row_range in ranges))
        if [row_range.first for row_range in ranges] != [0, *ends][: len(ranges)]:
            raise self._damaged(f"entity {TELEMETRY}, component {CHECKSUM}")
        place = number = checksum = 0
        for rows in self._rows:
            values = self._values(rows, signals)
            while len(values):
                if place == len(ranges):
                    raise self._damaged(f"entity {TELEMETRY}, rows from {number} on")
                piece, values = np.split(values, [min(ends[place] - number, len(values))])
                number, checksum = number + len(piece), values_checksum(piece, checksum)
                if number == ends[place]:
                    first, count, expected = ranges[place]
                    if checksum != expected:
                        raise self._damaged(f"entity {TELEMETRY}, rows {first} to {first + count - 1}")
                    place, checksum = place + 1, 0
        # A killed process may leave the checksum of rows that it did not write any more. Rows that a closed
        # recording has lost are missing in its total.
        if number not in (0, *ends):
            raise self._damaged(f"entity {TELEMETRY}, rows {ranges[place].first} to {ends[place] - 1}")
        self._check_total(TELEMETRY, number, ended=ended)

    def _check_total(self, entity: str, count: int, *, ended: bool) -> None:
        if (ended or entity in self._totals) and self._totals.get(entity) != count:
            raise self._damaged(f"entity {entity}, after number {count - 1}")

    def _values(self, rows: _Rows, signals: tuple[Signal, ...]) -> NDArray[np.float64]:
        """Return the values of a chunk, signals in the order of arrival, as for the checksum."""
        present = tuple(signal for signal in signals if signal.name in rows.values)
        values = [rows.values[signal.name] for signal in present]
        known = len(present) == len(rows.values) and "t_s" in rows.values
        if not known or [columns.shape[1] for columns in values] != [signal.size for signal in present]:
            raise self._damaged(f"entity {TELEMETRY}, components {DESCRIBED}")
        with np.errstate(invalid="ignore"):  # a damaged time may be no number
            moved = np.flatnonzero(nanoseconds(rows.values["t_s"][:, 0]) != rows.t_ns)
        if len(moved):
            raise self._damaged(f"entity {TELEMETRY}, times at {rows.t_ns[moved[0]] * 1e-9:.6g} s")
        return np.concatenate(values, axis=1)

    def _damaged(self, place: str) -> InputError:
        return InputError(
            f"recording {self._path}: expected intact data, received other data in {place}:"
            " the file is damaged, or was changed by another program"
        )


def _text(batch: pa.RecordBatch, name: str) -> str:
    return str(_only(batch, name))


def _only(batch: pa.RecordBatch, name: str) -> Any:
    """The one value of a component; Rerun may put rows without it into the same chunk."""
    (value,) = [entry[0] for entry in batch.column(name).to_pylist() if entry]
    return value


def _text_or_none(batch: pa.RecordBatch, name: str) -> str | None:
    return _text(batch, name) if name in batch.schema.names else None


def _checksums(batch: pa.RecordBatch) -> Checksums | None:
    if CHECKSUM not in batch.schema.names:
        return None
    sums = np.asarray(batch.column(CHECKSUM).flatten(), dtype=np.uint64)
    if len(sums) != len(batch):
        raise ValueError
    return sums


def _columns(values: pa.StructArray) -> dict[str, NDArray[np.float64]]:
    """Signals of a struct that are in its rows at all."""
    return {
        field.name: np.asarray(column.flatten()).reshape(len(column), -1)
        for field, column in zip(values.type, values.flatten(), strict=True)
        if column.null_count < len(column)
    }


def _times(batch: pa.RecordBatch) -> NDArray[np.int64]:
    return np.asarray(batch.column(TIMELINE).cast(pa.int64()))
