"""Columns of sections: the parameters of many rows, read as those of one.

Set-up fills the records of all rows of a block at once. A builder reads `section.noise_A` whether `section`
is that of one run, with a number, or the `Columns` of many, with a number for each row.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import FunctionType, MethodType
from typing import Any

import numpy as np
from numpy.typing import NDArray

_NUMBERS = (int, float, np.number, np.bool_)


class MixedRowsError(TypeError):
    """Rows differ in something else than numbers: they cannot be set up together."""


class Columns:
    """Sections of many rows.

    An attribute that is the same in all rows is that of a section. One that differs has an entry for each
    row: numbers are (rows, 1), lists (rows, entries), nested sections are `Columns`. So the last dimension is
    that of a list, as in a section. A method of a section is called with the columns in place of the section.

    Parameters
    ----------
    sections : sequence
        Of one class, one for each row.

    Raises
    ------
    MixedRowsError
        They are of different classes, or an attribute that is read differs in something else than numbers.
    """

    def __init__(self, sections: Sequence[Any]) -> None:
        self._sections, self._kind = sections, type(sections[0])
        if any(type(section) is not self._kind for section in sections):
            raise MixedRowsError(f"expected {self._kind.__name__} in all rows, received another section")

    def __len__(self) -> int:
        return len(self._sections)

    def __iter__(self) -> Iterator[Any]:
        """Return the section of each row."""
        return iter(self._sections)

    def __getattr__(self, name: str) -> Any:
        function = getattr(self._kind, name, None)
        if isinstance(function, FunctionType):
            return MethodType(function, self) if _has_self(self._kind, name) else function
        made = column_of([getattr(section, name) for section in self._sections], name)
        self.__dict__[name] = made  # a later read finds it
        return made


def _has_self(kind: type, name: str) -> bool:
    found = next(vars(base)[name] for base in kind.__mro__ if name in vars(base))
    return not isinstance(found, staticmethod)


def column_of(values: Sequence[Any], name: str = "a value") -> Any:
    """Return the column of the values of a field, one for each row.

    Parameters
    ----------
    values : sequence
    name : str
        Of the field, for messages.

    Raises
    ------
    MixedRowsError
        They differ in something else than numbers.
    """
    first = values[0]
    if all(value is first for value in values):
        return first
    if _is_numeric(first):
        return _numbers(values, name)
    if all(value == first for value in values):
        return first
    if isinstance(first, tuple):
        return tuple(column_of(entries, name) for entries in zip(*values, strict=True))
    if isinstance(first, str) or first is None:
        raise MixedRowsError(f"expected one {name} in all rows, received {first} and others")
    return Columns(values)


def _is_numeric(value: Any) -> bool:
    """True for a number, and for a list or nested list of numbers."""
    if isinstance(value, np.ndarray):
        return True
    if isinstance(value, tuple | list) and value:
        return _is_numeric(value[0])
    return isinstance(value, _NUMBERS)


def _numbers(values: Sequence[Any], name: str) -> NDArray[Any]:
    try:
        try:
            column = np.array(values)
        except ValueError:  # one number of all groups in some rows, one of each group in others
            column = np.stack(np.broadcast_arrays(*values))
    except ValueError as error:
        raise MixedRowsError(f"expected {name} of one length in all rows, received others") from error
    too_large = column.dtype.kind == "f" and all(isinstance(value, int) for value in values)
    if column.dtype == object or too_large:
        raise MixedRowsError(f"expected numbers as {name} in all rows, received others")
    if np.array_equal(column, np.broadcast_to(column[:1], column.shape)) and not _differs(values):
        return values[0]
    return column[:, None] if column.ndim == 1 else column


def _differs(values: Sequence[Any]) -> bool:
    """True if values that are equal as numbers have different bits or types: 0 and -0, 1 and True."""
    return len({(type(value), np.asarray(value).tobytes()) for value in values}) > 1
