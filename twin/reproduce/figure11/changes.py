"""Single changes, each of which might bring a law to the error that the paper's figure shows.

The values were found by scans of 20 seeds each: of a gain, the one whose median of the largest measured error
of α is the paper's, or where none is, the one with the least; of the rounding (0.16 to 0.3 rad/s²) and of the
estimator (each kind, 100 to 1500 1/s) the one with the least. Neighbours are told where the gain matters.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from spheretwin.twin.reproduce.experiment import Case
from spheretwin.twin.reproduce.figure11.laws import BY_LAW, PROTOTYPE, Compared, case

REACHED = 1.05
"""Times the paper's figure: it is read from a plot, to two digits."""


class Change(NamedTuple):
    """One thing that is other than in the printed experiment."""

    law: str
    what: str
    value: str
    fields: dict[str, Any]
    ideal: bool = False
    """Whether on ideal hardware instead of the prototype."""

    @property
    def compared(self) -> Compared:
        """The law that it is tried with."""
        return BY_LAW[self.law]

    @property
    def label(self) -> str:
        """The change in words."""
        return f"{self.what} {self.value}".strip()

    def case(self) -> Case:
        """The run that tries it."""
        hardware = {} if self.ideal else PROTOTYPE
        return case(self.compared, self.label, {**hardware, **self.fields}, draws=not self.ideal)


def _rounding(law: str, rad_s2: float) -> Change:
    """The corners of the reference, where its rate jumps, rounded; below 0.153 they would run together."""
    return Change(law, "corners rounded at", f"{rad_s2:g} rad/s²", {"trajectory.rounding_rad_s2": rad_s2})


def _governed(law: str) -> Change:
    """The reference bounded to an acceleration, and the torque that this takes fed forward."""
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
    Change("pd", "stiffness", "830 1/s²", {"controller.stiffness": 830.0}),  # 820: 0.555°, 840: 0.546°
    _rounding("pd", 0.3),
    _governed("pd"),
    _estimator("pd", "difference", 100.0),
    _true_rates("pd"),
    _ideal("pd"),
    Change("adaptive_fuzzy", "λ", "130 1/s", {"controller.surface_slope": 130.0}),  # 125: 0.252°, 135: 0.241°
    Change("adaptive_fuzzy", "K", "43 1/s", {"controller.reaching_gain": 43.0}),  # 42: 0.255°, 44: 0.245°
    Change("adaptive_fuzzy", "η", "600", {"controller.fuzzy_rate": 600.0}),  # 300: 0.305°, 1000: 0.227°
    _rounding("adaptive_fuzzy", 0.16),
    _governed("adaptive_fuzzy"),
    _estimator("adaptive_fuzzy", "difference", 100.0),
    _true_rates("adaptive_fuzzy"),
    _ideal("adaptive_fuzzy"),
    Change("afsm", "λ", "240 1/s", {"controller.surface_slope": 240.0}),  # 200: 0.135°, 300: 0.137°
    Change("afsm", "K", "100 1/s", {"controller.reaching_gain": 100.0}),  # 90: 0.125°, 110: 0.118°
    Change("afsm", "η", "3000", {"controller.fuzzy_rate": 3000.0}),  # 1000: 0.202°
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
