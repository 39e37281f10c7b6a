"""Rows of the JSON: a case each, its figures as median and range over the seeds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Status
from spheretwin.paper.cases import Known, Plan, command_line, known
from spheretwin.paper.experiment import Case, Outcome, Outcomes
from spheretwin.study.agreement import BOUND

ERRORS: dict[str, Callable[[Outcome], Any]] = {
    "max_abs_error": lambda outcome: outcome.max_abs_error,
    "measured_max_abs_error": lambda outcome: outcome.measured_max_abs_error,
    "rms_error": lambda outcome: outcome.rms_error,
    "tail_rms_error": lambda outcome: outcome.tail_rms_error,
}
"""Errors of each hinge; the JSON has their median, and lowest and highest, over the seeds."""


NAMES = {"lagrangian": "the Lagrangian", "mujoco": "MuJoCo"}

EFFORT = {
    "rms_torque_Nm": "rms_torque_range_Nm",
    "current_variation_A_s": "current_variation_range_A_s",
}
"""Metrics of what a law spends; the JSON has their median, and lowest and highest, over the seeds."""


def rows(plan: Plan, outcomes: Outcomes, of_cases: Mapping[str, Known] | None = None) -> list[dict[str, Any]]:
    """Rows of an experiment, in the order of its cases.

    Parameters
    ----------
    plan : Plan
    outcomes : Outcomes
    of_cases : mapping, optional
        `known` of the plan, where that was found out already.
    """
    found = of_cases or known(plan)
    return [_row(plan, case, found[case.name], outcomes[case.name]) for case in plan.cases]


def _row(plan: Plan, case: Case, of_case: Known, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    return {
        "figure": plan.experiment.name,
        "case": case.name,
        "scenario": of_case.scenario,
        "controller": of_case.law,
        "m": of_case.m,
        "L": of_case.L,
        "hardware": of_case.hardware,
        "plant": of_case.plant,
        "fields": dict(case.fields),
        "command": command_line(case, of_case.plant),
        "seeds": len(outcomes),
        **_errors(outcomes),
        **_effort(outcomes),
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


def _effort(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    told: dict[str, Any] = {}
    for name, of_range in EFFORT.items():
        values = figures_named(outcomes, name)
        numbers = values[np.isfinite(values)]
        told[name] = float(np.median(numbers)) if len(numbers) else None
        told[of_range] = [float(numbers.min()), float(numbers.max())] if len(numbers) else None
    return told


def _status(case: Case, outcomes: Sequence[Outcome]) -> Status:
    """What any run ended with that should not be, or else what most ended with."""
    ended = Counter(outcome.status for outcome in outcomes)
    unwanted = [status for status in ended if status not in case.ends]
    return unwanted[0] if unwanted else ended.most_common(1)[0][0]


def spread(values: NDArray[np.float64] | Sequence[float], digits: int) -> str:
    """Numbers as their median, and lowest to highest where these differ."""
    if not len(values) or not np.all(np.isfinite(values)):
        return "–"
    low, middle, high = (f"{value:.{digits}f}" for value in np.quantile(values, [0, 0.5, 1]))
    return middle if low == high else f"{middle} ({low} to {high})"


def spread_deg(values: NDArray[np.float64] | Sequence[float], digits: int = 3) -> str:
    """Angles in rad as degrees: their median, and lowest to highest where these differ."""
    return spread(np.degrees(values), digits)


def spread_mrad(values: NDArray[np.float64] | Sequence[float], digits: int = 1) -> str:
    """Angles in rad as mrad: their median, and lowest to highest where these differ."""
    return spread(1e3 * np.asarray(values), digits)


def of_axis(outcomes: Sequence[Outcome], error: str, axis: int) -> NDArray[np.float64]:
    """One of `ERRORS` of one hinge for each seed, rad."""
    return np.array([ERRORS[error](outcome)[axis] for outcome in outcomes])


def figures_named(outcomes: Sequence[Outcome], metric: str) -> NDArray[np.float64]:
    """One metric of each seed; no number where a run has none."""
    return np.array([outcome.figures.get(metric) for outcome in outcomes], dtype=np.float64)


def ended(case_outcomes: Sequence[Outcome]) -> str:
    """How the runs of a case ended, for a table."""
    counted: Mapping[Status, int] = Counter(outcome.status for outcome in case_outcomes)
    if len(counted) == 1:
        return str(next(iter(counted)))
    return ", ".join(f"{count} {status}" for status, count in counted.items())


def plants_told(plants: Sequence[str], apart: Sequence[float]) -> str:
    """On which plants rows ran, and how far a sample is apart on both.

    Parameters
    ----------
    plants : sequence of str
        Of each row.
    apart : sequence of float
        Of each run of the sample, as `running.checked` has it.
    """
    counted = Counter(plants)
    on = " and ".join(f"{count} on {NAMES.get(plant, plant)}" for plant, count in sorted(counted.items()))
    said = f"Rows: {on}."
    if not apart:
        return said
    return (
        f"{said} {len(apart)} of their runs were made on MuJoCo too: the RMS errors differ by at most"
        f" {max(apart):.1e} of the largest of a run's three (bound {BOUND:g})."
    )


Three = tuple[float, float, float]

PRINTED_rad: Mapping[tuple[float, float], Mapping[str, Three]] = {
    (0.2, 1.0): {
        "pd": (0.4376, 0.4121, 0.4687),
        "adaptive_fuzzy": (0.2505, 0.2822, 0.2669),
        "afsm": (0.0832, 0.0750, 0.0761),
    },
    (0.2, 2.0): {
        "pd": (1.2560, 1.0560, 1.1500),
        "adaptive_fuzzy": (0.8954, 0.9856, 1.0100),
        "afsm": (0.1854, 0.1986, 0.1769),
    },
}
"""By m and L, and by law; of α, β and γ."""


def printed_rad(law: str, m: float, L: float) -> Three | None:
    """Largest errors that are printed of a law under a condition; None where there are none."""
    return PRINTED_rad.get((round(m, 6), round(L, 6)), {}).get(law)
