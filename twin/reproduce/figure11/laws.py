"""The laws that figure 11 compares, and what the paper prints of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from spheretwin.twin.reproduce.experiment import Case


class Compared(NamedTuple):
    """A law of the figure."""

    law: str
    label: str
    gains: str
    """Whose its gains are."""
    paper_deg: float | None
    """Largest error of α that the paper's figure shows; None where it does not have the law."""
    relation: str = ""
    paper_axes: tuple[int, ...] = (0,)
    """For which of α, β and γ the paper tells it."""
    fields: Mapping[str, Any] = {}
    """Of its controller, beside its name."""

    @property
    def paper(self) -> str:
        """The paper's figure, for a table."""
        return f"{self.relation} {self.paper_deg:g}" if self.paper_deg else "–"


# The tuned PID is the law's default; its file says how it was tuned, and that of AFSM-ESO how it was.
COMPARED = (
    Compared("pd", "PD", "printed gains", 0.55, ">", (0, 1)),
    Compared("adaptive_fuzzy", "adaptive fuzzy", "printed gains", 0.25, "≈"),
    Compared("afsm", "AFSM", "printed gains", 0.12, "≈"),
    Compared("pid", "tuned PID", "triple pole at 40 1/s", None, paper_axes=()),
    Compared(
        "afsm_eso",
        "AFSM-ESO",
        "preset prototype",
        None,
        paper_axes=(),
        fields={"controller.preset": "prototype"},
    ),
)
BY_LAW = {compared.law: compared for compared in COMPARED}

SCENARIO = "tilt"
PROTOTYPE: dict[str, Any] = {"hardware": "prototype"}


ALPHA, BETA = 0, 1


def printed(compared: Compared) -> Case:
    """The law with the gains of the paper, or with those it was tuned to."""
    return case(compared, compared.gains, PROTOTYPE)


def case(compared: Compared, condition: str, fields: dict[str, Any], draws: bool = True) -> Case:
    """Case of a law under a condition that its row names."""
    return Case(
        name=f"{compared.law}: {condition}",
        scenario=SCENARIO,
        fields={"controller.law": compared.law, **compared.fields, **fields},
        told={"condition": condition, **_told(compared)},
        draws=draws,
    )


def _told(compared: Compared) -> dict[str, Any]:
    """What the paper prints, for the JSON."""
    if compared.paper_deg is None:
        return {"paper": None}
    paper = float(np.radians(compared.paper_deg))
    by_axis = [paper if axis in compared.paper_axes else None for axis in range(3)]
    return {"paper": by_axis, "paper_relation": compared.relation}
