"""Stages of sensors and drive: base classes, the compiled chain of stages, and the fault line of a stage."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from math import isnan, nan
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from spheretwin.models.base.compiled import inlined
from spheretwin.trajectories.rounding import CONFIG


@inlined
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

    @inlined
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


@inlined
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


class SensorSetup(NamedTuple):
    """Conditions that a stage is built for."""

    sensors: Any
    """Section with the parameters of all stages."""
    seed: int
    name: str
    """Name of the stage, which keys its random streams."""
    first_draw: int
    """Column of its first random number."""
    faults: bool
    """True if a fault may occur."""
    longest_delay_ticks: int
    """Longest additional delay by faults."""


class TickNoise(NamedTuple):
    """Standard normal numbers of a tick."""

    stages: NDArray  # of the stages
    faults: NDArray  # of the faults


class SensorStage(BaseModel):
    """Parameters of one stage; ideal by default.

    A new stage is a subclass and a field of `sensor_chain.SensorsSection`, whose fields are the list of all
    stages, in the order in which angles pass them. `build` returns a named tuple that has a field ``on`` and
    a `FaultLine` for its faults.
    """

    model_config = CONFIG

    @property
    @abstractmethod
    def ideal(self) -> bool:
        """True if the stage does not change the angles."""

    @abstractmethod
    def build(self, setup: SensorSetup) -> Any:
        """Return the named tuple for compiled code; it is on if it is not ideal or a fault may occur."""

    @classmethod
    @abstractmethod
    def function(cls) -> Any:
        """Return the compiled ``f(stage, measurement, noise)``; it changes the angles (rad) in row 0."""

    def draws(self, sensors: Any) -> int:
        """Return the number of standard normal numbers per tick that the stage needs, given all stages."""
        return 0


class DriveSetup(NamedTuple):
    """Conditions that a stage is built for."""

    seed: int
    step_s: float
    """Physics step."""
    groups: int
    faults: bool
    """True if a fault may occur."""


class DriveStage(BaseModel):
    """Parameters of one stage; ideal by default.

    A new stage is a subclass and a base of `drive_section.DriveSection`, whose bases are the list of all
    stages, in the order in which commands pass them. `build` returns a named tuple that has a field ``on``
    and a `FaultLine` ``line`` for its faults. All stages share one section: methods are called on the
    class of a stage, with that section as argument.
    """

    model_config = CONFIG
    stage: ClassVar[str]
    """Name of the stage, which keys its random streams."""

    @staticmethod
    @abstractmethod
    def ideal(section: Any) -> bool:
        """True if the stage does not change a command."""

    @staticmethod
    @abstractmethod
    def build(section: Any, setup: DriveSetup) -> Any:
        """Return the named tuple for compiled code; it is on if it is not ideal or a fault may occur."""

    @staticmethod
    def convert() -> Any:
        """Return the compiled ``f(stage, setpoint, draws)`` for a command (n,), A, once in each control tick.

        The result depends only on the command: it acts before the delay with the effect of a stage after it.
        """
        return pass_nothing

    @staticmethod
    def advance() -> Any:
        """Return the compiled ``f(stage, setpoint, draws)`` for the setpoint at each physics step."""
        return pass_line


@inlined
def pass_line(stage: Any, setpoint: NDArray, draws: NDArray) -> None:
    """Pass the setpoint of each group, A, through the fault line of a stage."""
    for j in range(stage.line.table.shape[0]):
        setpoint[j] = through(stage.line, j, setpoint[j], draws)
