"""Records: one declaration of the data of a part, from which array type, documentation and state follow.

The data of a run are arrays of records, one record for each row of a study; a single run has one row. A part
declares its fields as a class::

    class Flow(Record):
        "Currents of the coils."

        mean_current_A: Array = field("mean over the last physics step", "A", "groups")
        copper_J: Array = field("loss in the coils", "J", "groups", state=True)

``Flow.zeros(rows, groups=18)`` is an array of these records. Set-up fills its columns, ``rows["copper_J"]``
with one entry for each row; compiled code takes a record and reads ``flow.copper_J[j]``. The class itself has
no instances: it is the type of a record in annotations.

All numbers have eight bytes, so that every field is aligned, whatever the records that it is nested in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[Any]
"""Array of records."""

Shape = tuple[int | str, ...]


class Field(NamedTuple):
    """Declaration of a field."""

    meaning: str
    unit: str
    shape: Shape
    """Lengths of its dimensions: numbers, or names of sizes."""
    is_state: bool
    """True if the value belongs to the state of a run, and is kept when a parameter changes."""
    set_by_faults: bool
    """True if faults write the value, which is the same again when they end."""
    sizes: dict[str, int | str]
    """Of a nested record: its sizes that have another name here, or a number."""
    family: type | None
    """Of a nested record that is made at run time: its class."""


def field(
    meaning: str,
    unit: str = "",
    shape: int | str | Shape = (),
    *,
    state: bool = False,
    fault: bool = False,
    family: type | None = None,
    **sizes: int | str,
) -> Any:
    """Declare a field of a record.

    The annotation is ``float``, ``int``, ``bool``, an array of numbers, the class of a nested record, or a
    tuple of that class, ``tuple[Adc, ...]``, for an array of nested records.

    Parameters
    ----------
    meaning : str
    unit : str
        Empty for a number without a unit.
    shape : int, str or tuple of them
        Lengths of its dimensions: numbers, or names of sizes that `Record.zeros` receives.
    state : bool
        Whether the value belongs to the state of a run.
    fault : bool
        Whether faults write the value.
    family : type
        Class of a nested record that `record_of` makes; its annotation is any type.
    **sizes
        Of a nested record: its sizes that have another name here, or a number.
    """
    shape = shape if isinstance(shape, tuple) else (shape,)
    return Field(meaning, unit, shape, state, fault, sizes, family)


class Record:
    """Base of the declarations."""

    @classmethod
    def fields(cls) -> dict[str, Field]:
        """Return the declarations of the fields, in their order."""
        return {name: value for name, value in vars(cls).items() if isinstance(value, Field)}

    @classmethod
    def dtype(cls, **sizes: int) -> np.dtype[Any]:
        """Return the type of a record, the same object for the same sizes.

        Raises
        ------
        TypeError
            A size is missing, a field has the name of a method of a record of NumPy, such as `mean`, or
            another declaration has the same fields with other states.
        """
        kind: Any = cls
        return _dtype(kind, tuple(sorted(sizes.items())))

    @classmethod
    def zeros(cls, rows: int = 1, **sizes: int) -> Rows:
        """Return an array of records in which every number is 0."""
        return np.zeros(rows, cls.dtype(**sizes))

    @classmethod
    def filled(cls, fill: Callable[..., None], *arguments: Any, **sizes: int) -> Rows:
        """Return an array of one record that a function fills."""
        rows = cls.zeros(**sizes)
        fill(rows, *arguments)
        return rows


def kinds_of(kind: type[Record]) -> dict[str, type]:
    """Return ``float``, ``int`` or the class of a nested record for each field."""
    fields = kind.fields()
    return {name: fields[name].family or _kind(hint) for name, hint in get_type_hints(kind).items()}


def _kind(hint: Any) -> type:
    one = get_args(hint)[0] if get_origin(hint) is tuple else hint
    if isinstance(one, type) and issubclass(one, Record):
        return one
    number = get_args(get_args(hint)[1])[0] if get_args(hint) else hint  # NDArray[number]
    return int if issubclass(number, int | np.integer | np.bool_) else float


@cache
def _dtype(kind: type[Record], sizes: tuple[tuple[str, int], ...]) -> np.dtype[Any]:
    known, members, kinds = dict(sizes), [], kinds_of(kind)

    def length(name: int | str, of: str) -> int:
        if isinstance(name, str) and name not in known:
            raise TypeError(f"{kind.__name__}: expected the size {name} of {of}, received {known}")
        return known[name] if isinstance(name, str) else name

    for name, declared in kind.fields().items():
        if hasattr(np.record, name):
            raise TypeError(
                f"{kind.__name__}: expected a name that numpy.record does not have, received {name}"
            )
        if issubclass(kinds[name], Record):
            renamed = {inner: length(outer, name) for inner, outer in declared.sizes.items()}
            member = _dtype(kinds[name], tuple(sorted({**known, **renamed}.items())))
        else:
            member = np.dtype(np.int64 if kinds[name] is int else np.float64)
        members.append((name, member, tuple(length(entry, name) for entry in declared.shape)))
    made = np.dtype((np.record, np.dtype(members, align=True)))
    known_kind = _KINDS.setdefault(made, kind)
    if _marks(known_kind) != _marks(kind):
        raise TypeError(
            f"{kind.__name__}: expected the same states as in {known_kind.__name__}, whose fields have"
            " the same names and types, received others"
        )
    return made


_KINDS: dict[np.dtype[Any], type[Record]] = {}


def _marks(kind: type[Record]) -> list[tuple[bool, bool]]:
    """Return which fields are state, and which ones faults write."""
    return [(declared.is_state, declared.set_by_faults) for declared in kind.fields().values()]


def put(rows: Rows, **columns: Any) -> None:
    """Fill columns of rows.

    Parameters
    ----------
    rows : (n,) array of records
    **columns : array_like
        By field: a number, or one for each entry, that all rows share; or an array with n as its first length
        and 1 or the number of entries as the last one, as `models.base.columns` makes them.
    """
    for name, values in columns.items():
        column = rows[name]
        (column[..., None] if column.ndim == rows.ndim else column)[...] = values


def is_rows(value: Any) -> bool:
    """True if a value is an array of records."""
    return isinstance(value, np.ndarray) and value.dtype.names is not None


def columns_of(rows: Rows, is_meant: Callable[[Field], bool]) -> Iterator[NDArray[Any]]:
    """Return the columns of all fields, also of nested records, that a condition holds for."""
    kind = _KINDS[rows.dtype]
    for name, declared in kind.fields().items():
        column = rows[name]
        if is_rows(column):
            yield from columns_of(column, is_meant)
        elif is_meant(declared):
            yield column


def states_of(rows: Rows) -> NDArray[np.float64]:
    """Return a copy of the state of each row, (rows, numbers)."""
    columns = columns_of(rows, lambda declared: declared.is_state)
    return np.concatenate(
        [np.empty((len(rows), 0)), *(column.reshape(len(rows), -1) for column in columns)], axis=1
    )


def set_states(rows: Rows, states: NDArray[np.float64]) -> None:
    """Write the states (rows, numbers) of rows of the same type, from `states_of`."""
    first = 0
    for column in columns_of(rows, lambda declared: declared.is_state):
        numbers = column[0].size
        column[...] = states[:, first : first + numbers].reshape(column.shape)
        first += numbers


def transfer_rows(before: Rows, after: Rows) -> None:
    """Copy the state of each row into a row with another configuration.

    A part with a field `on` that is 0 before or after has no state to transfer. Arrays of different lengths
    are histories, newest entry first: missing entries repeat the oldest one.
    """
    on = np.ones(after.shape, bool)
    if "on" in (after.dtype.names or ()):
        on = (before["on"] != 0) & (after["on"] != 0)
    for name, declared in _KINDS[after.dtype].fields().items():
        if is_rows(after[name]):
            inner_before, inner_after = before[name][on], after[name][on]
            transfer_rows(inner_before, inner_after)
            after[name][on] = inner_after
        elif declared.is_state:
            after[name][on] = _of_length(before[name][on], after[name].shape[on.ndim :][:1])


def _of_length(history: NDArray[Any], length: tuple[int, ...]) -> NDArray[Any]:
    """Return arrays (rows, entries, …) with another number of entries; numbers (rows,) have none."""
    if history.shape[1:2] == length:
        return history
    return history[:, np.minimum(np.arange(*length), history.shape[1] - 1)]


def capacity(entries: int) -> int:
    """Return the length of a history that holds some entries: 32, 64, 128 …, so that types are few."""
    return max(32, 1 << (entries - 1).bit_length())


def record_of(name: str, meaning: str, kinds: dict[str, type[Record]]) -> type[Record]:
    """Return a declaration whose fields are the records of a family, by name."""
    members = {member: field(member) for member in kinds}
    return type(name, (Record,), {"__doc__": meaning, "__annotations__": dict(kinds), **members})
