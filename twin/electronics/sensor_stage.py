"""Stage of the sensors, between the joints and the controller."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, NamedTuple

from numpy.typing import NDArray
from pydantic import BaseModel

from spheretwin.trajectories.rounding import CONFIG


class SensorSetup(NamedTuple):
    """Circumstances that a stage is built for."""

    sensors: Any
    """Section with the parameters of all stages."""
    seed: int
    name: str
    """Of the stage, which its random streams are keyed by."""
    first_draw: int
    """Column of its first random number."""
    faults: bool
    """True if a fault may come."""
    most_late_ticks: int
    """Longest delay that faults may bring."""


class Numbers(NamedTuple):
    """Standard normal numbers of a tick."""

    noise: NDArray  # of the stages
    faults: NDArray  # of the faults


class SensorStage(BaseModel):
    """Parameters of one stage; ideal unless told otherwise.

    A new stage is a subclass and a field of `sections.SensorsSection`, whose fields are the list of all
    stages, in the order in which angles pass them. What is built is a named tuple that has a field ``on``,
    and a `fault_line.FaultLine` for its faults.
    """

    model_config = CONFIG

    @property
    @abstractmethod
    def ideal(self) -> bool:
        """True if the angles come out as they go in."""

    @abstractmethod
    def build(self, setup: SensorSetup) -> Any:
        """Return the stage for compiled code: a named tuple, on if it is not ideal or if a fault may come."""

    @classmethod
    @abstractmethod
    def function(cls) -> Any:
        """Return the compiled ``f(stage, measurement, numbers)``; it changes angles (rad) in row 0."""

    def draws(self, sensors: Any) -> int:
        """Return how many standard normal numbers a tick it needs, among the stages of a section."""
        return 0
