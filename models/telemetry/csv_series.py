"""Time series from a CSV file of the user: a column of times and named columns of numbers."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError, distinct_texts, shown, without_breaks
from spheretwin.models.base.files import regular_file

TIME = "t_s"

# Beyond the first a number of seconds cannot distinguish ticks; below the second, quotients would overflow.
LONGEST_s, CLOSEST_s = 1e9, 1e-9

# Times of ticks are products, those of a file decimal fractions: equal times may differ by some units in the
# last place. This is a few thousand of them.
ROUNDING = 1e-12


class CsvRow(NamedTuple):
    """One row of a file."""

    line: int
    """Number of the line, from 1."""
    texts: list[str]


class TimeSeries:
    """Time series of numbers.

    Parameters
    ----------
    t_s : (n,) array, s
        Rising times.
    values : (n, k) array
        Values at these times.
    """

    def __init__(self, t_s: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        self.t_s, self.values = t_s, values

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, TimeSeries):
            return NotImplemented
        return np.array_equal(self.t_s, other.t_s) and np.array_equal(self.values, other.values)

    def __hash__(self) -> int:
        return hash((self.t_s.tobytes(), self.values.tobytes()))

    def zero_order_hold(self, t: NDArray[np.float64], before: Sequence[float]) -> NDArray[np.float64]:
        """Interpolate with zero-order hold: each value applies from its time on.

        Parameters
        ----------
        t : (n,) array, s
            Times.
        before : sequence of k float
            Values before the first time.

        Returns
        -------
        (n, k) array
        """
        return np.vstack([before, self.values])[np.searchsorted(reached(self.t_s), t, side="right")]

    def interpolate(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolate linearly between the times; the first value applies before, the last after them.

        Parameters
        ----------
        t : (n,) array, s
            Times.

        Returns
        -------
        (n, k) array
        """
        return np.stack([np.interp(t, self.t_s, column) for column in self.values.T], axis=1)


def reached(times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the times less a rounding tolerance, so that the tick of a time counts as having reached it.

    Parameters
    ----------
    times : (n,) array, s

    Returns
    -------
    (n,) array, s
    """
    return times - ROUNDING * np.abs(times)


def check_rising(times: Sequence[float]) -> None:
    """Refuse times that do not rise.

    Raises
    ------
    ValueError
        A time is not later than the previous one by at least a nanosecond.
    """
    fault = _first_not_rising(np.array(times))
    if fault is not None:
        before, after = distinct_texts(*times[fault - 1 : fault + 1])
        raise ValueError(f"expected rising times, received {before} then {after} s")


def read(
    what: str, path: Path, columns: Sequence[str] | Callable[[Sequence[str]], Sequence[str]], largest: float
) -> TimeSeries:
    """Read a series: a header, then a row for each time; lines that begin with ``#`` are comments.

    Parameters
    ----------
    what : str
        Name of the file in messages.
    path : Path
        The file. Other columns are ignored.
    columns : sequence of str, or callable
        Columns in addition to the times, ``t_s``; or a function of the columns of the file that returns them.
    largest : float
        Largest magnitude of their numbers.

    Returns
    -------
    Series
        At least one row, with rising times.

    Raises
    ------
    InputError
        The file cannot be read, lacks a column, or has an invalid row.
    """
    header, *rows = _rows(what, path)
    names = [name.strip() for name in header.texts]
    columns = columns(names) if callable(columns) else columns
    names_read = (TIME, *columns)
    if any(names.count(name) != 1 for name in names_read):
        raise InputError(
            f"{what} {path}: expected each of the columns {', '.join(names_read)} once,"
            f" received {', '.join(names) or 'none'}"
        )
    if not rows:
        raise InputError(f"{what} {path}: expected at least one row below the header, received none")
    limits = dict.fromkeys(columns, largest) | {TIME: LONGEST_s}
    table = np.empty((len(rows), len(names_read)))
    for target, row in zip(table, rows, strict=True):
        if len(row.texts) != len(names):
            raise InputError(
                f"{what} {path}: expected {len(names)} numbers in line {row.line}, received {len(row.texts)}"
            )
        for i, name in enumerate(names_read):
            text = row.texts[names.index(name)]
            target[i] = _number(f"{what} {path}: line {row.line}", name, text, limits[name])
    fault = _first_not_rising(table[:, 0])
    if fault is not None:
        before, after = distinct_texts(table[fault - 1, 0], table[fault, 0])
        raise InputError(
            f"{what} {path}: line {rows[fault].line}: expected a {TIME} that rises,"
            f" received {before} then {after}"
        )
    return TimeSeries(table[:, 0].copy(), table[:, 1:].copy())


def _rows(what: str, path: Path) -> list[CsvRow]:
    """Return header and rows of a file; an empty header for an empty file."""
    try:
        text = regular_file(path).read_text(encoding="utf-8-sig")  # spreadsheets write a byte-order mark
    except (OSError, ValueError) as error:  # ValueError: no UTF-8, or a zero in the path
        raise InputError(f"{what} {path}: expected a readable CSV file, {without_breaks(error)}") from None
    try:
        return list(_split(text)) or [CsvRow(1, [])]
    except csv.Error as error:
        raise InputError(f"{what} {path}: expected values between commas, {error}") from None


def _split(text: str) -> Iterator[CsvRow]:
    data_lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and line[0] != "#"]
    reader = csv.reader((line for _, line in data_lines), skipinitialspace=True)
    for texts in reader:
        yield CsvRow(data_lines[reader.line_num - 1][0], texts)


def _number(where: str, name: str, text: str, largest: float) -> float:
    try:
        number = float(text)
    except ValueError:
        number = np.nan
    if not abs(number) <= largest:
        raise InputError(
            f"{where}: expected a number from {-largest:g} to {largest:g} as {name}, received {shown(text)}"
        )
    return number


def _first_not_rising(times: NDArray[np.float64]) -> int | None:
    faults = np.flatnonzero(np.diff(times) < CLOSEST_s)
    return int(faults[0]) + 1 if len(faults) else None
