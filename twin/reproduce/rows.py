"""Rows of the JSON: a case each, its figures as median and range over the seeds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Status
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.reproduce.experiment import Case, Outcome, Outcomes
from spheretwin.twin.reproduce.running import Plan

ERRORS = {
    "max_abs_error": lambda outcome: outcome.max_abs_error,
    "measured_max_abs_error": lambda outcome: outcome.measured_max_abs_error,
    "tail_rms_error": lambda outcome: outcome.tail_rms_error,
}
"""Errors of each hinge; the JSON has their median, and lowest and highest, over the seeds."""


def rows(plan: Plan, outcomes: Outcomes) -> list[dict[str, Any]]:
    """Rows of an experiment, in the order of its cases."""
    return [_row(plan, case, outcomes[case.name]) for case in plan.cases]


def _row(plan: Plan, case: Case, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    scenario = scenarios.load(case.scenario, case.fields)
    return {
        "figure": plan.experiment.name,
        "case": case.name,
        "scenario": scenario.name,
        "controller": scenario.controller.law,
        "m": scenario.plant.modelling_error,
        "L": scenario.disturbance.load,
        "hardware": scenario.hardware,
        "fields": dict(case.fields),
        "seeds": len(outcomes),
        **_errors(outcomes),
        "status": _status(case, outcomes),
        "statuses": dict(sorted(Counter(str(outcome.status) for outcome in outcomes).items())),
        "paper": None,
        **case.told,
        **plan.experiment.more(outcomes),
    }


def _errors(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    told: dict[str, Any] = {}
    for name, of in ERRORS.items():
        values = np.array([of(outcome) for outcome in outcomes])
        told[f"{name}_rad"] = np.median(values, axis=0).tolist()
        told[f"{name}_range_rad"] = np.stack([values.min(axis=0), values.max(axis=0)], axis=1).tolist()
    return told


def _status(case: Case, outcomes: Sequence[Outcome]) -> Status:
    """What any run ended with that should not be, or else what most ended with."""
    ended = Counter(outcome.status for outcome in outcomes)
    unwanted = [status for status in ended if status not in case.ends]
    return unwanted[0] if unwanted else ended.most_common(1)[0][0]


def spread_deg(values: NDArray[np.float64] | Sequence[float], digits: int = 3) -> str:
    """Angles in rad as degrees: their median, and lowest to highest where these differ."""
    if not np.all(np.isfinite(values)):
        return "–"
    low, middle, high = (f"{np.degrees(value):.{digits}f}" for value in np.quantile(values, [0, 0.5, 1]))
    return middle if low == high else f"{middle} ({low} to {high})"


def of_axis(outcomes: Sequence[Outcome], error: str, axis: int) -> NDArray[np.float64]:
    """One of `ERRORS` of one hinge for each seed, rad."""
    return np.array([ERRORS[error](outcome)[axis] for outcome in outcomes])


def ended(case_outcomes: Sequence[Outcome]) -> str:
    """How the runs of a case ended, for a table."""
    counted: Mapping[Status, int] = Counter(outcome.status for outcome in case_outcomes)
    if len(counted) == 1:
        return str(next(iter(counted)))
    return ", ".join(f"{count} {status}" for status, count in counted.items())
