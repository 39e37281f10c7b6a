"""Compiled chain of stages: one function that passes values through all of them, in their order."""

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
        ``f(stage, values, draws)`` each, in the order of `stages`. These are named tuples whose field
        ``on`` says whether a stage does anything; one that is off costs a branch.
    place : int
        Of the first stage that is called.
    """
    if place == len(functions):
        return pass_nothing
    function, others = functions[place], chained(functions, place + 1)

    @part_of_its_caller
    def pass_and_go_on(stages: Any, values: Any, draws: Any) -> None:
        stage = stages[place]
        if stage.on:
            function(stage, values, draws)
        others(stages, values, draws)

    return pass_and_go_on


ACTS, GAIN, OFFSET, NOISE, COLUMN, HOLDS, LAST = range(7)
"""Columns of a line: 1 if a fault acts, gain, offset, rms of the noise, its column among the random numbers,
1 if the last value is held, and that value."""


class FaultLine(NamedTuple):
    """Fault line of the channels of a stage, for compiled code."""

    table: NDArray[np.float64]  # (channels, 7), one array: each that is handed over costs time

    def state_arrays(self) -> tuple[NDArray[np.float64], ...]:
        """Arrays that it goes on from."""
        return (self.table[:, LAST],)

    def fault_arrays(self) -> tuple[NDArray[np.float64], ...]:
        """Arrays that faults write."""
        return (self.table[:, :LAST],)


def fault_line(channels: int, last: float = nan) -> FaultLine:
    """Line of a stage without a fault.

    Parameters
    ----------
    channels : int
        0 if no fault can come.
    last : float
        Value that is held if a fault comes before the first one; NaN to hold the first one.
    """
    table = np.zeros((channels, 7))
    table[:, GAIN], table[:, LAST] = 1.0, last
    return FaultLine(table)


@allocation_free
def through(line: FaultLine, channel: int, value: float, draws: NDArray[np.float64]) -> float:
    """Return the value of a channel behind its fault line, and keep it.

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
