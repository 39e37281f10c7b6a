"""Cases of figure 11: the laws with the gains of the paper, then every single change."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from spheretwin.paper.experiment import Case
from spheretwin.paper.page import NONE


class TiltLaw(NamedTuple):
    """Law of the figure."""

    law: str
    label: str
    gains: str
    """Origin of the gains."""
    paper_deg: float | None
    """Largest error of α that the paper's figure shows; None if it does not have the law."""
    relation: str = ""
    paper_axes: tuple[int, ...] = (0,)
    """Hinges among α, β and γ for which the paper states it."""
    fields: Mapping[str, Any] = {}
    """Fields of its controller in addition to the name."""

    @property
    def paper(self) -> str:
        """The paper's figure, for a table."""
        return f"{self.relation} {self.paper_deg:g}" if self.paper_deg else NONE


# The files of PID and AFSM-ESO say how these were tuned.
TILT_LAWS = (
    TiltLaw("pd", "PD", "printed gains", 0.55, ">", (0, 1)),
    TiltLaw("adaptive_fuzzy", "adaptive fuzzy", "printed gains", 0.25, "≈"),
    TiltLaw("afsm", "AFSM", "printed gains", 0.12, "≈"),
    TiltLaw("pid", "tuned PID", "triple pole at 40 1/s", None, paper_axes=()),
    TiltLaw(
        "afsm_eso",
        "AFSM-ESO",
        "preset prototype",
        None,
        paper_axes=(),
        fields={"controller.preset": "prototype"},
    ),
)
BY_LAW = {law.law: law for law in TILT_LAWS}

SCENARIO = "tilt"
ELECTRONICS: dict[str, Any] = {"hardware": "electronics"}


def printed(law: TiltLaw) -> Case:
    """Case of a law with the gains of the paper, or with the tuned ones."""
    return case(law, law.gains, ELECTRONICS)


def case(law: TiltLaw, condition: str, fields: dict[str, Any], is_random: bool = True) -> Case:
    """Case of a law under a condition that its row names."""
    return Case(
        name=f"{law.law}: {condition}",
        scenario=SCENARIO,
        fields={"controller.law": law.law, **law.fields, **fields},
        details={"condition": condition, **_paper_details(law)},
        is_random=is_random,
    )


def _paper_details(law: TiltLaw) -> dict[str, Any]:
    """Figures of the paper, for the JSON."""
    if law.paper_deg is None:
        return {"paper": None}
    paper = float(np.radians(law.paper_deg))
    by_axis = [paper if axis in law.paper_axes else None for axis in range(3)]
    return {"paper": by_axis, "paper_relation": law.relation}


class Change(NamedTuple):
    """One difference from the printed experiment."""

    law: str
    quantity: str
    value: str
    fields: dict[str, Any]
    ideal: bool = False
    """Whether on ideal hardware instead of the prototype's electronics."""

    @property
    def label(self) -> str:
        """Quantity and value."""
        return f"{self.quantity} {self.value}".strip()

    def case(self) -> Case:
        """Case with the change."""
        hardware = {} if self.ideal else ELECTRONICS
        return case(BY_LAW[self.law], self.label, {**hardware, **self.fields}, is_random=not self.ideal)


def _rounding(law: str, rad_s2: float) -> Change:
    """Change to rounded corners of the reference, where its rate jumps; below 0.153 they would overlap."""
    return Change(law, "corners rounded at", f"{rad_s2:g} rad/s²", {"trajectory.rounding_rad_s2": rad_s2})


def _governed(law: str) -> Change:
    """Change to a limited acceleration of the reference with feed-forward of the inertia."""
    fields = {"controller.governor.acceleration_rad_s2": 20.0, "controller.feed_forward.inertia": 1.0}
    return Change(law, "reference within", "20 rad/s², inertia fed forward", fields)


def _estimator(law: str, kind: str, rad_s: float) -> Change:
    fields = {"estimator.kind": kind, "estimator.bandwidth_rad_s": rad_s}
    return Change(law, f"estimator {kind},", f"{rad_s:g} 1/s", fields)


def _true_rates(law: str) -> Change:
    return Change(law, "true rates", "", {"estimator.kind": "ideal"})


def _ideal(law: str) -> Change:
    return Change(law, "ideal hardware", "", {}, ideal=True)


CHANGES = (
    Change("pd", "stiffness", "830 1/s²", {"controller.stiffness": 830.0}),  # 820: 0.555°, 840: 0.544°
    _rounding("pd", 0.3),
    _governed("pd"),
    _estimator("pd", "difference", 100.0),
    _true_rates("pd"),
    _ideal("pd"),
    Change("adaptive_fuzzy", "λ", "125 1/s", {"controller.surface_slope": 125.0}),  # 130: 0.244°, 135: 0.239°
    Change("adaptive_fuzzy", "K", "43 1/s", {"controller.reaching_gain": 43.0}),  # 42: 0.253°, 44: 0.243°
    Change("adaptive_fuzzy", "η", "600", {"controller.fuzzy_rate": 600.0}),  # 300: 0.298°, 1000: 0.225°
    _rounding("adaptive_fuzzy", 0.16),
    _governed("adaptive_fuzzy"),
    _estimator("adaptive_fuzzy", "difference", 100.0),
    _true_rates("adaptive_fuzzy"),
    _ideal("adaptive_fuzzy"),
    Change("afsm", "λ", "260 1/s", {"controller.surface_slope": 260.0}),  # 200: 0.142°, 300: 0.141°
    Change("afsm", "K", "90 1/s", {"controller.reaching_gain": 90.0}),  # 80: 0.126°, 100: 0.116°
    Change("afsm", "η", "3000", {"controller.fuzzy_rate": 3000.0}),  # 1000: 0.205°
    _rounding("afsm", 0.16),
    _governed("afsm"),
    _estimator("afsm", "kalman", 1500.0),
    _true_rates("afsm"),
    _ideal("afsm"),
    Change(
        "afsm", "ideal hardware, corners at", "0.2 rad/s²", {"trajectory.rounding_rad_s2": 0.2}, ideal=True
    ),
    Change("afsm", "ideal hardware, K", "80 1/s", {"controller.reaching_gain": 80.0}, ideal=True),
    _rounding("pid", 0.2),
    _governed("pid"),
    _estimator("pid", "difference", 300.0),
    _true_rates("pid"),
    _ideal("pid"),
)


def cases() -> list[Case]:
    """Cases of each law as printed, then of every single change."""
    return [*map(printed, TILT_LAWS), *(change.case() for change in CHANGES)]
