"""Whether figures 6 and 7 came out again: the order of the laws, the sizes, what grows with the load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Array, Finding, Outcome, Outcomes
from spheretwin.twin.reproduce.laws import OF_PAPER, Compared
from spheretwin.twin.reproduce.printed import printed_rad
from spheretwin.twin.reproduce.rows import of_axis
from spheretwin.twin.reproduce.sinusoid.conditions import Condition, Varied, case

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
        told = _told(kept, ratios)
        found.append(Finding(True, f"the printed errors {where} within {100 * SIZE:.0f} %: {told} of them"))
    if other:
        held = all(np.all(ratios[of] < 1) for of in other)
        why = "; the printed gains hold the rotor closer than the paper says" if held else ""
        found.append(Finding(False, f"the printed errors {where}: {_told(other, ratios)} of them{why}"))
    for of in lost:
        told = f"{_told([of], ratios)} of them, but {_how_lost(ran[of])}"
        found.append(Finding(False, f"the printed errors {where}: {told}"))
    return found


def _told(laws: Sequence[Compared], ratios: Mapping[Compared, Array]) -> str:
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
