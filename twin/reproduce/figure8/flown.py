"""What figure 8 keeps of a run: its largest errors window by window, and of the first seed its course."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.twin.reproduce.experiment import Outcome
from spheretwin.twin.reproduce.laws import Compared
from spheretwin.twin.simulation import Run

if TYPE_CHECKING:
    from spheretwin.viz.merged.flights import Flight

Array = NDArray[np.float64]

WINDOW_s = 0.05
"""Of the figure of the errors: each point is the largest within one."""

THINNED_s = 0.01
"""Between the entries of a course: the rotor turns by some 4° in that time."""


class Course(NamedTuple):
    """A run, thinned."""

    t_s: Array  # (n,)
    q_rad: Array  # (n, 3)
    q_ref_rad: Array  # (n, 3)
    torque_Nm: Array  # (n,) norm, stator frame


class Flown(NamedTuple):
    """What remains of a run."""

    windows_rad: Array  # (windows, 3) largest |error| within each
    course: Course | None
    """None but of the first seed."""

    def largest_after(self, t_s: float) -> Array:
        """(3,) largest |error| from a time on, rad; no numbers where the run had ended."""
        after = self.windows_rad[round(t_s / WINDOW_s) :]
        return after.max(axis=0) if len(after) else np.full(3, np.nan)


def keep(run: Run) -> Flown:
    """Reduce a run."""
    table, period_s = run.telemetry, run.scenario.controller.period_s
    ticks = max(1, round(WINDOW_s / period_s))
    whole = len(table) // ticks
    error = np.abs(table["error_rad"][: whole * ticks]).reshape(whole, ticks, 3)
    every = slice(None, None, max(1, round(THINNED_s / period_s)))
    course = Course(
        t_s=table["t_s"][every].copy(),
        q_rad=table["q_rad"][every].copy(),
        q_ref_rad=table["q_ref_rad"][every].copy(),
        torque_Nm=np.linalg.norm(table["torque_Nm"][every], axis=1),
    )
    return Flown(error.max(axis=1), course if run.scenario.seed == 0 else None)


def side_by_side(runs: Mapping[Compared, Outcome]) -> dict[str, Flight]:
    """Runs of the first seed for a recording, by the labels of their laws."""
    from spheretwin.viz.merged.flights import Flight

    return {
        compared.label: Flight(compared.law, *outcome.kept.course)
        for compared, outcome in runs.items()
        if len(outcome.kept.course.t_s)
    }
