"""Stage of the drive: what stands between a command and what an amplifier is asked for."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar, NamedTuple

from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from spheretwin.electronics.stages import pass_nothing, through
from spheretwin.models.base.compiled import part_of_its_caller


class DriveSetup(NamedTuple):
    """Circumstances that a stage is built for."""

    seed: int
    step_s: float
    """Physics step."""
    groups: int
    faults: bool
    """True if a fault may come."""


class DriveStage(BaseModel):
    """Parameters of one stage; ideal unless told otherwise.

    A new stage is a subclass and a base of `sections.DriveSection`, whose bases are the list of all stages,
    in the order in which commands pass them. What is built is a named tuple that has a field ``on``, and a
    `fault_line.FaultLine` ``line`` for its faults. All stages share one section: methods are called on the
    class of a stage, and take that section.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
    stage: ClassVar[str]
    """Name, which its random streams are keyed by."""

    @staticmethod
    @abstractmethod
    def ideal(section: Any) -> bool:
        """True if a command comes out as it goes in."""

    @staticmethod
    @abstractmethod
    def build(section: Any, setup: DriveSetup) -> Any:
        """Return the stage for compiled code: a named tuple, on if it is not ideal or if a fault may come."""

    @staticmethod
    def convert() -> Any:
        """Return the compiled ``f(stage, asked, draws)`` that changes a command (n,), A, once a control tick.

        It depends on nothing but the command: it acts before the delay, as if it were behind it.
        """
        return pass_nothing

    @staticmethod
    def advance() -> Any:
        """Return the compiled ``f(stage, asked, draws)`` that changes what is asked at each physics step."""
        return pass_line


@part_of_its_caller
def pass_line(stage: Any, setpoint: NDArray, draws: NDArray) -> None:
    """Pass what is asked of each group, A, through the fault line of a stage."""
    for j in range(stage.line.table.shape[0]):
        setpoint[j] = through(stage.line, j, setpoint[j], draws)
