"""Comparison of the tuned laws: medians over seeds that the search did not use, tables and findings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from spheretwin.paper.experiment import ExperimentSection, Outcomes
from spheretwin.paper.experiment_file import BY_LAW
from spheretwin.paper.rival_conditions import FILE, HARDWARE, Hardware, cases
from spheretwin.viz.pages.markdown import Drawing

if TYPE_CHECKING:
    from spheretwin.viz.figures.fronts import FrontPanel


from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from spheretwin.paper.cells import ERRORS, NONE, Cell, figures_named, table
from spheretwin.paper.experiment import Array, RunOutcome, Statement
from spheretwin.paper.rival_conditions import ELECTRONICS, OUR_LAW
from spheretwin.run import Run
from spheretwin.scenario.fields import quantity_text
from spheretwin.study.optimise import Gain
from spheretwin.study.statistics import interval
from spheretwin.viz.pages.markdown import ResultTable

COMPLETE = "prototype"
"""Condition with every imperfection."""


class RivalResult(NamedTuple):
    """A law under one condition: medians unless stated; NaN if any run was lost."""

    law: str
    label: str
    limit_A_s: float | None
    """None of a preset, which was not searched here."""
    preset: str | None
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

    def is_level(self, other: RivalResult) -> bool:
        """True if the intervals overlap: the seeds do not rank the two."""
        return self.low_rad <= other.high_rad and other.low_rad <= self.high_rad


def conditions(hardware: Hardware, perturbed: bool) -> list[str]:
    """Return the names of the conditions with a right or with a wrong nominal model."""
    every = FILE[f"{hardware.name}_condition"]
    return [one["condition"] for one in every if one.get("comparable", True) is not perturbed]


def results(
    hardware: Hardware, condition: str, outcomes: Outcomes, seeds: int | None = None
) -> list[RivalResult]:
    """Results under a condition: tuned laws by limit, then presets; of the first seeds, or of all."""
    return [
        RivalResult(
            columns["law"],
            columns["row"],
            columns.get("limit_A_s"),
            columns.get("preset"),
            *_medians(hardware, item.runs[:seeds]),
        )
        for item in FILE.runs(outcomes, setting=hardware.name, condition=condition)
        if {"limit_A_s", "preset"} & (columns := item.case.columns).keys()
    ]


def within(results: Sequence[RivalResult], limit_A_s: float) -> list[RivalResult]:
    """Laws tuned within a limit, the least error first and lost ones last."""
    of_limit = [result for result in results if result.limit_A_s == limit_A_s]
    return sorted(of_limit, key=lambda result: (result.is_lost, result.largest_rad))


def current_limits_rad(condition: str, outcomes: Outcomes) -> dict[str, float]:
    """Error at the start under full current, by the name of its row."""
    return {
        item["row"]: float(np.median([np.max(run.data) for run in item.runs]))
        for item in FILE.runs(outcomes, condition=condition)
        if "limit" in item.case.columns
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


def _medians(hardware: Hardware, runs: Sequence[RunOutcome]) -> tuple[float, ...]:
    if not all(run.is_complete for run in runs):
        return (np.nan,) * 6
    largest, tail = (
        [float(ERRORS[error](run)[list(hardware.hinges)].max()) for run in runs]
        for error in ("max_abs_error", "tail_rms_error")
    )
    variation = np.median(figures_named(runs, "current_variation_A_s"))
    ends = interval(largest)
    return float(np.median(largest)), *ends, max(largest), float(variation), float(np.median(tail))


def ranges(hardware: Hardware) -> ResultTable:
    """Gains that the search varies, their ranges and the reasons."""
    cells: dict[str, Callable[[Gain], str]] = {
        "law": lambda gain: BY_LAW[gain.law].label if gain.law else "all laws",
        "gain": lambda gain: _gain_name(gain.called),
        "reason": lambda gain: gain.reason,
        "from": lambda gain: f"{gain.low:g}",
        "to": lambda gain: f"{gain.high:g}",
        "may be off": lambda gain: "yes" if gain.optional else "no",
    }
    return table(f"Ranges of the search, {hardware.title}", hardware.search.gain, cells, 3)


def gains_table(hardware: Hardware) -> ResultTable:
    """Gains of the search, by law and limit."""
    by_law = {(tuned.law, tuned.limit_A_s): tuned.gains for tuned in hardware.tuned}
    names = {(law, name) for (law, _), gains in by_law.items() for name in gains}
    rows = [
        (
            BY_LAW[law].label,
            _gain_name(name),
            *(_gain_text(by_law.get((law, limit)), name) for limit in hardware.search.limits),
        )
        for law, name in sorted(names, key=lambda gain: (list(BY_LAW).index(gain[0]), gain[1]))
    ]
    head = ("law", "gain", *(f"limit {limit:g} A/s" for limit in hardware.search.limits))
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
    right = conditions(hardware, perturbed=False)
    largest, *others = _tables(hardware, hardware.title, right, outcomes)
    limits = [current_limits_rad(condition, outcomes) for condition in right]
    if hardware.in_degrees or not any(limits):
        return [largest, *others]
    rows = [
        ("physical", name, *(f"{1e3 * limit[name]:.3f}" if name in limit else NONE for limit in limits))
        for name in dict.fromkeys(name for limit in limits for name in limit)
    ]
    return [largest._replace(rows=[*largest.rows, *rows]), *others]


def robustness(hardware: Hardware, outcomes: Outcomes) -> list[ResultTable]:
    """Largest error and variation under a wrong nominal model, with the gains of the tables before."""
    compared = [conditions(hardware, perturbed=False)[0], *conditions(hardware, perturbed=True)]
    return _tables(hardware, f"{hardware.title}, wrong nominal model", compared, outcomes)[:2]


def complete_prototype(hardware: Hardware, outcomes: Outcomes) -> list[ResultTable]:
    """Median and worst error with every imperfection; no table for hardware without this condition."""
    cells: dict[str, Cell[RivalResult]] = {
        "limit, A/s": "{limit_A_s:g}",
        "law": "{label}",
        "median error, degrees": lambda result: _cell(result, lambda one: _error(hardware, one)),
        "worst error of the seeds, degrees": "{worst_rad:.3f deg}",
        "variation, A/s": "{variation_A_s:.1f}",
    }
    every = sorted(results(hardware, COMPLETE, outcomes), key=_by_limit_and_error)
    return [table(f"{hardware.title} with every imperfection", every, cells, 2)] if every else []


def predictive_control(outcomes: Outcomes) -> list[ResultTable]:
    """Largest error and variation of predictive control, PID and AFSM-ESO on the seeds of the first."""
    compared, limits = (OUR_LAW, "pid"), (max(ELECTRONICS.search.limits), None)
    every: list[tuple[str, RivalResult]] = []
    for own in FILE.runs(outcomes, candidate="predictive control"):
        condition, figures = own["condition"], _medians(ELECTRONICS, own.runs)
        every.append((condition, RivalResult("", "predictive control", None, None, *figures)))
        every += [
            (condition, result)
            for result in results(ELECTRONICS, condition, outcomes, len(own.runs))
            if result.law in compared and result.limit_A_s in limits
        ]
    cells: dict[str, Callable[[tuple[str, RivalResult]], str]] = {
        "condition": lambda row: row[0],
        "law": lambda row: row[1].label,
        "largest error, degrees": lambda row: _cell(row[1], lambda one: f"{np.degrees(one.largest_rad):.3f}"),
        "variation, A/s": lambda row: _cell(row[1], _variation, NONE),
    }
    return [table("Predictive control of the tilt", every, cells, 2)] if every else []


def _by_limit_and_error(result: RivalResult) -> tuple[float, bool, float]:
    limit = np.inf if result.limit_A_s is None else result.limit_A_s
    return limit, result.is_lost, result.largest_rad


def _tables(
    hardware: Hardware, title: str, conditions: Sequence[str], outcomes: Outcomes
) -> list[ResultTable]:
    """A table for each measure: a row for each law, by limit and by the error under the first condition."""
    unit = "degrees" if hardware.in_degrees else "mrad"
    measures: dict[str, Callable[[RivalResult], str]] = {
        f"largest error, {unit}": lambda result: _error(hardware, result),
        "variation of the commands, A/s": _variation,
        f"RMS error of the second half, {unit}": lambda result: _angle(hardware, result.tail_rad),
    }
    by_condition = [results(hardware, condition, outcomes) for condition in conditions]
    by_law = [{(result.limit_A_s, result.label): result for result in of_one} for of_one in by_condition]
    head = ("limit, A/s", "law", *conditions)

    def rows(text: Callable[[RivalResult], str]) -> list[tuple[str, ...]]:
        return [
            (
                "as shipped" if limit is None else f"{limit:g}",
                label,
                *(_cell(of_one.get((limit, label)), text) for of_one in by_law),
            )
            for limit, label in _order(hardware, by_condition[0])
        ]

    return [ResultTable(f"{title}: {name}", head, rows(text), 2) for name, text in measures.items()]


def _order(hardware: Hardware, of_first: Sequence[RivalResult]) -> list[tuple[float | None, str]]:
    """Limits and laws of the rows: tuned laws by their error, those without gains in the limit, presets."""
    order: list[tuple[float | None, str]] = []
    for limit in hardware.search.limits:
        tuned = [result.label for result in within(of_first, limit)]
        others = [law.label for law in BY_LAW.values() if tuned and law.label not in tuned]
        order += [(limit, label) for label in (*tuned, *others)]
    return order + [(None, result.label) for result in of_first if result.limit_A_s is None]


def _cell(result: RivalResult | None, text: Callable[[RivalResult], str], lost: str = "lost") -> str:
    if result is None:
        return NONE
    return lost if result.is_lost else text(result)


def _variation(result: RivalResult) -> str:
    return f"{result.variation_A_s:.1f}"


def _error(hardware: Hardware, result: RivalResult) -> str:
    """Median and its interval; a dash for an end for which the seeds are too few."""
    low, high = (
        _angle(hardware, end) if np.isfinite(end) else NONE for end in (result.low_rad, result.high_rad)
    )
    return f"{_angle(hardware, result.largest_rad)} [{low}, {high}]"


def _angle(hardware: Hardware, value_rad: float) -> str:
    return f"{np.degrees(value_rad):.4f}" if hardware.in_degrees else f"{1e3 * value_rad:.3f}"


def findings(outcomes: Outcomes) -> list[Statement]:
    """Law with the smallest error within each limit, and laws that are level with or better than our own."""
    return [
        Statement(None, f"{hardware.title}, {condition}: {'; '.join(statements)}")
        for hardware in HARDWARE
        for perturbed in (False, True)
        for condition in conditions(hardware, perturbed)
        if (statements := _by_limit(hardware, condition, outcomes))
    ]


def _by_limit(hardware: Hardware, condition: str, outcomes: Outcomes) -> list[str]:
    """Statements on the order of the laws, each with the limits for which it is true."""
    every = results(hardware, condition, outcomes)
    complete = [result for result in every if not result.is_lost]
    # A limit on the cases may leave out our own law, of which nothing is known then.
    tuned = {gains.limit_A_s for gains in hardware.tuned if gains.law == OUR_LAW}
    left_out = tuned - {result.limit_A_s for result in every if result.law == OUR_LAW}
    limits: dict[str, list[str]] = {}
    for limit in hardware.search.limits:
        if limit not in left_out and (ordered := within(complete, limit)):
            limits.setdefault(_comparison(ordered), []).append(f"{limit:g}")
    return [f"within {_listed(texts)} A/s {statement}" for statement, texts in limits.items()]


def _comparison(ordered: Sequence[RivalResult]) -> str:
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


def figure(hardware: Hardware, outcomes: Outcomes) -> Drawing:
    """Error over variation under the conditions with a right nominal model."""
    from spheretwin.viz.figures import fronts

    panels = [
        _panel(hardware, condition, outcomes)
        for condition in conditions(hardware, perturbed=False)
        if results(hardware, condition, outcomes)
    ]
    labels = {name: law.label for name, law in BY_LAW.items()}
    front = fronts.fronts(panels, labels, "variation of the commands, A/s")
    return FILE.drawing(f"{hardware.name}_errors", front)


def _panel(hardware: Hardware, condition: str, outcomes: Outcomes) -> FrontPanel:
    from spheretwin.viz.figures import fronts

    scale = np.degrees(1.0) if hardware.in_degrees else 1e3
    tuned: dict[str, list[tuple[float, float]]] = {}
    presets: dict[str, tuple[str, float, float]] = {}
    for result in results(hardware, condition, outcomes):
        point = result.variation_A_s, float(scale * result.largest_rad)
        if result.is_lost:
            continue
        if result.preset is None:
            tuned.setdefault(result.law, []).append(point)
        else:
            presets[result.preset] = (result.law, *point)
    points = {law: np.array(of_law) for law, of_law in tuned.items()}
    floors = () if hardware.in_degrees else current_limits_rad(condition, outcomes).values()
    unit = "degrees" if hardware.in_degrees else "mrad"
    return fronts.FrontPanel(
        condition, f"largest |error|, {unit}", points, presets, [scale * floor for floor in floors]
    )


def _sections(outcomes: Outcomes) -> list[ExperimentSection]:
    predictive = predictive_control(outcomes)
    return [
        section
        for hardware in HARDWARE
        if FILE.runs(outcomes, setting=hardware.name)
        for section in _of_hardware(hardware, outcomes)
    ] + [FILE.section("predictive_control", [table]) for table in predictive]


def _of_hardware(hardware: Hardware, outcomes: Outcomes) -> list[ExperimentSection]:
    title, search = hardware.title.capitalize(), hardware.search
    method = FILE["method"].format(draws=search.draws, perturbations=search.perturbations)
    largest = errors(hardware, outcomes)
    complete = complete_prototype(hardware, outcomes)
    gains = [ranges(hardware), gains_table(hardware)]
    return [
        FILE.section(f"{hardware.name}_errors", largest, [lambda: figure(hardware, outcomes)], method=method),
        FILE.section("robustness", robustness(hardware, outcomes), title=title),
        *(FILE.section("prototype", [table], title=title) for table in complete),
        FILE.section("gains", gains, title=title),
    ]


EXPERIMENT = FILE.experiment(cases=cases, sections=_sections, reduce=start_error, findings=findings)
