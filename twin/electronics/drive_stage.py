"""Stage of the drive, between a command and the setpoint of an amplifier."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar, NamedTuple

from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from spheretwin.electronics.stages import pass_nothing, through
from spheretwin.models.base.compiled import part_of_its_caller


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
    and a `stages.FaultLine` ``line`` for its faults. All stages share one section: methods are called on the
    class of a stage, with that section as argument.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
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


@part_of_its_caller
def pass_line(stage: Any, setpoint: NDArray, draws: NDArray) -> None:
    """Pass the setpoint of each group, A, through the fault line of a stage."""
    for j in range(stage.line.table.shape[0]):
        setpoint[j] = through(stage.line, j, setpoint[j], draws)
