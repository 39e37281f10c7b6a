"""A figure, the bound it has to keep, and why the bound is what it is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any


@dataclass(frozen=True)
class Check:
    """A measured figure against its bound.

    Attributes
    ----------
    name : str
        Stable name of the check.
    compares : str
        What is held against what, and how the difference is measured.
    states : int
        States, samples or runs that the figure is taken over.
    value : float or None
        The figure, the worst of all; None where it could not be taken.
    bound : float or None
        The largest value that passes; None for a figure that is only reported.
    why : str
        Why the bound has its value, or why there is none.
    unit : str
        Of value and bound.
    at_least : float or None
        The least value that passes, where that is not minus infinity.
    detail : mapping
        The figures behind the value, by name.
    """

    name: str
    compares: str
    states: int
    value: float | None
    bound: float | None
    why: str
    unit: str = "1"
    at_least: float | None = None
    detail: Mapping[str, float] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether the value keeps its bound; a value that is not a number does not."""
        if self.value is None or self.bound is None:
            return True
        return self.value <= self.bound and (self.at_least is None or self.value >= self.at_least)

    def row(self) -> dict[str, Any]:
        """The check as JSON has it: every number finite, others null."""
        return {
            "name": self.name,
            "compares": self.compares,
            "states": self.states,
            "value": _finite(self.value),
            "bound": self.bound,
            "at_least": self.at_least,
            "unit": self.unit,
            "ok": self.ok,
            "why": self.why,
            "detail": {name: _finite(value) for name, value in self.detail.items()},
        }

    def value_text(self) -> str:
        """The value for a table."""
        return "not taken" if self.value is None else _text(self.value, self.unit)

    def bound_text(self) -> str:
        """The bound for a table."""
        if self.bound is None:
            return "reported"
        if self.at_least is not None:
            return f"{self.at_least:g} to {_text(self.bound, self.unit)}"
        return f"≤ {_text(self.bound, self.unit)}"


def broken(checks: Iterable[Check]) -> list[str]:
    """Names of the checks that do not keep their bound."""
    return [check.name for check in checks if not check.ok]


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and isfinite(value) else None


def _text(value: float, unit: str) -> str:
    number = f"{value:.2e}" if value and abs(value) < 1e-2 else f"{value:.3g}"
    return number if unit == "1" else f"{number} {unit}"
