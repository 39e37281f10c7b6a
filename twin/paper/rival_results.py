"""Results of the tuned laws: medians over seeds that the search did not use."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.paper import rival_conditions as conditions
from spheretwin.paper.experiment import Array, Outcome, Outcomes
from spheretwin.paper.laws import BY_LAW
from spheretwin.paper.rival_conditions import ALLOCATIONS, Condition, Hardware
from spheretwin.paper.rows import ERRORS, figures_named
from spheretwin.run import Run

OUR_LAW = "afsm_eso"
LEVEL = 1.05
"""Ratio of two errors up to which they are called level."""


class Result(NamedTuple):
    """A law under one condition: medians; NaN if any run was lost."""

    law: str
    label: str
    limit_A_s: float | None
    """None of a preset, which was not searched here."""
    largest_rad: float
    variation_A_s: float
    tail_rad: float

    @property
    def is_lost(self) -> bool:
        """Whether any run did not complete."""
        return not np.isfinite(self.largest_rad)


def results(hardware: Hardware, condition: Condition, outcomes: Outcomes) -> list[Result]:
    """All that ran under a condition: tuned laws by limit, then presets."""
    tuned = [
        (
            gains.law,
            BY_LAW[gains.law].label,
            gains.limit_A_s,
            conditions.tuned_case(hardware, condition, gains),
        )
        for gains in conditions.tuned_gains(hardware.study)
    ]
    shipped = [
        (
            OUR_LAW,
            f"{BY_LAW[OUR_LAW].label}, preset `{preset}`",
            None,
            conditions.preset_case(hardware, condition, preset),
        )
        for preset in hardware.presets
    ]
    return [
        Result(law, label, limit, *_medians(hardware, runs))
        for law, label, limit, case in (*tuned, *shipped)
        if (runs := outcomes.runs(case))
    ]


def within(results: Sequence[Result], limit_A_s: float) -> list[Result]:
    """Laws tuned within a limit, the least error first and lost ones last."""
    of_limit = [result for result in results if result.limit_A_s == limit_A_s]
    return sorted(of_limit, key=lambda result: (result.is_lost, result.largest_rad))


def current_limits_rad(condition: Condition, outcomes: Outcomes) -> dict[str, float]:
    """Error at the start under full current, by allocation."""
    return {
        allocation: float(np.median([np.max(run.data) for run in runs]))
        for allocation in ALLOCATIONS
        if (runs := outcomes.runs(conditions.limit_case(condition, allocation)))
    }


def start_error(run: Run) -> Array:
    """Largest error of each hinge (rad) until the error of its rate first changes sign."""
    table = run.telemetry
    error, rate_error = table["error_rad"], table["qdot_rad_s"] - table["qdot_ref_rad_s"]
    if not len(error):
        return np.full(3, np.nan)
    same_sign = np.logical_and.accumulate(np.sign(rate_error) == np.sign(rate_error[0]), axis=0)
    # The tick at which it has changed counts: the error is largest between it and the one before.
    until = np.vstack([np.ones((1, 3), dtype=np.bool_), same_sign[:-1]])
    return np.where(until, np.abs(error), 0.0).max(axis=0)


def _medians(hardware: Hardware, runs: Sequence[Outcome]) -> tuple[float, float, float]:
    if not all(run.is_complete for run in runs):
        return np.nan, np.nan, np.nan
    largest, tail = (
        np.median([ERRORS[error](run)[list(hardware.hinges)].max() for run in runs])
        for error in ("max_abs_error", "tail_rms_error")
    )
    variation = np.median(figures_named(runs, "current_variation_A_s"))
    return float(largest), float(variation), float(tail)
