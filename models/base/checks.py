"""Checks: a figure, its bound and the reason for the bound."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import Any, NamedTuple


@dataclass(frozen=True)
class Check:
    """Measured figure and its bound.

    Attributes
    ----------
    name : str
        Stable name of the check.
    compares : str
        Compared quantities, and the measure of their difference.
    states : int
        Number of states, samples or runs of the figure.
    value : float or None
        Worst value of the figure; None if it could not be computed.
    bound : float or None
        The largest value that passes; None for a figure that is only reported.
    why : str
        Reason for the bound, or for its absence.
    unit : str
        Of value and bound.
    at_least : float or None
        The least value that passes, if there is one.
    detail : mapping
        The figures behind the value, by name.
    reason : str
        Reason for a value that is not finite, such as "left the workspace".
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
    reason: str = ""

    @property
    def ok(self) -> bool:
        """True if the value is within its bound; False for NaN."""
        if self.value is None or self.bound is None:
            return True
        return self.value <= self.bound and (self.at_least is None or self.value >= self.at_least)

    def row(self) -> dict[str, Any]:
        """Return the check for JSON: numbers that are not finite are null."""
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
        } | ({"reason": self.reason} if self.reason else {})

    def value_text(self) -> str:
        """Return the value for a table."""
        if self.value is None:
            return "not taken"
        if self.reason and not isfinite(self.value):
            return self.reason
        return _text(self.value, self.unit, self._digits)

    def bound_text(self) -> str:
        """Return the bound for a table."""
        if self.bound is None:
            return "reported"
        if self.at_least is not None:
            return (
                f"{_text(self.at_least, '1', self._digits)} to {_text(self.bound, self.unit, self._digits)}"
            )
        return f"≤ {_text(self.bound, self.unit, self._digits)}"

    @property
    def _digits(self) -> int:
        """Digits of value and bounds: rounded alike, a value within two bounds is printed within them."""
        return 3 if self.at_least is None else 6


class Checks(NamedTuple):
    """Checks of a part without data for figures."""

    checks: list[Check]


def broken(checks: Iterable[Check]) -> list[str]:
    """Return the names of the checks that exceed their bound."""
    return [check.name for check in checks if not check.ok]


def bound_shares(checks: Iterable[Check]) -> dict[str, float]:
    """Return value over bound of each check with a value and one bound; infinity without a finite value."""
    return {
        check.name: check.value / check.bound if isfinite(check.value) else inf
        for check in checks
        if check.value is not None and check.bound is not None and check.at_least is None
    }


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and isfinite(value) else None


def _text(value: float, unit: str, digits: int) -> str:
    number = f"{value:.2e}" if value and abs(value) < 1e-2 else f"{value:.{digits}g}"
    return number if unit == "1" else f"{number} {unit}"
