"""Compiled chain of stages, and the fault line of a stage."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free, part_of_its_caller


@part_of_its_caller
def pass_nothing(stages: Any, values: Any, draws: Any) -> None:
    """Leave the values as they are."""


def chained(functions: Sequence[Any], place: int = 0) -> Any:
    """Return the compiled function ``f(stages, values, draws)`` that calls those of all stages.

    Parameters
    ----------
    functions : sequence of compiled functions
        ``f(stage, values, draws)`` each, in the order of `stages`. A stage is a named tuple; its field ``on``
        is false if it has no effect. A stage that is off costs only a branch.
    place : int
        Index of the first stage that is called.
    """
    if place == len(functions):
        return pass_nothing
    function, others = functions[place], chained(functions, place + 1)

    @part_of_its_caller
    def pass_and_continue(stages: Any, values: Any, draws: Any) -> None:
        stage = stages[place]
        if stage.on:
            function(stage, values, draws)
        others(stages, values, draws)

    return pass_and_continue


ACTS, GAIN, OFFSET, NOISE, COLUMN, HOLDS, LAST = range(7)
"""Columns of a fault line: 1 if a fault acts, gain, offset, rms of the noise, column of its random number,
1 if the last value is held, last value."""


class FaultLine(NamedTuple):
    """Fault line of the channels of a stage, for compiled code."""

    table: NDArray[np.float64]  # (channels, 7), one array, as each argument costs time

    def state_arrays(self) -> tuple[NDArray[np.float64], ...]:
        """Return the arrays with the state."""
        return (self.table[:, LAST],)

    def fault_arrays(self) -> tuple[NDArray[np.float64], ...]:
        """Return the arrays that faults write."""
        return (self.table[:, :LAST],)


def fault_line(channels: int, last: float = nan) -> FaultLine:
    """Return the fault line of a stage without a fault.

    Parameters
    ----------
    channels : int
        0 if no fault can occur.
    last : float
        Value that is held if a fault occurs before the first value; NaN to hold the first value.
    """
    table = np.zeros((channels, 7))
    table[:, GAIN], table[:, LAST] = 1.0, last
    return FaultLine(table)


@allocation_free
def through(line: FaultLine, channel: int, value: float, draws: NDArray[np.float64]) -> float:
    """Return the value of a channel after its fault line, and store it.

    Parameters
    ----------
    line : FaultLine
    channel : int
        From 0 to below the number of channels.
    value : float
    draws : array
        Standard normal numbers of this tick.
    """
    table = line.table
    if table[channel, ACTS] != 0.0:
        if table[channel, HOLDS] != 0.0 and not isnan(table[channel, LAST]):
            value = table[channel, LAST]
        else:
            value = table[channel, GAIN] * value + table[channel, OFFSET]
            if table[channel, NOISE] > 0.0:
                value += table[channel, NOISE] * draws[int(table[channel, COLUMN])]
    table[channel, LAST] = value
    return value
