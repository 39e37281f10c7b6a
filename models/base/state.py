"""State of components: one traversal of the named tuples that hold it, and histories of past values."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free, copy_into
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.record import columns_of, is_rows, transfer_rows

Array = NDArray[np.float64]


def arrays_of(part: Any, method: str = "state_arrays") -> list[NDArray[Any]]:
    """Return the arrays that a method of a part and of its nested parts gives, in a fixed order."""
    if is_rows(part):
        of_faults = method == "fault_arrays"
        return list(columns_of(part, lambda field: field.set_by_faults if of_faults else field.is_state))
    if isinstance(part, np.ndarray):
        return [part]
    return [array for inner in _inner_parts(part, method) for array in arrays_of(inner, method)]


def _inner_parts(part: Any, method: str = "state_arrays") -> list[Any]:
    """Return the parts of a part: those that its method names, otherwise all nested tuples."""
    if hasattr(part, method):
        return list(getattr(part, method)())
    # A part that is off is None: parts of both configurations stay paired.
    return [inner for inner in part if isinstance(inner, tuple | None)] if isinstance(part, tuple) else []


def save_state(part: Any) -> Array:
    """Return a copy of the state of a part, as numbers."""
    return np.concatenate([np.empty(0), *(array.ravel() for array in arrays_of(part))])


def restore_state(part: Any, state: Array, name: str) -> None:
    """Write a saved state into a part of the same size.

    Parameters
    ----------
    part : named tuple, array or tuple of them
    state : array
        From `save_state`.
    name : str
        Name of the part, for the message.

    Raises
    ------
    InputError
        The numbers of values differ; nothing is written.
    """
    arrays = arrays_of(part)
    check_length(name, state, sum(array.size for array in arrays))
    first = 0
    for array in arrays:
        array[...] = state[first : first + array.size].reshape(array.shape)
        first += array.size


def transfer_state(before: Any, after: Any) -> None:
    """Copy the state of a part into a part with another configuration.

    A part of another class, or with a field `on` that is false before or after, has no state to transfer.
    Arrays of different lengths are histories, newest row first: missing rows repeat the oldest one.
    """
    if type(before) is not type(after):
        return
    if is_rows(before):
        transfer_rows(before, after)
    elif isinstance(before, np.ndarray):
        rows = min(len(before), len(after))
        after[:rows] = before[:rows]
        if rows:
            after[rows:] = before[-1]
    elif getattr(before, "on", True) and getattr(after, "on", True):
        for source, target in zip(_inner_parts(before), _inner_parts(after), strict=True):
            transfer_state(source, target)


def check_length(name: str, state: Array, expected: int) -> None:
    """Check the length of a state.

    Raises
    ------
    InputError
        It is not the expected one.
    """
    if np.shape(state) != (expected,):
        raise InputError(
            f"session: expected a snapshot with {expected} numbers of {name}, received {np.size(state)}"
        )


@allocation_free
def push(history: Array, column: int, value: float) -> None:
    """Store the newest value of a column of a history in row 0; the oldest one is dropped."""
    for row in range(history.shape[0] - 1, 0, -1):
        history[row, column] = history[row - 1, column]
    history[0, column] = value


@allocation_free
def push_all(history: Array, values: Array) -> None:
    """Store the newest value of every column of a history in row 0; the oldest ones are dropped."""
    columns = values.shape[0]
    for row in range(history.shape[0] - 1, 0, -1):
        copy_into(history[row], 0, history[row - 1], columns)
    copy_into(history[0], 0, values, columns)


@allocation_free
def delayed_mean(history: Array, due: int, column: int, fraction: float) -> float:
    """Return the mean of a column over a period in which the next row becomes due.

    Parameters
    ----------
    history : (n, m) array
        Newest row first.
    due : int
        Row that is due: periods of the delay.
    column : int
    fraction : float
        Share of the period in which the older row acts.
    """
    return fraction * history[due + 1, column] + (1.0 - fraction) * history[due, column]
