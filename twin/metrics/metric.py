"""What a metric is: a reducer that follows a run chunk by chunk, in memory that does not hold its rows."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

from spheretwin.models.actuator import Actuator
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.scenario.sections import ResolvedScenario


@dataclass(frozen=True)
class Planned:
    """What a metric may know of a run before its first row.

    Attributes
    ----------
    scenario : ResolvedScenario
        In force at the start.
    actuator : Actuator
        What is simulated.
    ticks : int
        Control ticks that the run is to have; it may end before.
    """

    scenario: ResolvedScenario
    actuator: Actuator
    ticks: int

    @property
    def period_s(self) -> float:
        """Control period, s."""
        return self.scenario.controller.period_s


class Metric(ABC):
    """One figure of a run; its bits do not depend on the chunks that the run comes in.

    Parameters
    ----------
    planned : Planned
        The run to come.
    """

    labels: ClassVar[tuple[str, ...]] = ()
    """Names of its entries, where its value is a list."""

    def __init__(self, planned: Planned) -> None:
        self.planned = planned

    @abstractmethod
    def write(self, rows: Table) -> None:
        """Take the rows of one chunk, at least one."""

    @abstractmethod
    def value(self) -> Any:
        """The figure as JSON holds it; None where there are too few rows for one."""

    def warnings(self) -> list[str]:
        """What a user should know before believing any figure of the run; one line each."""
        return []
