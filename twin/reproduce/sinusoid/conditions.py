"""What figures 6 and 7 vary, and the case of each law under each value."""

from __future__ import annotations

from typing import NamedTuple

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Case
from spheretwin.twin.reproduce.laws import COMPARED, Compared
from spheretwin.twin.reproduce.printed import printed_rad

SCENARIO = "sinusoid"

ENDS = {"pd": (Status.COMPLETED, Status.LEFT_WORKSPACE)}
"""Of laws that may end otherwise: PD has no integral and sags under load, out of the workspace at last."""


class Condition(NamedTuple):
    """A point of a figure."""

    m: float
    L: float


class Varied(NamedTuple):
    """What one figure varies."""

    figure: str
    symbol: str
    what: str
    conditions: tuple[Condition, ...]

    def value(self, condition: Condition) -> float:
        """Of what is varied."""
        return float(getattr(condition, self.symbol))


FIGURE6 = Varied(
    "figure6", "m", "modelling error m", tuple(Condition(m, 1.0) for m in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5))
)
FIGURE7 = Varied("figure7", "L", "load L", tuple(Condition(0.2, L) for L in (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)))


def cases(varied: Varied) -> list[Case]:
    """Every law under every condition, condition by condition."""
    return [case(compared, condition) for condition in varied.conditions for compared in COMPARED]


def case(compared: Compared, condition: Condition) -> Case:
    """A law under a condition."""
    paper = printed_rad(compared.law, *condition)
    return Case(
        name=f"{compared.law}: m {condition.m:g}, L {condition.L:g}",
        scenario=SCENARIO,
        fields={
            "controller.law": compared.law,
            "plant.modelling_error": condition.m,
            "disturbance.load": condition.L,
        },
        told={"gains": compared.gains, "paper": None if paper is None else list(paper)},
        ends=ENDS.get(compared.law, (Status.COMPLETED,)),
    )
