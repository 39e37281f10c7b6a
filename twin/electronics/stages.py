"""Stages of sensors and drive: base classes, the compiled chain of stages, and the fault line of a stage."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from math import isnan, nan
from typing import Any, ClassVar, NamedTuple

from numpy.typing import NDArray
from pydantic import BaseModel

from spheretwin.electronics.random_streams import Seed
from spheretwin.models.base.arrays import Array, Integers
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.trajectories.rounding import CONFIG


@inlined
def pass_nothing(stages: Any, values: Any, third: Any) -> None:
    """Leave the values as they are."""


def chained(functions: Mapping[str, Any]) -> Any:
    """Return the compiled function ``f(stages, values, third)`` that calls those of all stages.

    Parameters
    ----------
    functions : mapping
        Compiled ``f(stage, values, third)`` of each stage by the name of its field in the record `stages`, in
        the order of the calls. A stage has a field `on`, which is 0 if it has no effect: it then costs only a
        branch.
    """
    acting = {name: function for name, function in functions.items() if function is not pass_nothing}
    if not acting:
        return pass_nothing
    (name, function), *others = acting.items()
    rest = chained(dict(others))

    @inlined
    def pass_and_continue(stages: Any, values: Any, third: Any) -> None:
        stage = stages[name]
        if stage.on:
            function(stage, values, third)
        rest(stages, values, third)

    return pass_and_continue


class FaultLine(Record):
    """Fault line of the channels of a stage."""

    acts: Integers = field("1 if a fault acts", "", "channels", fault=True)
    gain: Array = field("factor on the value", "", "channels", fault=True)
    offset: Array = field("added to the value", "of the stage", "channels", fault=True)
    noise: Array = field("noise added to the value, rms", "of the stage", "channels", fault=True)
    column: Integers = field("random number of the noise, of those of a tick", "", "channels", fault=True)
    holds: Integers = field("1 if the last value is held", "", "channels", fault=True)
    last: Array = field("last value; NaN before the first", "of the stage", "channels", state=True)


def fill_fault_line(rows: Rows, last: float = nan) -> None:
    """Fill the fault line of a stage without a fault.

    Parameters
    ----------
    rows : array of FaultLine
    last : float
        Value that is held if a fault occurs before the first value; NaN to hold the first value.
    """
    put(rows, gain=1.0, last=last)


@inlined
def through(line: FaultLine, channel: int, value: float, draws: Array) -> float:
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
    if line.acts[channel] != 0:
        if line.holds[channel] != 0 and not isnan(line.last[channel]):
            value = line.last[channel]
        else:
            value = line.gain[channel] * value + line.offset[channel]
            if line.noise[channel] > 0.0:
                value += line.noise[channel] * draws[line.column[channel]]
    line.last[channel] = value
    return value


class SensorSetup(NamedTuple):
    """Conditions that a stage is built for."""

    sensors: Any
    """Section with the parameters of all stages."""
    seed: Seed
    name: str
    """Name of the stage, which keys its random streams."""
    first_draw: int
    """Column of its first random number."""
    end_draw: int
    """Column after its last random number."""
    faults: bool
    """True if a fault may occur."""


class TickNoise(NamedTuple):
    """Standard normal numbers of a tick."""

    stages: NDArray  # of the stages
    faults: NDArray  # of the faults


class SensorStage(BaseModel):
    """Parameters of one stage; ideal by default.

    A new stage is a subclass and a field of `sensor_chain.SensorsSection`, whose fields are the list of all
    stages, in the order in which angles pass them.
    """

    model_config = CONFIG
    record: ClassVar[type[Record]]
    """Data of the stage: with a field `on`, and a `FaultLine` for its faults."""

    @property
    @abstractmethod
    def ideal(self) -> bool:
        """True if the stage does not change the angles."""

    @abstractmethod
    def fill(self, rows: Rows, setup: SensorSetup) -> None:
        """Fill the records, in which every number is 0; they are on if not ideal or if a fault may occur.

        `self` and the section and seed of the set-up are those of one run, or columns of many.
        """

    @classmethod
    @abstractmethod
    def function(cls) -> Any:
        """Return the compiled ``f(stage, measurement, noise)``; it changes the angles (rad) in row 0."""

    def draws(self, sensors: Any) -> int:
        """Return the number of standard normal numbers per tick that the stage needs, given all stages."""
        return 0


class DriveSetup(NamedTuple):
    """Conditions that a stage is built for; (rows, 1) arrays if they differ between rows."""

    seed: int
    faults: bool
    """True if a fault may occur."""


class DriveStage(BaseModel):
    """Parameters of one stage; ideal by default.

    A new stage is a subclass and a base of `drive_section.DriveSection`, whose bases are the list of all
    stages, in the order in which commands pass them. All stages share one section: methods are called on the
    class of a stage, with that section as argument.
    """

    model_config = CONFIG
    record: ClassVar[type[Record]]
    """Data of the stage: with a field `on`, and a `FaultLine` `line` for its faults."""
    stage: ClassVar[str]
    """Name of the stage, which keys its random streams."""

    @staticmethod
    @abstractmethod
    def ideal(section: Any) -> bool:
        """True if the stage does not change a command."""

    @staticmethod
    @abstractmethod
    def fill(rows: Rows, section: Any, setup: DriveSetup) -> None:
        """Fill the records, in which every number is 0; they are on if not ideal or if a fault may occur.

        The section is that of all rows, or the `Columns` of their sections.
        """

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
def pass_line(stage: Any, setpoint: Array, draws: Array) -> None:
    """Pass the setpoint of each group, A, through the fault line of a stage."""
    for j in range(setpoint.shape[0]):
        setpoint[j] = through(stage.line, j, setpoint[j], draws)
