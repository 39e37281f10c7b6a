"""History of a twin: its identifications in order of time, and the drift of its parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spheretwin.machine.intervals import Z95
from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.viz.pages.markdown import Drawing

DAY_s = 86_400.0
MOST_PANELS = 4
"""Parameters in the figure of a history: those that have changed most."""


class Identification(NamedTuple):
    """Result of an identification."""

    date: datetime
    values: dict[str, tuple[float, float, float]]
    """Value and 95 % interval of each parameter."""


class ParameterDrift(NamedTuple):
    """Drift of a parameter: slope of the line through its values, weighted by their intervals."""

    per_day: float
    half_width: float
    """Of the 95 % interval."""
    unit: str

    @property
    def is_clear(self) -> bool:
        """True if the interval does not contain 0."""
        return abs(self.per_day) > self.half_width

    def text(self) -> str:
        """Return the drift as words."""
        unit = "/day" if self.unit == "1" else f" {self.unit}/day"
        return f"{self.per_day:+.2g} ± {self.half_width:.2g}{unit}"


def history_of(content: Mapping[str, Any], path: Path) -> list[Identification]:
    """Return the identifications of the content of a twin's file, in order of time.

    Raises
    ------
    InputError
        The history is not one.
    """
    try:
        entries = [
            Identification(
                datetime.fromisoformat(one["date"]),
                {name: (float(v), float(low), float(high)) for name, (v, low, high) in one["values"].items()},
            )
            for one in content.get("history", ())
        ]
        return sorted(entries, key=lambda one: one.date)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"twin {path}: expected [[history]] with a date and values of three numbers, received others"
            f" ({without_breaks(error)})"
        ) from None


def drifts(history: Sequence[Identification], units: Mapping[str, str]) -> dict[str, ParameterDrift]:
    """Return the drift of each parameter that was identified at two times or more.

    Parameters
    ----------
    history : sequence of Identification
    units : mapping
        Unit of each parameter by name.
    """
    found = {}
    for name, unit in units.items():
        rows = [(one.date.timestamp(), *one.values[name]) for one in history if name in one.values]
        if len({row[0] for row in rows}) < 2:
            continue
        times, values, low, high = np.array(rows).T
        days, weights = (times - times[0]) / DAY_s, (2 * Z95 / (high - low)) ** 2
        days = days - np.average(days, weights=weights)
        spread = float(weights @ days**2)
        found[name] = ParameterDrift(float(weights @ (days * values)) / spread, Z95 / spread**0.5, unit)
    return found


def history_drawing(history: Sequence[Identification]) -> Drawing:
    """Return the figure of the changes since the first identification, in half widths of the intervals."""
    from spheretwin.viz.figures import twin  # Matplotlib is optional

    changes = {}
    for name in history[-1].values:
        rows = [(one.date.timestamp(), *one.values[name]) for one in history if name in one.values]
        times, values, low, high = np.array(rows).T
        changes[name] = (times - times[0]) / DAY_s, (values - values[0]) / (0.5 * (high - low).mean())
    largest = sorted(changes, key=lambda name: -np.abs(changes[name][1]).max())[:MOST_PANELS]
    title = "History of the twin"
    panels = {name: {"identified": changes[name]} for name in largest}
    figure = twin.residuals(panels, "days", "change, half widths of the interval", title)
    caption = f"{title}: change of the parameters since the first identification over half of the 95 % width."
    return Drawing("history.svg", caption, figure)
