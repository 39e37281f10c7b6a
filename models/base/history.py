"""Histories of past values: arrays with the newest value in row 0."""

from __future__ import annotations

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, copy_into


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
