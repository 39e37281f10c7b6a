"""Results of the tuned laws: medians over seeds that the search did not use, tables and findings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.paper import rival_conditions as conditions
from spheretwin.paper.experiment import Array, Finding, Outcome, Outcomes, ResultTable
from spheretwin.paper.laws import BY_LAW
from spheretwin.paper.page import ERRORS, NONE, figures_named
from spheretwin.paper.rival_conditions import (
    ALLOCATIONS,
    COMPLETE,
    HARDWARE,
    Condition,
    Hardware,
    study,
    tuned_gains,
)
from spheretwin.run import Run

OUR_LAW = "afsm_eso"
LEVEL = 1.05
"""Ratio of two errors up to which they are called level."""


class Result(NamedTuple):
    """A law under one condition: medians unless stated; NaN if any run was lost."""

    law: str
    label: str
    limit_A_s: float | None
    """None of a preset, which was not searched here."""
    largest_rad: float
    worst_rad: float
    """The largest one of all seeds."""
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


def _medians(hardware: Hardware, runs: Sequence[Outcome]) -> tuple[float, float, float, float]:
    if not all(run.is_complete for run in runs):
        return np.nan, np.nan, np.nan, np.nan
    largest, tail = (
        [float(ERRORS[error](run)[list(hardware.hinges)].max()) for run in runs]
        for error in ("max_abs_error", "tail_rms_error")
    )
    variation = np.median(figures_named(runs, "current_variation_A_s"))
    return float(np.median(largest)), max(largest), float(variation), float(np.median(tail))


ALLOCATION_LABELS = {
    "least_norm": "full current, least norm",
    "bounded": "full current, bounded allocation",
}


def ranges(hardware: Hardware) -> ResultTable:
    """Gains that the search varies, their ranges and the reasons."""
    optimise = study(hardware.study).optimise
    rows: list[tuple[str, ...]] = [
        (
            BY_LAW[gain.law].label if gain.law else "all laws",
            gain.called.removeprefix("controller."),
            gain.reason,
            f"{gain.low:g}",
            f"{gain.high:g}",
            "yes" if gain.optional else "no",
        )
        for gain in (optimise.gain if optimise else ())
    ]
    head = ("law", "gain", "reason", "from", "to", "may be off")
    return ResultTable(f"Ranges of the search, {hardware.title}", head, rows, 3)


def gains_table(hardware: Hardware) -> ResultTable:
    """Gains of the search."""
    rows: list[tuple[str, ...]] = [
        (f"{gains.limit_A_s:g}", BY_LAW[gains.law].label, _as_text(gains.gains))
        for gains in tuned_gains(hardware.study)
    ]
    return ResultTable(f"Gains found, {hardware.title}", ("limit, A/s", "law", "gains"), rows, 3)


def _as_text(gains: Mapping[str, float | None]) -> str:
    by_name = {name.removeprefix("controller."): value for name, value in gains.items()}
    return ", ".join(
        f"{name} {'off' if value is None else f'{value:.4g}'}" for name, value in by_name.items()
    )


def errors(hardware: Hardware, outcomes: Outcomes) -> ResultTable:
    """Error, variation and tail of every law within each limit, and the limit that the currents set."""
    conditions = [condition for condition in hardware.conditions if not condition.perturbed]
    rows = _rows(hardware, conditions, outcomes, with_tail=True)
    if not hardware.in_degrees:
        rows += _current_limits(conditions, outcomes)
    unit = _unit(hardware)
    title = (
        f"{hardware.title}: largest error in {unit} / variation in A/s / tail RMS in {_tail_unit(hardware)}"
    )
    return ResultTable(title, ("limit, A/s", "law", *(condition.name for condition in conditions)), rows, 2)


def robustness(hardware: Hardware, outcomes: Outcomes) -> ResultTable:
    """Error and variation under a wrong nominal model, with the gains of the table before."""
    first = hardware.conditions[0]
    conditions = [first, *(condition for condition in hardware.conditions if condition.perturbed)]
    rows = _rows(hardware, conditions, outcomes, with_tail=False)
    title = f"{hardware.title}, wrong nominal model: largest error in {_unit(hardware)} / variation in A/s"
    return ResultTable(title, ("limit, A/s", "law", *(condition.name for condition in conditions)), rows, 2)


def complete_prototype(hardware: Hardware, outcomes: Outcomes) -> list[ResultTable]:
    """Median and worst error with every imperfection; no table for hardware without this condition."""
    title = f"{hardware.title} with every imperfection: largest error in {_unit(hardware)}, variation in A/s"
    return [
        ResultTable(
            title,
            ("limit, A/s", "law", "median", "worst", "variation"),
            [
                (
                    NONE if result.limit_A_s is None else f"{result.limit_A_s:g}",
                    result.label,
                    *_spread(result),
                )
                for result in sorted(every, key=_by_limit_and_error)
            ],
            2,
        )
        for condition in hardware.conditions
        if condition.name == COMPLETE and (every := results(hardware, condition, outcomes))
    ]


def _spread(result: Result) -> tuple[str, str, str]:
    if result.is_lost:
        return "lost", NONE, NONE
    median_deg, worst_deg = np.degrees([result.largest_rad, result.worst_rad])
    return f"{median_deg:.3f}", f"{worst_deg:.3f}", f"{result.variation_A_s:.1f}"


def _by_limit_and_error(result: Result) -> tuple[float, bool, float]:
    limit = np.inf if result.limit_A_s is None else result.limit_A_s
    return limit, result.is_lost, result.largest_rad


def _rows(
    hardware: Hardware, conditions: Sequence[Condition], outcomes: Outcomes, with_tail: bool
) -> list[tuple[str, ...]]:
    """A row a law, by limit and, within it, by the error under the first condition."""
    by_condition = [results(hardware, condition, outcomes) for condition in conditions]
    by_law = [{(result.limit_A_s, result.label): result for result in of_one} for of_one in by_condition]
    rows: list[tuple[str, ...]] = []
    for limit in hardware.limits_A_s:
        ordered = within(by_condition[0], limit)
        rows += [_row(hardware, f"{limit:g}", result, by_law, with_tail) for result in ordered]
        tuned = {result.law for result in ordered}
        rows += [
            (f"{limit:g}", law.label, "none within the limit", *[NONE] * (len(conditions) - 1))
            for name, law in BY_LAW.items()
            if tuned and name not in tuned
        ]
    presets = [result for result in by_condition[0] if result.limit_A_s is None]
    return rows + [_row(hardware, "as shipped", result, by_law, with_tail) for result in presets]


def _row(
    hardware: Hardware,
    limit: str,
    of_law: Result,
    by_law: Sequence[dict[tuple[float | None, str], Result]],
    with_tail: bool,
) -> tuple[str, ...]:
    key = of_law.limit_A_s, of_law.label
    cells = [_cell(hardware, of_one[key], with_tail) if key in of_one else NONE for of_one in by_law]
    return (limit, of_law.label, *cells)


def _cell(hardware: Hardware, result: Result, with_tail: bool) -> str:
    if result.is_lost:
        return "lost"
    cells = [_angle(hardware, result.largest_rad), f"{result.variation_A_s:.1f}"]
    if with_tail:
        tail = np.degrees(result.tail_rad) if hardware.in_degrees else 1e4 * result.tail_rad
        cells.append(f"{tail:.3f}" if hardware.in_degrees else f"{tail:.2f}")
    return " / ".join(cells)


def _angle(hardware: Hardware, value_rad: float) -> str:
    return f"{np.degrees(value_rad):.4f}" if hardware.in_degrees else f"{1e3 * value_rad:.2f}"


def _unit(hardware: Hardware) -> str:
    return "degrees" if hardware.in_degrees else "mrad"


def _tail_unit(hardware: Hardware) -> str:
    return "degrees" if hardware.in_degrees else "1e-4 rad"


def _current_limits(conditions: Sequence[Condition], outcomes: Outcomes) -> list[tuple[str, ...]]:
    limits = [current_limits_rad(condition, outcomes) for condition in conditions]
    return [
        ("physical", label, *(f"{1e3 * limit[name]:.2f}" if name in limit else NONE for limit in limits))
        for name, label in ALLOCATION_LABELS.items()
        if any(name in limit for limit in limits)
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Best law within each limit, and which laws are level with or better than our own."""
    return [
        Finding(None, f"{hardware.title}, {condition.name}, largest error: {'; '.join(parts)}")
        for hardware in HARDWARE
        for condition in hardware.conditions
        if (parts := _by_limit(hardware, condition, outcomes))
    ]


def _by_limit(hardware: Hardware, condition: Condition, outcomes: Outcomes) -> list[str]:
    complete = [result for result in results(hardware, condition, outcomes) if not result.is_lost]
    return [
        f"tuned within {limit:g} A/s {_comparison(hardware, ordered)}"
        for limit in hardware.limits_A_s
        if (ordered := within(complete, limit))
    ]


def _comparison(hardware: Hardware, ordered: Sequence[Result]) -> str:
    """Order of some laws against our own; the least error first."""
    unit, own_label = _unit(hardware), BY_LAW[OUR_LAW].label
    texts = {
        result.law: f"{result.label} ({_angle(hardware, result.largest_rad)} {unit})" for result in ordered
    }
    if OUR_LAW not in texts:
        return f"{texts[ordered[0].law]} is best, and {own_label} lost the rotor or is beyond the limit"
    errors = {result.law: result.largest_rad for result in ordered}
    ours = errors.pop(OUR_LAW)
    better = [texts[law] for law, error in errors.items() if LEVEL * error < ours]
    level = [texts[law] for law, error in errors.items() if ours / LEVEL <= error <= LEVEL * ours]
    parts = [f"{name}: {', '.join(laws)}" for name, laws in (("better", better), ("level", level)) if laws]
    if not parts:
        nearest = f", before {texts[next(iter(errors))]}" if errors else ""
        return f"{texts[OUR_LAW]} is best{nearest}"
    return f"{texts[OUR_LAW]} is not alone; {'; '.join(parts)}"
