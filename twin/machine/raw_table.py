"""Columns of a file as they are; a column becomes numbers or times when a column map names it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from itertools import count
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import types

from spheretwin.machine.clock_texts import seconds_of_texts
from spheretwin.models.base.arrays import Array, Integers
from spheretwin.models.base.errors import InputError, did_you_mean, shown

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}

_OTHER_NAMES = {
    "°": "deg", "degree": "deg", "degrees": "deg", "turns": "turn", "rev": "turn", "amp": "A", "amps": "A",
    "ampere": "A", "a": "A", "ma": "mA", "sec": "s", "second": "s", "seconds": "s", "msec": "ms", "µs": "us",
    "μs": "us", "usec": "us", "milliseconds": "ms",
}  # fmt: skip
"""Units by other names that a file may state."""

_NO_UNIT = ("", "1", "-")

MISSING = ("", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "1.#qnan", "-1.#ind", "1.#ind")
"""Texts, in lower case, that stand for a missing number."""

FARTHEST_s = 1e6
"""Times that begin beyond it are counted from the first: a float64 of seconds since 1970 ends at 0.24 µs."""

_FIRST_DATE_s, _LAST_DATE_s = 1e9, 4.2e9  # 2001 to 2103, in seconds since 1970
_SECONDS_OF_A_DAY = 86_400
MOST_NAMES = 12


@dataclass(frozen=True)
class RawTable:
    """Columns of a file.

    Attributes
    ----------
    name : str
        Of the file, for messages.
    columns : mapping of str to Arrow arrays or NumPy arrays
    units : mapping of str to str
        Units that the file states, by column.
    metadata : mapping of str to str
        Of the file.
    notes : tuple of str
        How the file was read, if not as this package writes it.
    repeated : frozenset of str
        Names of more than one column.
    decimal : str
        Decimal mark of texts.
    line : callable, optional
        Returns the line of a row, for messages.
    """

    name: str
    columns: Mapping[str, Any]
    units: Mapping[str, str] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    repeated: frozenset[str] = frozenset()
    decimal: str = "."
    line: Callable[[int], int] | None = None

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values()))) if self.columns else 0

    def column(self, name: str) -> pa.ChunkedArray | NDArray[Any]:
        """Return a column.

        Raises
        ------
        InputError
            The file has none of this name, or several.
        """
        if name in self.repeated:
            raise InputError(f"log {self.name}: expected each column once, received {name} twice")
        if name not in self.columns:
            raise InputError(
                f"log {self.name}: expected a column {name}, received {name_list(tuple(self.columns))}"
                f"{did_you_mean(name, self.columns)}"
            )
        return self.columns[name]

    def unit(self, name: str, known: Sequence[str], remedy: str) -> str | None:
        """Return the unit that the file states for a column; None for none.

        Raises
        ------
        InputError
            It is not one of the known units; the column map can state another by `remedy`.
        """
        stated = self.units.get(name, "")
        unit = stated if stated in known else _OTHER_NAMES.get(stated.lower(), "")
        if unit in known or stated in _NO_UNIT:
            return unit if unit in known else None
        raise InputError(
            f"log {self.name}: column {name}: expected a unit of {', '.join(known)}, or {remedy} in the"
            f" column map, received {stated}"
        )

    def numbers(self, name: str) -> Array:
        """Return the numbers of a column; NaN for a missing one.

        Raises
        ------
        InputError
            There is no such column, or it has something else than numbers.
        """
        column = self.column(name)
        if isinstance(column, np.ndarray):
            return column.astype(np.float64)
        if _is_text(column.type):
            return self._numbers_of_texts(name, _texts(column))
        is_number = (types.is_integer, types.is_floating, types.is_decimal, types.is_boolean, types.is_null)
        if not any(is_type(column.type) for is_type in is_number):
            raise InputError(
                f"log {self.name}: column {name}: expected numbers, received values of type {column.type}"
            )
        return _as_float(column)

    def _numbers_of_texts(self, name: str, texts: pa.ChunkedArray) -> Array:
        plain = pc.utf8_ltrim(texts, "+")
        if self.decimal == ",":
            plain = pc.replace_substring(plain, ",", ".")
        try:
            return _as_float(plain)
        except pa.ArrowInvalid:
            plain = _of_fortran(plain)
        try:
            return _as_float(plain)
        except pa.ArrowInvalid:
            row, text = next(_not_numbers(plain))
            raise self.cell_error(name, "numbers", row, str(texts[row]) or text) from None

    def cell_error(self, name: str, expected: str, row: int, text: str) -> InputError:
        """Return the error for a cell that is not as expected."""
        line = f", line {self.line(row)} of the file" if self.line else ""
        return InputError(
            f"log {self.name}: column {name}: expected {expected}, received {shown(text)} in row {row}{line}"
        )

    def times(self, name: str, unit: str | None, wrap: float) -> tuple[Array, tuple[str, ...]]:
        """Return the times of a column, s, and notes on how it was read.

        Integers are subtracted from the first one before they become floating point, if that is large.

        Parameters
        ----------
        name : str
        unit : str, optional
            Of its numbers; unless given, that which the file states, or s.
        wrap : float
            Number after which the clock starts again; 0 for none.

        Raises
        ------
        InputError
            There is no such column, or it has something else than times.
        """
        column = self.column(name)
        if isinstance(column, np.ndarray):
            return _seconds(column, self._time_unit(name, unit), wrap)
        if types.is_temporal(column.type) and not types.is_date(column.type):
            is_clock = types.is_time(column.type)
            ticks = _ticks(column)
            day = _SECONDS_OF_A_DAY / TIME_UNITS[column.type.unit] if is_clock else 0.0
            return _seconds(ticks, column.type.unit, wrap or day, is_date=types.is_timestamp(column.type))
        if types.is_decimal(column.type):
            return self._exact(column, self._time_unit(name, unit), wrap)
        if _is_text(column.type):
            return self._times_of_texts(name, _texts(column), unit, wrap)
        if types.is_integer(column.type):
            return _seconds(_ticks(column), self._time_unit(name, unit), wrap)
        if not (types.is_floating(column.type) or types.is_null(column.type)):
            raise InputError(
                f"log {self.name}: column {name}: expected times, received values of type {column.type}"
            )
        return _seconds(self.numbers(name), self._time_unit(name, unit), wrap)

    def _time_unit(self, name: str, given: str | None) -> str | None:
        return given or self.unit(name, tuple(TIME_UNITS), "time.unit")

    def _exact(self, column: Any, unit: str | None, wrap: float) -> tuple[Array, tuple[str, ...]]:
        """Return the times of decimals: the digits beyond those of a float64 count."""
        values = _as_float(column)
        finite = np.flatnonzero(np.isfinite(values))
        if not len(finite) or wrap:
            return _seconds(values, unit, wrap)
        if pa.types.is_decimal(column.type):
            column = column.cast(pa.decimal256(60, column.type.scale))  # room for a difference
        first = column[int(finite[0])]
        _, notes = _seconds(values[finite[:1]], unit, 0.0)
        if not notes:
            return _seconds(values, unit, 0.0)
        factor, _ = _time_unit(unit, float(values[finite[0]]))
        return factor * _as_float(pc.subtract(column, first)), notes

    def _times_of_texts(
        self, name: str, texts: pa.ChunkedArray, unit: str | None, wrap: float
    ) -> tuple[Array, tuple[str, ...]]:
        plain = pc.replace_substring(texts, ",", ".") if self.decimal == "," else texts
        try:
            ticks = _ticks(plain.cast(pa.int64()))
            return _seconds(ticks, self._time_unit(name, unit), wrap)
        except pa.ArrowInvalid:
            pass
        for kind, numbers in ((pa.decimal128(38, 12), plain), (pa.float64(), _of_fortran(plain))):
            try:
                exact = numbers.cast(kind)
                return self._exact(exact, self._time_unit(name, unit), wrap)
            except pa.ArrowInvalid:
                continue
        for kind in (pa.timestamp("ns"), pa.timestamp("ns", "UTC")):
            try:
                return _seconds(_ticks(texts.cast(kind)), "ns", 0.0, is_date=True)
            except pa.ArrowInvalid:
                continue
        values, row, is_clock = seconds_of_texts(texts.to_pylist())
        if row is not None:
            others = [row for row, _ in _not_numbers(plain)]  # if most are numbers, the first other is named
            row = others[0] if len(others) < 0.5 * len(texts) else row
            raise self.cell_error(name, "times", row, str(texts[row]))
        return _seconds(values, "us", 1e6 * _SECONDS_OF_A_DAY if is_clock else 0.0)


def name_list(names: Sequence[str]) -> str:
    """Return names of columns, at most `MOST_NAMES` of them."""
    if not names:
        return "no column"
    rest = len(names) - MOST_NAMES
    return ", ".join(names[:MOST_NAMES]) + (f" and {rest} more" if rest > 0 else "")


def _is_text(kind: pa.DataType) -> bool:
    return types.is_string(kind) or types.is_large_string(kind) or types.is_dictionary(kind)


def _texts(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return texts without blanks around them; null where one stands for a missing number."""
    texts = pc.utf8_trim_whitespace(column.cast(pa.string()))
    is_missing = pc.is_in(pc.utf8_lower(texts), value_set=pa.array(MISSING))
    return pc.if_else(is_missing, None, texts)


def _of_fortran(texts: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return numbers such as 1.0D-3 with the exponent of other languages."""
    return pc.replace_substring_regex(texts, r"^([+-]?[0-9.]+)[dD]([+-]?[0-9]+)$", r"\1e\2")


def _as_float(column: pa.ChunkedArray) -> Array:
    """Return an Arrow array as float64; null becomes NaN."""
    values = pc.cast(column, pa.float64(), safe=_is_text(column.type)).to_numpy(zero_copy_only=False)
    return np.asarray(values, np.float64)


def _not_numbers(texts: pa.ChunkedArray) -> Any:
    """Yield row and text of each text that is not a number."""
    for row, text in enumerate(texts.to_pylist()):
        try:
            pa.scalar(text).cast(pa.float64())
        except pa.ArrowInvalid:
            yield row, text


def _ticks(column: pa.ChunkedArray) -> NDArray[Any]:
    """Return integers, also those of times, as int64 or uint64; a missing one is masked."""
    if types.is_time32(column.type):
        column = column.cast(pa.int32())
    kind = pa.uint64() if types.is_uint64(column.type) else pa.int64()
    integers = column.cast(kind)
    if not integers.null_count:
        return np.asarray(integers.to_numpy())
    valid = integers.is_valid().to_numpy(zero_copy_only=False)
    return np.ma.masked_array(pc.fill_null(integers, 0).to_numpy(), ~valid)


def _seconds(
    ticks: NDArray[Any], unit: str | None, wrap: float, *, is_date: bool = False
) -> tuple[Array, tuple[str, ...]]:
    """Return numbers in a unit as s; from the first one if that is large."""
    missing = np.ma.getmaskarray(ticks)
    values = np.ma.getdata(ticks)
    if values.dtype.kind == "f":
        missing = missing | ~np.isfinite(values)
    places = np.flatnonzero(~missing)
    if not len(places):
        return np.full(len(values), np.nan), ()
    first = values[places[0]].item()
    factor, notes = _time_unit(unit, float(first))
    # Differences of unsigned integers are exact modulo 2**64.
    since = values - values[places[0]] if values.dtype.kind == "f" else _difference(values, first)
    if wrap:
        since = since.copy()
        since[places] = np.unwrap(since[places], period=wrap if since.dtype.kind == "f" else int(wrap))
    first_s = factor * first
    if is_date or abs(first_s) > FARTHEST_s:
        notes = (*notes, f"times from {_date(first_s)}")
    else:
        since = since + first
    return np.where(missing, np.nan, _scaled(since, factor)), notes


def _difference(values: NDArray[Any], first: int) -> Integers:
    return (values.astype(np.uint64) - np.uint64(first % 2**64)).view(np.int64)


def _scaled(values: NDArray[Any], factor: float) -> Array:
    # A quotient by an integer is the nearest number to the decimal fraction.
    return values / round(1 / factor) if factor < 1 else values.astype(np.float64)


def _time_unit(unit: str | None, first: float) -> tuple[float, tuple[str, ...]]:
    """Return the unit of times that begin with a number: a date since 1970 shows it."""
    if unit is not None:
        return TIME_UNITS[unit], ()
    for name, factor in TIME_UNITS.items():
        if name != "s" and _FIRST_DATE_s <= first * factor <= _LAST_DATE_s:
            return factor, (f"times in {name} since 1970",)
    return 1.0, ()


def _date(first_s: float) -> str:
    if _FIRST_DATE_s <= first_s <= _LAST_DATE_s:
        return (datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=first_s)).isoformat(" ", "milliseconds")
    return f"{first_s:.10g} s"


def repeated_names(names: Sequence[str]) -> frozenset[str]:
    """Return the names that occur more than once."""
    return frozenset(name for name in names if names.count(name) > 1)


def column_names(names: Sequence[str]) -> list[str]:
    """Return names of columns without blanks around them; a number for one that is empty."""
    places = count()
    return [name.strip() or f"column_{place}" for name, place in zip(names, places, strict=False)]
