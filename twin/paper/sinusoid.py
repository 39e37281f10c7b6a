"""What figures 6 and 7 vary, and the case of each law under each value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import (
    COMPARED,
    OF_PAPER,
    Array,
    Case,
    Compared,
    Experiment,
    Finding,
    Outcome,
    Outcomes,
    ResultTable,
    Section,
)
from spheretwin.paper.rows import ended, figures_named, of_axis, printed_rad, spread, spread_mrad
from spheretwin.viz.pages.markdown import Drawing

SCENARIO = "sinusoid"

ENDS = {"pd": (Status.COMPLETED, Status.LEFT_WORKSPACE)}
"""Of laws that may end otherwise: PD has no integral and sags under load, out of the workspace at last."""


class Condition(NamedTuple):
    """A point of a figure."""

    m: float
    L: float


class Varied(NamedTuple):
    """What one figure varies."""

    figure: str
    symbol: str
    what: str
    conditions: tuple[Condition, ...]

    def value(self, condition: Condition) -> float:
        """Of what is varied."""
        return float(getattr(condition, self.symbol))


FIGURE6 = Varied(
    "figure6", "m", "modelling error m", tuple(Condition(m, 1.0) for m in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5))
)
FIGURE7 = Varied("figure7", "L", "load L", tuple(Condition(0.2, L) for L in (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)))


def cases(varied: Varied) -> list[Case]:
    """Every law under every condition, condition by condition."""
    return [case(compared, condition) for condition in varied.conditions for compared in COMPARED]


def case(compared: Compared, condition: Condition) -> Case:
    """A law under a condition."""
    paper = printed_rad(compared.law, *condition)
    return Case(
        name=f"{compared.law}: m {condition.m:g}, L {condition.L:g}",
        scenario=SCENARIO,
        fields={
            "controller.law": compared.law,
            "plant.modelling_error": condition.m,
            "disturbance.load": condition.L,
        },
        told={"gains": compared.gains, "paper": None if paper is None else list(paper)},
        ends=ENDS.get(compared.law, (Status.COMPLETED,)),
    )


SIZE = 0.25
"""A printed number came out again where the median is no further from it, relative to it."""

NAMES = " > ".join(compared.label for compared in OF_PAPER)


def order(varied: Varied, outcomes: Outcomes) -> list[Finding]:
    """Whether the laws are in the paper's order at every point."""
    points = [at for at in varied.conditions if all(case(of, at).name in outcomes for of in OF_PAPER)]
    if not points:
        return []
    kept, of = 0, 0
    for at in points:
        largest = [[run.max_abs_error for run in outcomes[case(law, at).name]] for law in OF_PAPER]
        for above, below in pairwise(largest):
            count = min(len(above), len(below))
            kept += int(np.sum(np.array(above[:count]) > np.array(below[:count])))
            of += 3 * count
    span = f"{varied.symbol} = {varied.value(points[0]):g} to {varied.value(points[-1]):g}"
    said = "at every point, hinge and seed" if kept == of else f"in {kept} of {of} comparisons"
    return [Finding(kept == of, f"the order {NAMES} over {span} holds {said}")]


def sizes(at: Condition, outcomes: Outcomes) -> list[Finding]:
    """How large the errors are beside those that are printed of a condition, law by law."""
    ran = {
        compared: outcomes[case(compared, at).name]
        for compared in OF_PAPER
        if case(compared, at).name in outcomes and printed_rad(compared.law, *at)
    }
    ratios = {of: _median_rad(runs) / np.array(printed_rad(of.law, *at)) for of, runs in ran.items()}
    near = {of: bool(np.all(np.abs(ratio - 1) <= SIZE)) for of, ratio in ratios.items()}
    where = f"at m = {at.m:g}, L = {at.L:g}"
    kept = [of for of in ran if near[of] and _whole(ran[of])]
    lost = [of for of in ran if not _whole(ran[of])]
    other = [of for of in ran if not near[of] and of not in lost]
    found = []
    if kept:
        told = _ratios_text(kept, ratios)
        found.append(Finding(True, f"the printed errors {where} within {100 * SIZE:.0f} %: {told} of them"))
    if other:
        held = all(np.all(ratios[of] < 1) for of in other)
        why = "; the printed gains hold the rotor closer than the paper says" if held else ""
        found.append(
            Finding(False, f"the printed errors {where}: {_ratios_text(other, ratios)} of them{why}")
        )
    for of in lost:
        told = f"{_ratios_text([of], ratios)} of them, but {_how_lost(ran[of])}"
        found.append(Finding(False, f"the printed errors {where}: {told}"))
    return found


def _ratios_text(laws: Sequence[Compared], ratios: Mapping[Compared, Array]) -> str:
    return ", ".join(f"{of.label} {ratios[of].min():.2f} to {ratios[of].max():.2f} times" for of in laws)


def growth(varied: Varied, outcomes: Outcomes) -> list[Finding]:
    """Whether AFSM's error grows with the load, which the paper closes with."""
    afsm = OF_PAPER[-1]
    points = [at for at in varied.conditions if case(afsm, at).name in outcomes]
    if len(points) < 2:
        return []
    medians = np.array([_median_rad(outcomes[case(afsm, at).name]) for at in points])
    grows = bool(np.all(np.diff(medians, axis=0) > 0))
    largest = 1e3 * medians.max(axis=1)
    said = "grows with the load" if grows else "does not grow with the load throughout"
    return [
        Finding(
            grows,
            f"{afsm.label}'s error {said}, from {largest[0]:.0f} mrad at"
            f" L = {points[0].L:g} to {largest[-1]:.0f} mrad at L = {points[-1].L:g}",
        )
    ]


def _how_lost(runs: Sequence[Outcome]) -> str:
    """How runs that did not come to their end were lost."""
    lost = [run for run in runs if run.status != Status.COMPLETED]
    cut = float(np.median([run.figures["saturated_fraction"] or 0.0 for run in lost]))
    statuses = ", ".join(sorted({str(run.status) for run in lost}))
    return (
        f"{len(lost)} of {len(runs)} runs ended as {statuses}, the current limit cutting the torque at"
        f" {100 * cut:.0f} % of their ticks"
    )


def _median_rad(runs: Sequence[Outcome]) -> Array:
    return np.array([np.median(of_axis(runs, "max_abs_error", axis)) for axis in range(3)])


def _whole(runs: Sequence[Outcome]) -> bool:
    return all(run.status == Status.COMPLETED for run in runs)


LARGEST = ("law", "how it ended", "printed, mrad", "α, mrad", "β, mrad", "γ, mrad", "in degrees")
RMS = (
    "law",
    "α, mrad",
    "β, mrad",
    "γ, mrad",
    "in degrees",
    "second half, mrad",
    "torque, N·m",
    "variation, A/s",
)
NONE = "–"


def tables(varied: Varied, outcomes: Outcomes) -> list[ResultTable]:
    """Largest errors, then RMS errors and effort."""
    ran = [
        (condition, compared, outcomes[case(compared, condition).name])
        for condition in varied.conditions
        for compared in COMPARED
        if case(compared, condition).name in outcomes
    ]
    return [
        ResultTable(
            "Largest |error|: median over the seeds, and range",
            (varied.symbol, *LARGEST),
            [(f"{varied.value(at):g}", *_largest(at, compared, found)) for at, compared, found in ran],
            4,
        ),
        ResultTable(
            "RMS error, and what it costs: RMS torque, and variation of the commands a group and second",
            (varied.symbol, *RMS),
            [(f"{varied.value(at):g}", *rms(compared, found)) for at, compared, found in ran],
            2,
        ),
    ]


def _largest(condition: Condition, compared: Compared, found: Sequence[Outcome]) -> tuple[str, ...]:
    paper = printed_rad(compared.law, *condition)
    printed = NONE if paper is None else " / ".join(f"{1e3 * each:.1f}" for each in paper)
    return compared.label, ended(found), printed, *by_hinge(found, "max_abs_error")


def rms(compared: Compared, found: Sequence[Outcome]) -> tuple[str, ...]:
    """Row of RMS errors and effort."""
    tail = np.median([outcome.tail_rms_error for outcome in found], axis=0)
    return (
        compared.label,
        *by_hinge(found, "rms_error", 2),
        triple(1e3 * tail, 2),
        spread(figures_named(found, "rms_torque_Nm"), 3),
        spread(figures_named(found, "current_variation_A_s"), 1),
    )


def by_hinge(found: Sequence[Outcome], error: str, digits: int = 1) -> tuple[str, ...]:
    """An error of each hinge in mrad, then the medians of all three in degrees."""
    of_hinges = [of_axis(found, error, axis) for axis in range(3)]
    return *(spread_mrad(each, digits) for each in of_hinges), triple(
        np.degrees(np.median(of_hinges, axis=1)), 2
    )


def triple(values: Array, digits: int) -> str:
    """Numbers of α, β and γ."""
    return " / ".join(f"{value:.{digits}f}" if np.isfinite(value) else NONE for value in values)


HOW = (
    "The sinusoid on all three hinges for 10 s, from rest, on ideal hardware: true angles and rates, currents"
    " within ±8 A behind the lag of the coils. The reference starts with a rate, so that every run begins"
    " with an error that no law can avoid. All gains are the laws' own at every point. The paper prints"
    " numbers at m = 0.2, for L = 1 and L = 2 alone; all else of its figure is a curve to be compared by eye."
)


PRINTED_IN = {"figure6": Condition(0.2, 1.0), "figure7": Condition(0.2, 2.0)}
"""Where the paper prints numbers of each figure; the first is a point of the other figure, too."""


def _tell(varied: Varied, outcomes: Outcomes) -> list[Section]:
    return [
        Section(
            f"Errors over the {varied.what}",
            HOW,
            tables(varied, outcomes),
            [lambda: _draw(varied, outcomes)],
        )
    ]


def _findings(varied: Varied, outcomes: Outcomes) -> list[Finding]:
    found = [*order(varied, outcomes), *sizes(PRINTED_IN[varied.figure], outcomes)]
    return [*found, *growth(varied, outcomes)] if varied is FIGURE7 else found


def _draw(varied: Varied, outcomes: Outcomes) -> Drawing:
    from spheretwin.viz.figures import conditions as figures

    by_label = {}
    for compared in COMPARED:
        if not compared.drawn:
            continue
        points = [at for at in varied.conditions if case(compared, at).name in outcomes]
        if not points:
            continue
        runs = [outcomes[case(compared, at).name] for at in points]
        errors = [np.quantile([each.max_abs_error for each in some], [0, 0.5, 1], axis=0) for some in runs]
        by_label[compared.label] = figures.ErrorsByCondition(
            law=compared.law,
            values=np.array([varied.value(at) for at in points]),
            error_rad=np.stack(errors, axis=1),
            whole=np.array([all(each.status == Status.COMPLETED for each in some) for some in runs]),
            paper_rad={varied.value(at): paper for at in points if (paper := printed_rad(compared.law, *at))},
        )
    fixed = "L = 1" if varied is FIGURE6 else "m = 0.2"
    title = f"Figure {varied.figure.removeprefix('figure')}: sinusoid, {fixed}, largest |error|"
    figure = figures.by_condition(by_label, ANGLES, varied.what, "largest |error|", title)
    caption = (
        f"Largest |error| of each hinge over the {varied.what}, {fixed}: median over the seeds, range as"
        " error bars. Wide bars are the numbers that the paper prints, tied to those of the same law; a"
        " hollow marker is of runs that ended early."
    )
    return Drawing(f"{varied.figure}_errors.png", caption, figure)


def _experiment(varied: Varied, shows: str) -> Experiment:
    number = varied.figure.removeprefix("figure")
    return Experiment(
        name=varied.figure,
        title=f"Figure {number}: the sinusoid over the {varied.what}",
        shows=shows,
        cases=partial(cases, varied),
        tell=partial(_tell, varied),
        findings=partial(_findings, varied),
    )


EXPERIMENT_6 = _experiment(
    FIGURE6, "Largest tracking errors with L = 1 and a plant whose inertia is (1 + m) times the nominal one."
)
EXPERIMENT_7 = _experiment(
    FIGURE7, "Largest tracking errors with m = 0.2 and a load torque of L · 0.05 N·m on every hinge."
)
