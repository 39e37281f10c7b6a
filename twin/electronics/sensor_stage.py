"""Stage of the sensors, between the joints and the controller."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, NamedTuple

from numpy.typing import NDArray
from pydantic import BaseModel

from spheretwin.trajectories.rounding import CONFIG


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
    a `stages.FaultLine` for its faults.
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
