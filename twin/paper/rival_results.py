"""Results of the tuned laws: medians over seeds that the search did not use, tables and findings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.paper import rival_conditions as conditions
from spheretwin.paper.experiment import Array, Finding, Outcome, Outcomes, ResultTable
from spheretwin.paper.laws import BY_LAW
from spheretwin.paper.page import ERRORS, NONE, figures_named
from spheretwin.paper.rival_conditions import (
    ALLOCATIONS,
    COMPLETE,
    ELECTRONICS,
    HARDWARE,
    Condition,
    Hardware,
    study,
    tuned_gains,
)
from spheretwin.run import Run
from spheretwin.scenario.fields import quantity_text
from spheretwin.study.statistics import interval

OUR_LAW = "afsm_eso"


class Result(NamedTuple):
    """A law under one condition: medians unless stated; NaN if any run was lost."""

    law: str
    label: str
    limit_A_s: float | None
    """None of a preset, which was not searched here."""
    largest_rad: float
    low_rad: float
    high_rad: float
    """Ends of the 95 % interval of this median."""
    worst_rad: float
    """The largest one of all seeds."""
    variation_A_s: float
    tail_rad: float

    @property
    def is_lost(self) -> bool:
        """Whether any run did not complete."""
        return not np.isfinite(self.largest_rad)

    def is_level(self, other: Result) -> bool:
        """True if the intervals overlap: the seeds do not rank the two."""
        return self.low_rad <= other.high_rad and other.low_rad <= self.high_rad


def results(
    hardware: Hardware, condition: Condition, outcomes: Outcomes, seeds: int | None = None
) -> list[Result]:
    """Results under a condition: tuned laws by limit, then presets; of the first seeds, or of all."""
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
        if (runs := outcomes.runs(case)[:seeds])
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


def _medians(hardware: Hardware, runs: Sequence[Outcome]) -> tuple[float, ...]:
    if not all(run.is_complete for run in runs):
        return (np.nan,) * 6
    largest, tail = (
        [float(ERRORS[error](run)[list(hardware.hinges)].max()) for run in runs]
        for error in ("max_abs_error", "tail_rms_error")
    )
    variation = np.median(figures_named(runs, "current_variation_A_s"))
    ends = interval(largest)
    return float(np.median(largest)), *ends, max(largest), float(variation), float(np.median(tail))


ALLOCATION_LABELS = {"least_norm": "full current, least norm", "bounded": "full current, bounded allocation"}


def ranges(hardware: Hardware) -> ResultTable:
    """Gains that the search varies, their ranges and the reasons."""
    optimise = study(hardware.study).optimise
    rows: list[tuple[str, ...]] = [
        (
            BY_LAW[gain.law].label if gain.law else "all laws",
            _gain_name(gain.called),
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
    """Gains of the search, by law and limit."""
    by_law = {(tuned.law, tuned.limit_A_s): tuned.gains for tuned in tuned_gains(hardware.study)}
    names = {(law, name) for (law, _), gains in by_law.items() for name in gains}
    rows: list[tuple[str, ...]] = [
        (
            BY_LAW[law].label,
            _gain_name(name),
            *(_gain_text(by_law.get((law, limit)), name) for limit in hardware.limits_A_s),
        )
        for law, name in sorted(names, key=lambda gain: (list(BY_LAW).index(gain[0]), gain[1]))
    ]
    head = ("law", "gain", *(f"limit {limit:g} A/s" for limit in hardware.limits_A_s))
    return ResultTable(f"Gains found, {hardware.title}", head, rows, 2)


def _gain_name(called: str) -> str:
    return quantity_text(called.removeprefix("controller."))


def _gain_text(gains: Mapping[str, float | None] | None, name: str) -> str:
    if gains is None:
        return NONE
    value = gains[name]
    return "off" if value is None else f"{value:.4g}"


def errors(hardware: Hardware, outcomes: Outcomes) -> list[ResultTable]:
    """Largest error, variation and RMS error of every law within each limit; errors at full current."""
    conditions = [condition for condition in hardware.conditions if not condition.perturbed]
    largest, *others = _tables(hardware, hardware.title, conditions, outcomes)
    if not hardware.in_degrees:
        largest = largest._replace(rows=[*largest.rows, *_current_limits(conditions, outcomes)])
    return [largest, *others]


def robustness(hardware: Hardware, outcomes: Outcomes) -> list[ResultTable]:
    """Largest error and variation under a wrong nominal model, with the gains of the tables before."""
    first = hardware.conditions[0]
    conditions = [first, *(condition for condition in hardware.conditions if condition.perturbed)]
    return _tables(hardware, f"{hardware.title}, wrong nominal model", conditions, outcomes)[:2]


def complete_prototype(hardware: Hardware, outcomes: Outcomes) -> list[ResultTable]:
    """Median and worst error with every imperfection; no table for hardware without this condition."""
    complete = [condition for condition in hardware.conditions if condition.name == COMPLETE]
    every = [result for condition in complete for result in results(hardware, condition, outcomes)]
    rows: list[tuple[str, ...]] = [
        (NONE if result.limit_A_s is None else f"{result.limit_A_s:g}", result.label, *_spread(result))
        for result in sorted(every, key=_by_limit_and_error)
    ]
    head = (
        "limit, A/s", "law", "median error, degrees", "worst error of the seeds, degrees", "variation, A/s",
    )  # fmt: skip
    return [ResultTable(f"{hardware.title} with every imperfection", head, rows, 2)] if every else []


def predictive_control(outcomes: Outcomes) -> list[ResultTable]:
    """Largest error and variation of predictive control, PID and AFSM-ESO on the seeds of the first."""
    compared = (OUR_LAW, "pid")
    rows: list[tuple[str, ...]] = []
    for condition in conditions.PREDICTIVE:
        own = outcomes.runs(conditions.predictive_case(condition))
        if not own:
            continue
        rows.append((condition.name, "predictive control", *_predictive_cells(_medians(ELECTRONICS, own))))
        rows += [
            (condition.name, result.label, *_predictive_cells(result[3:]))
            for result in _by_limit_and_preset(results(ELECTRONICS, condition, outcomes, len(own)))
            if result.law in compared
        ]
    head = ("condition", "law", "largest error, degrees", "variation, A/s")
    return [ResultTable("Predictive control of the tilt", head, rows, 2)] if rows else []


def _by_limit_and_preset(every: Sequence[Result]) -> list[Result]:
    """Tuned laws within the largest limit, and the presets as shipped."""
    limit = max(ELECTRONICS.limits_A_s)
    return [result for result in every if result.limit_A_s in (limit, None)]


def _predictive_cells(figures: Sequence[float]) -> tuple[str, str]:
    largest_rad, variation_A_s = figures[0], figures[4]
    if not np.isfinite(largest_rad):
        return "lost", NONE
    return f"{np.degrees(largest_rad):.3f}", f"{variation_A_s:.1f}"


def _spread(result: Result) -> tuple[str, str, str]:
    if result.is_lost:
        return "lost", NONE, NONE
    worst_deg = np.degrees(result.worst_rad)
    return _error(ELECTRONICS, result), f"{worst_deg:.3f}", f"{result.variation_A_s:.1f}"


def _by_limit_and_error(result: Result) -> tuple[float, bool, float]:
    limit = np.inf if result.limit_A_s is None else result.limit_A_s
    return limit, result.is_lost, result.largest_rad


def _tables(
    hardware: Hardware, title: str, conditions: Sequence[Condition], outcomes: Outcomes
) -> list[ResultTable]:
    """A table for each measure: a row for each law, by limit and by the error under the first condition."""
    unit = _unit(hardware)
    measures: dict[str, Callable[[Result], str]] = {
        f"largest error, {unit}": lambda result: _error(hardware, result),
        "variation of the commands, A/s": lambda result: f"{result.variation_A_s:.1f}",
        f"RMS error of the second half, {unit}": lambda result: _angle(hardware, result.tail_rad),
    }
    by_condition = [results(hardware, condition, outcomes) for condition in conditions]
    by_law = [{(result.limit_A_s, result.label): result for result in of_one} for of_one in by_condition]
    head = ("limit, A/s", "law", *(condition.name for condition in conditions))

    def rows(text: Callable[[Result], str]) -> list[tuple[str, ...]]:
        return [
            (
                "as shipped" if limit is None else f"{limit:g}",
                label,
                *(_cell(of_one.get((limit, label)), text) for of_one in by_law),
            )
            for limit, label in _order(hardware, by_condition[0])
        ]

    return [ResultTable(f"{title}: {name}", head, rows(text), 2) for name, text in measures.items()]


def _order(hardware: Hardware, of_first: Sequence[Result]) -> list[tuple[float | None, str]]:
    """Limits and laws of the rows: tuned laws by their error, those without gains in the limit, presets."""
    order: list[tuple[float | None, str]] = []
    for limit in hardware.limits_A_s:
        tuned = [result.label for result in within(of_first, limit)]
        others = [law.label for law in BY_LAW.values() if tuned and law.label not in tuned]
        order += [(limit, label) for label in (*tuned, *others)]
    return order + [(None, result.label) for result in of_first if result.limit_A_s is None]


def _cell(result: Result | None, text: Callable[[Result], str]) -> str:
    if result is None:
        return NONE
    return "lost" if result.is_lost else text(result)


def _error(hardware: Hardware, result: Result) -> str:
    """Median and its interval; a dash for an end for which the seeds are too few."""
    low, high = (
        _angle(hardware, end) if np.isfinite(end) else NONE for end in (result.low_rad, result.high_rad)
    )
    return f"{_angle(hardware, result.largest_rad)} [{low}, {high}]"


def _angle(hardware: Hardware, value_rad: float) -> str:
    return f"{np.degrees(value_rad):.4f}" if hardware.in_degrees else f"{1e3 * value_rad:.3f}"


def _unit(hardware: Hardware) -> str:
    return "degrees" if hardware.in_degrees else "mrad"


def _current_limits(conditions: Sequence[Condition], outcomes: Outcomes) -> list[tuple[str, ...]]:
    limits = [current_limits_rad(condition, outcomes) for condition in conditions]
    return [
        ("physical", label, *(f"{1e3 * limit[name]:.3f}" if name in limit else NONE for limit in limits))
        for name, label in ALLOCATION_LABELS.items()
        if any(name in limit for limit in limits)
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Law with the smallest error within each limit, and laws that are level with or better than our own."""
    return [
        Finding(None, f"{hardware.title}, {condition.name}: {'; '.join(statements)}")
        for hardware in HARDWARE
        for condition in hardware.conditions
        if (statements := _by_limit(hardware, condition, outcomes))
    ]


def _by_limit(hardware: Hardware, condition: Condition, outcomes: Outcomes) -> list[str]:
    """Statements on the order of the laws, each with the limits for which it is true."""
    every = results(hardware, condition, outcomes)
    complete = [result for result in every if not result.is_lost]
    # A limit on the cases may leave out our own law, of which nothing is known then.
    tuned = {gains.limit_A_s for gains in tuned_gains(hardware.study) if gains.law == OUR_LAW}
    left_out = tuned - {result.limit_A_s for result in every if result.law == OUR_LAW}
    limits: dict[str, list[str]] = {}
    for limit in hardware.limits_A_s:
        if limit not in left_out and (ordered := within(complete, limit)):
            limits.setdefault(_comparison(ordered), []).append(f"{limit:g}")
    return [f"within {_listed(texts)} A/s {statement}" for statement, texts in limits.items()]


def _comparison(ordered: Sequence[Result]) -> str:
    """Compare some laws, the least error first, with our own."""
    own = BY_LAW[OUR_LAW].label
    ours = next((result for result in ordered if result.label == own), None)
    first = ours or ordered[0]
    level = [result.label for result in ordered if result is not first and first.is_level(result)]
    if ours is None:
        text = f"{first.label} has the smallest error{f', level with {_listed(level)}' if level else ''}"
        return f"{text}; {own} loses the rotor or exceeds the limit"
    better = [result.label for result in ordered if result.high_rad < ours.low_rad]
    if better:
        text = f"{_listed(better)} {'have' if len(better) > 1 else 'has'} a smaller error than {own}"
        return f"{text}, which is level with {_listed(level)}" if level else text
    return f"{own} is level with {_listed(level)}" if level else f"{own} has the smallest error"


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
