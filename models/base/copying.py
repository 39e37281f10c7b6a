"""Copies of arrays: in compiled code, and of the states that parts of a session go on from.

A part is a named tuple. Its method ``state_arrays()`` returns the arrays that it goes on from; without that
method, it goes on from the parts in it. One traversal saves, restores and transfers the states of all parts.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.errors import InputError


@allocation_free
def copy_into(target: NDArray[np.float64], first: int, values: NDArray[np.float64], count: int) -> None:
    """Copy leading values into a vector; a slice would be checked for overlap, at twice the time."""
    for i in range(count):
        target[first + i] = values[i]


@allocation_free
def copy_rows(source: NDArray[np.float64], target: NDArray[np.float64]) -> None:
    """Copy a matrix of three columns."""
    for i in range(source.shape[0]):
        for j in range(3):
            target[i, j] = source[i, j]


def arrays_of(part: Any, method: str = "state_arrays") -> list[NDArray[Any]]:
    """Arrays that a method of a part, and of the parts in it, returns, in a fixed order."""
    if isinstance(part, np.ndarray):
        return [part]
    if hasattr(part, method):
        inner = getattr(part, method)()
    else:
        inner = [each for each in part if isinstance(each, tuple)] if isinstance(part, tuple) else []
    return [array for each in inner for array in arrays_of(each, method)]


def save_state(part: Any) -> NDArray[np.float64]:
    """Return the numbers that a part goes on from: a copy."""
    return np.concatenate([np.empty(0), *(array.ravel() for array in arrays_of(part))])


def restore_state(part: Any, state: NDArray[np.float64], name: str) -> None:
    """Write saved numbers into a part of the same size.

    Parameters
    ----------
    part : named tuple, array or tuple of them
    state : array
        From `save_state`.
    name : str
        The part's, for the message.

    Raises
    ------
    InputError
        There are more or fewer numbers than the part has; nothing is written.
    """
    arrays = arrays_of(part)
    check_length(name, state, sum(array.size for array in arrays))
    first = 0
    for array in arrays:
        array[...] = state[first : first + array.size].reshape(array.shape)
        first += array.size


def transfer_state(before: Any, after: Any) -> None:
    """Copy the state of a part into another of the same kind.

    Arrays of different lengths have their newest row first: rows that are missing repeat the oldest one.
    """
    for source, target in zip(arrays_of(before), arrays_of(after), strict=True):
        rows = min(len(source), len(target))
        target[:rows] = source[:rows]
        if rows:
            target[rows:] = source[-1]


def check_length(name: str, state: NDArray[np.float64], expected: int) -> None:
    """Refuse a state with another number of numbers.

    Raises
    ------
    InputError
        It has more or fewer than expected.
    """
    if np.shape(state) != (expected,):
        raise InputError(
            f"session: expected a snapshot with {expected} numbers of {name}, received {np.size(state)}"
        )
