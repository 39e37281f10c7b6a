"""The nutation with parts that fail in mid-flight, and what controller, detector and watchdog make of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.paper import fault_latency, fault_sections
from spheretwin.paper.experiment import Experiment, Finding, Outcome, Outcomes, ResultTable, Section
from spheretwin.paper.fault_cases import (
    BOUNDED,
    DETECTING,
    NOT_TOLD,
    OF_GROUPS,
    SAMPLE,
    TOLD,
    Groups,
    Way,
    cases,
    of_groups,
    on_other_engine,
    sample,
    sets,
)
from spheretwin.paper.fault_outcomes import keep, more, tracks
from spheretwin.paper.fault_sections import few, found_of

HOW = (
    "Along the path of the healthy run, every 10 ms from the fault on: the *rank* and least singular value of"
    " the torque matrix without the open groups; the *torque left over the torque needed*, that is, the"
    " largest torque that any currents within the limit give in the direction of the torque that the healthy"
    " run needed there, over that torque, and the same of least-norm currents; and, for those who are not"
    " told, the *share that comes* of a torque that all groups are asked for, in the worst direction (the"
    " least eigenvalue of G_left G_leftᵀ (G Gᵀ)⁻¹). The least along the path is told."
)
CAUSES_HEAD = (
    "way",
    "figure",
    "sets",
    "do not track",
    "track: least",
    "do not: largest",
    "apart at",
    "told rightly",
)
SMALL = (
    "open groups", "way", "seeds that do not track", "how the worst ended", "error ratio",
    "rank", "least singular value, N·m/A", "torque left / needed", "by least norm",
)  # fmt: skip
JUDGED = (
    (TOLD, ("torque", "torque left / needed")),
    (TOLD, ("least_norm", "the same by least norm")),
    (DETECTING, ("torque", "torque left / needed")),
    (DETECTING, ("least_norm", "the same by least norm")),
    (BOUNDED, ("torque", "torque left / needed")),
    (NOT_TOLD, ("comes", "share that comes")),
)
"""Figures that may tell which runs of a way track."""

LISTED = 10
"""Sets of each way in the table of the smallest."""


class Split(NamedTuple):
    """How well a figure tells the runs that track from those that do not."""

    at: float
    rightly: float
    """Share of the runs that it tells rightly."""


def causes_section(outcomes: Outcomes) -> Section:
    """How well rank and torque tell the sets that track, and the smallest sets that do not."""
    by_way = {way.name: found_of(outcomes, sets(), way) for way in OF_GROUPS}
    figures = [(way, *figure) for way, figure in JUDGED if by_way[way.name]]
    rows = [_causes_row(by_way[way.name], way, name, label) for way, name, label in figures]
    small = [row for way in (TOLD, BOUNDED) for row in _smallest(by_way[way.name], way)]
    points = {way.name: _points(by_way[way.name]) for way in (TOLD, BOUNDED) if by_way[way.name]}
    return Section(
        "Why some sets do not track",
        f"{HOW}{_ranks(by_way)}"
        f"{_causes_verdict(by_way[TOLD.name], TOLD)}{_causes_verdict(by_way[BOUNDED.name], BOUNDED)}",
        [
            ResultTable(
                "How well one figure tells the sets that track, each with the first seed",
                CAUSES_HEAD,
                rows,
                2,
            ),
            ResultTable(
                f"The smallest sets that do not track, at most {LISTED} of each way", SMALL, small, 4
            ),
        ],
        [lambda: fault_sections.torque_left(points)] if points else [],
    )


def split(good: Sequence[float], bad: Sequence[float]) -> Split:
    """The figure that parts the good, above it, from the bad with the fewest errors."""
    values = np.concatenate([good, bad])
    order = np.argsort(values, kind="stable")
    is_good = (np.arange(len(values)) < len(good))[order]
    # With the i lowest called bad: the bad among them are told rightly, and the good beyond.
    bad_below = np.concatenate([[0], np.cumsum(~is_good)])
    good_below = np.concatenate([[0], np.cumsum(is_good)])
    rightly = bad_below + len(good) - good_below
    best = int(np.argmax(rightly))
    beside = values[order][[max(best - 1, 0), min(best, len(values) - 1)]]
    return Split(float(beside.mean()), float(rightly[best] / len(values)))


def _causes_row(
    found: Sequence[tuple[Groups, Sequence[Outcome]]], way: Way, figure: str, label: str
) -> tuple[str, ...]:
    good, bad = _parted([(groups, runs[:1]) for groups, runs in found], figure)
    best = split(good, bad)
    return (
        way.name, label, str(len(good) + len(bad)), str(len(bad)),
        f"{min(good):.3f}" if good else "–", f"{max(bad):.3f}" if bad else "–",
        f"{best.at:.3f}" if good and bad else "–", f"{100 * best.rightly:.1f} %" if good and bad else "–",
    )  # fmt: skip


def _parted(
    found: Sequence[tuple[Groups, Sequence[Outcome]]], figure: str
) -> tuple[list[float], list[float]]:
    """A figure of what is left, of the runs that track and of those that do not."""
    good: list[float] = []
    bad: list[float] = []
    for _, runs in found:
        for run in runs:
            (good if tracks(run) else bad).append(getattr(run.kept.left, figure))
    return good, bad


def _ranks(by_way: dict[str, list[tuple[Groups, Sequence[Outcome]]]]) -> str:
    """Whether any set has lost a direction."""
    lost = {
        groups
        for found in by_way.values()
        for groups, runs in found
        if any(r.kept.left.rank < 3 for r in runs)
    }
    some = {groups for found in by_way.values() for groups, _ in found}
    if not some:
        return ""
    if not lost:
        return f"\n\nAll {len(some)} sets keep rank 3 along the whole path."
    return f"\n\n{len(lost)} of {len(some)} sets lose a direction on the path."


def _causes_verdict(found: Sequence[tuple[Groups, Sequence[Outcome]]], way: Way) -> str:
    """Whether enough torque left is enough."""
    good, bad = _parted(found, "torque")
    if not good:
        return ""
    enough = [value >= 1 for value in good].count(True)
    enough_bad = [value >= 1 for value in bad].count(True)
    less, less_bad = len(good) - enough, len(bad) - enough_bad
    return (
        f" {way.name.capitalize()}: where at least the torque needed is left, {enough} of"
        f" {enough + enough_bad} runs track; where less is, {less} of {less + less_bad}."
    )


def _smallest(found: Sequence[tuple[Groups, Sequence[Outcome]]], way: Way) -> list[tuple[str, ...]]:
    failing = [(groups, runs) for groups, runs in found if not all(map(tracks, runs))]
    failing.sort(key=lambda each: (len(each[0]), min(run.kept.left.torque for run in each[1]), each[0]))
    return [_listed(groups, runs, way) for groups, runs in failing[:LISTED]]


def _listed(groups: Groups, runs: Sequence[Outcome], way: Way) -> tuple[str, ...]:
    bad = [run for run in runs if not tracks(run)]
    worst = max(bad, key=lambda run: run.kept.ratio)
    left = worst.kept.left
    return (
        " ".join(map(str, groups)), way.name, f"{len(bad)} of {len(runs)}", str(worst.status),
        f"{worst.kept.ratio:.2f}", str(left.rank), f"{left.singular_value_Nm_per_A:.4f}",
        f"{left.torque:.2f}", f"{left.least_norm:.2f}",
    )  # fmt: skip


def _points(found: Sequence[tuple[Groups, Sequence[Outcome]]]) -> list[tuple[float, float, int]]:
    """Torque left, error over the healthy one, and number of open groups, of each run."""
    return [(run.kept.left.torque, run.kept.ratio, len(groups)) for groups, runs in found for run in runs]


BOUND_rad = 1e-9
"""Largest errors of the two engines differ by no more in runs that track: 10,000 steps round otherwise, and a
closed loop holds the difference small."""

ENGINES_HEAD = (
    "way",
    "sets",
    "ended alike",
    "track alike",
    "apart where they track, rad",
    "where they complete, rad",
)


def engines_section(outcomes: Outcomes) -> Section:
    """How far the engines are apart."""
    rows = [row for way in OF_GROUPS if (row := _engines_row(outcomes, way))]
    text = (
        f"The study runs by the equations of motion, the faster engine. One set in {SAMPLE} runs on MuJoCo"
        " too, with the first seed. The largest errors of runs that track are to agree within"
        f" {BOUND_rad:g} rad; of others, that they end alike is all that is asked."
    )
    title = "Largest error of each hinge on the two engines"
    return Section(
        "The other engine", text + _engines_verdict(outcomes), [ResultTable(title, ENGINES_HEAD, rows)]
    )


def agree(one: Outcome, other: Outcome) -> bool:
    """Whether two runs ended alike, and close where they track."""
    same = one.status == other.status and tracks(one) == tracks(other)
    return same and (not tracks(one) or difference_rad(one, other) <= BOUND_rad)


def difference_rad(one: Outcome, other: Outcome) -> float:
    """Between the largest errors of any hinge, of the whole run or after the fault."""
    whole = np.abs(one.max_abs_error - other.max_abs_error).max()
    return float(max(whole, abs(one.kept.after_rad - other.kept.after_rad)))


def compared(outcomes: Outcomes, way: Way) -> list[tuple[Outcome, Outcome]]:
    """Runs of the sample on both engines, with the first seed."""
    names = [(of_groups(groups, way).name, on_other_engine(groups, way).name) for groups in sample()]
    return [
        (outcomes[one][0], outcomes[other][0])
        for one, other in names
        if one in outcomes and other in outcomes
    ]


def _engines_verdict(outcomes: Outcomes) -> str:
    both = [pair for way in OF_GROUPS for pair in compared(outcomes, way)]
    if not both:
        return ""
    return f" {sum(agree(*pair) for pair in both)} of {len(both)} do."


def _engines_row(outcomes: Outcomes, way: Way) -> tuple[str, ...] | None:
    both = compared(outcomes, way)
    if not both:
        return None
    alike = [one.status == other.status for one, other in both]
    tracked = [tracks(one) == tracks(other) for one, other in both]
    whole = [pair for pair in both if all(run.status == Status.COMPLETED for run in pair)]
    close = [pair for pair in both if all(map(tracks, pair))]
    apart = [
        f"{max(difference_rad(*pair) for pair in pairs):.1e}" if pairs else "–" for pairs in (close, whole)
    ]
    return way.name, str(len(both)), str(sum(alike)), str(sum(tracked)), *apart


def tell(outcomes: Outcomes) -> list[Section]:
    """Open groups, detection, why some sets do not track, all other parts, and the other engine."""
    return [
        fault_sections.groups_section(outcomes),
        fault_latency.section(outcomes),
        causes_section(outcomes),
        fault_sections.parts_section(outcomes),
        engines_section(outcomes),
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """How many of the runs with one or two open groups track, for each way to meet them."""
    told = []
    for way in OF_GROUPS:
        runs = few(outcomes, way)
        if runs:
            told.append(f"{way.name} {[tracks(run) for run in runs].count(True)} of {len(runs)}")
    return [Finding(None, f"runs that track with one or two groups open: {', '.join(told)}")] if told else []


EXPERIMENT = Experiment(
    name="faults",
    title="Parts that fail in mid-flight",
    shows="The nutation (59) under AFSM with m = 0.2 and L = 1; from a time on that is drawn over the whole"
    " run, coil groups are open, or a sensor, the supply or the controller fails.",
    cases=cases,
    tell=tell,
    keep=keep,
    more=more,
    findings=findings,
)
