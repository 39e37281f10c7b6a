"""Rows of the JSON: one for each case, with median and range over the seeds; statistics of tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import Array, Case, Outcome, Outcomes
from spheretwin.paper.runner import CaseSummary, Plan, command_line, summarise
from spheretwin.study.agreement import BOUND

NONE = "–"
"""Cell of a table without a value."""

ERRORS: dict[str, Callable[[Outcome], Any]] = {
    "max_abs_error": lambda outcome: outcome.max_abs_error,
    "measured_max_abs_error": lambda outcome: outcome.measured_max_abs_error,
    "rms_error": lambda outcome: outcome.rms_error,
    "tail_rms_error": lambda outcome: outcome.tail_rms_error,
}
"""Errors of each hinge; the JSON has their median, and lowest and highest, over the seeds."""

EFFORT = {
    "rms_torque_Nm": "rms_torque_range_Nm",
    "current_variation_A_s": "current_variation_range_A_s",
}
"""Metrics of the effort; the JSON has their median, and lowest and highest, over the seeds."""

PLANT_LABELS = {"lagrangian": "the Lagrangian", "mujoco": "MuJoCo"}


def rows(
    plan: Plan, outcomes: Outcomes, summaries: Mapping[str, CaseSummary] | None = None
) -> list[dict[str, Any]]:
    """Rows of an experiment, in the order of its cases.

    Parameters
    ----------
    plan : Plan
    outcomes : Outcomes
    summaries : mapping, optional
        `summarise` of the plan, if it is known already.
    """
    summaries = summaries or summarise(plan)
    return [_row(plan, case, summaries[case.name], outcomes[case.name]) for case in plan.cases]


def _row(plan: Plan, case: Case, summary: CaseSummary, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    return {
        "figure": plan.experiment.name,
        "case": case.name,
        **summary.fields,
        "fields": dict(case.fields),
        "command": command_line(case, summary.fields["plant"]),
        "seeds": len(outcomes),
        **_errors(outcomes),
        **_effort(outcomes),
        "status": _status(case, outcomes),
        "statuses": dict(sorted(Counter(str(outcome.status) for outcome in outcomes).items())),
        "paper": None,
        **case.details,
        **plan.experiment.row_fields(outcomes),
    }


def _errors(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    for name, error in ERRORS.items():
        values = np.array([error(outcome) for outcome in outcomes])
        fields[f"{name}_rad"] = np.median(values, axis=0).tolist()
        fields[f"{name}_range_rad"] = np.stack([values.min(axis=0), values.max(axis=0)], axis=1).tolist()
    return fields


def _effort(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    for name, range_name in EFFORT.items():
        values = figures_named(outcomes, name)
        numbers = values[np.isfinite(values)]
        fields[name] = float(np.median(numbers)) if len(numbers) else None
        fields[range_name] = [float(numbers.min()), float(numbers.max())] if len(numbers) else None
    return fields


def _status(case: Case, outcomes: Sequence[Outcome]) -> Status:
    """Unexpected status of any run, else the most frequent status."""
    counts = Counter(outcome.status for outcome in outcomes)
    unexpected = [status for status in counts if status not in case.expected_statuses]
    return unexpected[0] if unexpected else counts.most_common(1)[0][0]


def spread(values: Array | Sequence[float], digits: int) -> str:
    """Numbers as their median, and lowest to highest if these differ."""
    if not len(values) or not np.all(np.isfinite(values)):
        return NONE
    low, middle, high = (f"{value:.{digits}f}" for value in np.quantile(values, [0, 0.5, 1]))
    return middle if low == high else f"{middle} ({low} to {high})"


def spread_deg(values: Array | Sequence[float], digits: int = 3) -> str:
    """`spread` of angles in rad, as degrees."""
    return spread(np.degrees(values), digits)


def spread_mrad(values: Array | Sequence[float], digits: int = 1) -> str:
    """`spread` of angles in rad, as mrad."""
    return spread(1e3 * np.asarray(values), digits)


def of_axis(outcomes: Sequence[Outcome], error: str, axis: int) -> Array:
    """One of `ERRORS` of one hinge for each seed, rad."""
    return np.array([ERRORS[error](outcome)[axis] for outcome in outcomes])


def figures_named(outcomes: Sequence[Outcome], metric: str) -> Array:
    """One metric of each seed; NaN if a run has none."""
    return np.array([outcome.figures.get(metric) for outcome in outcomes], dtype=np.float64)


def statuses_text(outcomes: Sequence[Outcome]) -> str:
    """Statuses of the runs of a case, for a table."""
    counts = Counter(outcome.status for outcome in outcomes)
    if len(counts) == 1:
        return str(next(iter(counts)))
    return ", ".join(f"{count} {status}" for status, count in counts.items())


def padded(arrays: Sequence[Array]) -> Array:
    """Stack arrays (n, k) of runs to (runs, longest n, k); NaN after the end of a run that ended early."""
    stacked = np.full((len(arrays), max(map(len, arrays)), arrays[0].shape[1]), np.nan)
    for run, array in zip(stacked, arrays, strict=True):
        run[: len(array)] = array
    return stacked


def window_maxima(error: Array, window_s: float, period_s: float) -> Array:
    """Largest absolute value of each column of an error (n, k) within each complete window."""
    ticks = max(1, round(window_s / period_s))
    windows = len(error) // ticks
    return np.abs(error)[: windows * ticks].reshape(windows, ticks, error.shape[1]).max(axis=1)


def plants_text(plants: Sequence[str], differences: Sequence[float]) -> str:
    """Sentence on the plants of the rows, and on the differences of a sample on both plants.

    Parameters
    ----------
    plants : sequence of str
        Plant of each row.
    differences : sequence of float
        Difference of each run of the sample, from `runner.compare_plants`.
    """
    counts = sorted(Counter(plants).items())
    listed = " and ".join(f"{count} on {PLANT_LABELS.get(plant, plant)}" for plant, count in counts)
    if not differences:
        return f"Rows: {listed}."
    return (
        f"Rows: {listed}. {len(differences)} of their runs were made on MuJoCo too: the RMS errors differ by"
        f" at most {max(differences):.1e} of the largest of a run's three (bound {BOUND:g})."
    )
