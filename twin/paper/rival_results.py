"""Results of the tuned laws: medians over seeds that the search did not use."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import BY_LAW, Array, Outcome, Outcomes
from spheretwin.paper.rival_conditions import (
    ALLOCATIONS,
    Condition,
    Hardware,
    limit_case,
    preset_case,
    tuned_case,
    tuned_gains,
)
from spheretwin.paper.rows import ERRORS, figures_named
from spheretwin.run import Run

OUR_LAW = "afsm_eso"
LEVEL = 1.05
"""Ratio of two errors up to which they are called level."""


class Result(NamedTuple):
    """A law under one condition: medians; no numbers if any run was lost."""

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
        (each.law, BY_LAW[each.law].label, each.limit_A_s, tuned_case(hardware, condition, each))
        for each in tuned_gains(hardware.study)
    ]
    shipped = [
        (
            OUR_LAW,
            f"{BY_LAW[OUR_LAW].label}, preset `{preset}`",
            None,
            preset_case(hardware, condition, preset),
        )
        for preset in hardware.presets
    ]
    return [
        Result(law, label, limit, *_medians(hardware, outcomes[case.name]))
        for law, label, limit, case in (*tuned, *shipped)
        if case.name in outcomes
    ]


def within(found: Sequence[Result], limit_A_s: float) -> list[Result]:
    """Laws tuned within a limit, the least error first and lost ones last."""
    chosen = [each for each in found if each.limit_A_s == limit_A_s]
    return sorted(chosen, key=lambda each: (each.is_lost, each.largest_rad))


def current_limits_rad(condition: Condition, outcomes: Outcomes) -> dict[str, float]:
    """Error at the start under full current, by allocation."""
    cases = {allocation: limit_case(condition, allocation).name for allocation in ALLOCATIONS}
    return {
        allocation: float(np.median([np.max(outcome.kept) for outcome in outcomes[name]]))
        for allocation, name in cases.items()
        if name in outcomes
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


def _medians(hardware: Hardware, found: Sequence[Outcome]) -> tuple[float, float, float]:
    if any(outcome.status != Status.COMPLETED for outcome in found):
        return np.nan, np.nan, np.nan
    largest, tail = (
        np.median([ERRORS[error](outcome)[list(hardware.hinges)].max() for outcome in found])
        for error in ("max_abs_error", "tail_rms_error")
    )
    variation = np.median(figures_named(found, "current_variation_A_s"))
    return float(largest), float(variation), float(tail)
