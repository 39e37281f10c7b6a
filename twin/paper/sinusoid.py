"""Figures 6 and 7: errors of every law on the sinusoid over the modelling error and over the load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Status
from spheretwin.paper import page
from spheretwin.paper.experiment import Case, Experiment, Finding, Outcome, Outcomes, ResultTable, Section
from spheretwin.paper.laws import COMPARED_LAWS, PAPER_LAWS, ComparedLaw, printed_rad
from spheretwin.viz.pages.markdown import Drawing

Array = NDArray[np.float64]

SCENARIO = "sinusoid"

EXPECTED = {"pd": (Status.COMPLETED, Status.LEFT_WORKSPACE)}
"""Statuses of laws that may end otherwise: PD has no integral and leaves the workspace under load."""


class Condition(NamedTuple):
    """A point of a figure."""

    m: float
    L: float


class Variation(NamedTuple):
    """Quantity that one figure varies."""

    figure: str
    symbol: str
    quantity: str
    conditions: tuple[Condition, ...]
    printed: Condition
    """Condition at which the paper prints numbers."""

    def value(self, condition: Condition) -> float:
        """Value of the quantity under a condition."""
        return float(getattr(condition, self.symbol))


FIGURE6 = Variation(
    "figure6",
    "m",
    "modelling error m",
    tuple(Condition(m, 1.0) for m in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    Condition(0.2, 1.0),
)
FIGURE7 = Variation(
    "figure7",
    "L",
    "load L",
    tuple(Condition(0.2, L) for L in (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)),
    Condition(0.2, 2.0),
)


def cases(variation: Variation) -> list[Case]:
    """Cases of every law under every condition, condition by condition."""
    return [case(law, condition) for condition in variation.conditions for law in COMPARED_LAWS]


def case(law: ComparedLaw, condition: Condition) -> Case:
    """Case of a law under a condition."""
    paper = printed_rad(law.law, *condition)
    return Case(
        name=f"{law.law}: m {condition.m:g}, L {condition.L:g}",
        scenario=SCENARIO,
        fields={
            "controller.law": law.law,
            "plant.modelling_error": condition.m,
            "disturbance.load": condition.L,
        },
        details={"gains": law.gains, "paper": None if paper is None else list(paper)},
        expected_statuses=EXPECTED.get(law.law, (Status.COMPLETED,)),
    )


SIZE = 0.25
"""Largest deviation of a median from a printed number that counts as reproduced, relative to the number."""

NAMES = " > ".join(law.label for law in PAPER_LAWS)


def order(variation: Variation, outcomes: Outcomes) -> list[Finding]:
    """Compare the order of the laws with the paper's at every point."""
    points = [
        point for point in variation.conditions if all(outcomes.runs(case(law, point)) for law in PAPER_LAWS)
    ]
    if not points:
        return []
    right, total = 0, 0
    for point in points:
        largest = [[run.max_abs_error for run in outcomes.runs(case(law, point))] for law in PAPER_LAWS]
        for above, below in pairwise(largest):
            count = min(len(above), len(below))
            right += int(np.sum(np.array(above[:count]) > np.array(below[:count])))
            total += 3 * count
    span = f"{variation.symbol} = {variation.value(points[0]):g} to {variation.value(points[-1]):g}"
    share = "at every point, hinge and seed" if right == total else f"in {right} of {total} comparisons"
    return [Finding(right == total, f"the order {NAMES} over {span} holds {share}")]


def sizes(condition: Condition, outcomes: Outcomes) -> list[Finding]:
    """Compare the errors of each law with the printed ones under a condition."""
    by_law = {law: outcomes.runs(case(law, condition)) for law in PAPER_LAWS}
    by_law = {law: runs for law, runs in by_law.items() if runs and printed_rad(law.law, *condition)}
    ratios = {
        law: _median_rad(runs) / np.array(printed_rad(law.law, *condition)) for law, runs in by_law.items()
    }
    lost = [law for law, runs in by_law.items() if not _all_complete(runs)]
    close = [law for law in by_law if law not in lost and np.all(np.abs(ratios[law] - 1) <= SIZE)]
    other = [law for law in by_law if law not in lost and law not in close]
    where = f"the printed errors at m = {condition.m:g}, L = {condition.L:g}"
    findings = []
    if close:
        findings.append(
            Finding(True, f"{where} within {100 * SIZE:.0f} %: {_ratios_text(close, ratios)} of them")
        )
    if other:
        smaller = all(np.all(ratios[law] < 1) for law in other)
        why = "; the printed gains hold the rotor closer than the paper says" if smaller else ""
        findings.append(Finding(False, f"{where}: {_ratios_text(other, ratios)} of them{why}"))
    for law in lost:
        text = f"{_ratios_text([law], ratios)} of them, but {_loss_text(by_law[law])}"
        findings.append(Finding(False, f"{where}: {text}"))
    return findings


def _ratios_text(laws: Sequence[ComparedLaw], ratios: Mapping[ComparedLaw, Array]) -> str:
    return ", ".join(f"{law.label} {ratios[law].min():.2f} to {ratios[law].max():.2f} times" for law in laws)


def growth(variation: Variation, outcomes: Outcomes) -> list[Finding]:
    """Test if AFSM's error grows with the load, as the paper concludes."""
    afsm = PAPER_LAWS[-1]
    points = [point for point in variation.conditions if outcomes.runs(case(afsm, point))]
    if len(points) < 2:
        return []
    medians = np.array([_median_rad(outcomes.runs(case(afsm, point))) for point in points])
    grows = bool(np.all(np.diff(medians, axis=0) > 0))
    first, last = 1e3 * medians.max(axis=1)[[0, -1]]
    verdict = "grows with the load" if grows else "does not grow with the load throughout"
    return [
        Finding(
            grows,
            f"{afsm.label}'s error {verdict}, from {first:.0f} mrad at L = {points[0].L:g} to {last:.0f} mrad"
            f" at L = {points[-1].L:g}",
        )
    ]


def _loss_text(runs: Sequence[Outcome]) -> str:
    """Describe how runs were lost."""
    lost = [run for run in runs if not run.is_complete]
    saturated = float(np.median([run.figures["saturated_fraction"] or 0.0 for run in lost]))
    statuses = ", ".join(sorted({str(run.status) for run in lost}))
    return (
        f"{len(lost)} of {len(runs)} runs ended as {statuses}, the current limit cutting the torque at"
        f" {100 * saturated:.0f} % of their ticks"
    )


def _median_rad(runs: Sequence[Outcome]) -> Array:
    return np.array([np.median(page.of_axis(runs, "max_abs_error", axis)) for axis in range(3)])


def _all_complete(runs: Sequence[Outcome]) -> bool:
    return all(run.is_complete for run in runs)


LARGEST = ("law", "status", "printed, mrad", "α, mrad", "β, mrad", "γ, mrad", "in degrees")
EFFORT_TITLE = "RMS error, and what it costs: RMS torque, and variation of the commands a group and second"
EFFORT_HEAD = (
    "law", "α, mrad", "β, mrad", "γ, mrad", "in degrees", "second half, mrad", "torque, N·m",
    "variation, A/s",
)  # fmt: skip


def tables(variation: Variation, outcomes: Outcomes) -> list[ResultTable]:
    """Largest errors, then RMS errors and effort."""
    by_point = [
        (point, law, runs)
        for point in variation.conditions
        for law in COMPARED_LAWS
        if (runs := outcomes.runs(case(law, point)))
    ]
    return [
        ResultTable(
            "Largest |error|: median over the seeds, and range",
            (variation.symbol, *LARGEST),
            [(f"{variation.value(point):g}", *_largest(point, law, runs)) for point, law, runs in by_point],
            4,
        ),
        ResultTable(
            EFFORT_TITLE,
            (variation.symbol, *EFFORT_HEAD),
            [(f"{variation.value(point):g}", *effort(law, runs)) for point, law, runs in by_point],
            2,
        ),
    ]


def _largest(condition: Condition, law: ComparedLaw, runs: Sequence[Outcome]) -> tuple[str, ...]:
    paper = printed_rad(law.law, *condition)
    printed = page.NONE if paper is None else " / ".join(f"{1e3 * error:.1f}" for error in paper)
    return law.label, page.statuses_text(runs), printed, *by_hinge(runs, "max_abs_error")


def effort(law: ComparedLaw, runs: Sequence[Outcome]) -> tuple[str, ...]:
    """Row of RMS errors and effort."""
    tail = np.median([run.tail_rms_error for run in runs], axis=0)
    return (
        law.label,
        *by_hinge(runs, "rms_error", 2),
        triple(1e3 * tail, 2),
        page.spread(page.figures_named(runs, "rms_torque_Nm"), 3),
        page.spread(page.figures_named(runs, "current_variation_A_s"), 1),
    )


def by_hinge(runs: Sequence[Outcome], error: str, digits: int = 1) -> tuple[str, ...]:
    """An error of each hinge in mrad, then the medians of all three in degrees."""
    errors = [page.of_axis(runs, error, axis) for axis in range(3)]
    medians = triple(np.degrees(np.median(errors, axis=1)), 2)
    return *(page.spread_mrad(of_hinge, digits) for of_hinge in errors), medians


def triple(values: Array, digits: int) -> str:
    """Numbers of α, β and γ."""
    return " / ".join(f"{value:.{digits}f}" if np.isfinite(value) else page.NONE for value in values)


METHOD = (
    "The sinusoid on all three hinges for 10 s, from rest, on ideal hardware: true angles and rates, currents"
    " within ±8 A behind the lag of the coils. The reference starts with a rate, so that every run begins"
    " with an error that no law can avoid. All gains are the laws' own at every point. The paper prints"
    " numbers at m = 0.2, for L = 1 and L = 2 alone; all else of its figure is a curve to be compared by eye."
)


def _sections(variation: Variation, outcomes: Outcomes) -> list[Section]:
    title = f"Errors over the {variation.quantity}"
    return [Section(title, METHOD, tables(variation, outcomes), [lambda: _draw(variation, outcomes)])]


def _findings(variation: Variation, outcomes: Outcomes) -> list[Finding]:
    findings = [*order(variation, outcomes), *sizes(variation.printed, outcomes)]
    return [*findings, *growth(variation, outcomes)] if variation is FIGURE7 else findings


def _draw(variation: Variation, outcomes: Outcomes) -> Drawing:
    from spheretwin.viz.figures import conditions as figures

    by_label = {}
    for law in filter(lambda law: law.in_figures, COMPARED_LAWS):
        by_point = {point: outcomes.runs(case(law, point)) for point in variation.conditions}
        by_point = {point: runs for point, runs in by_point.items() if runs}
        if not by_point:
            continue
        errors = [
            np.quantile([run.max_abs_error for run in runs], [0, 0.5, 1], axis=0)
            for runs in by_point.values()
        ]
        by_label[law.label] = figures.ErrorsByCondition(
            law=law.law,
            values=np.array([variation.value(point) for point in by_point]),
            error_rad=np.stack(errors, axis=1),
            whole=np.array([_all_complete(runs) for runs in by_point.values()]),
            paper_rad={
                variation.value(point): paper for point in by_point if (paper := printed_rad(law.law, *point))
            },
        )
    fixed = "L = 1" if variation is FIGURE6 else "m = 0.2"
    title = f"Figure {variation.figure.removeprefix('figure')}: sinusoid, {fixed}, largest |error|"
    figure = figures.by_condition(by_label, ANGLES, variation.quantity, "largest |error|", title)
    caption = (
        f"Largest |error| of each hinge over the {variation.quantity}, {fixed}: median over the seeds, range"
        " as error bars. Wide bars are the numbers that the paper prints, tied to those of the same law; a"
        " hollow marker is of runs that ended early."
    )
    return Drawing(f"{variation.figure}_errors.svg", caption, figure)


def _experiment(variation: Variation, summary: str) -> Experiment:
    number = variation.figure.removeprefix("figure")
    return Experiment(
        name=variation.figure,
        title=f"Figure {number}: the sinusoid over the {variation.quantity}",
        summary=summary,
        cases=partial(cases, variation),
        sections=partial(_sections, variation),
        findings=partial(_findings, variation),
    )


EXPERIMENT_6 = _experiment(
    FIGURE6, "Largest tracking errors with L = 1 and a plant whose inertia is (1 + m) times the nominal one."
)
EXPERIMENT_7 = _experiment(
    FIGURE7, "Largest tracking errors with m = 0.2 and a load torque of L · 0.05 N·m on every hinge."
)
