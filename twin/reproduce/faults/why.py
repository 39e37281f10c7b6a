"""Why some sets do not track: rank, and the torque that is left beside the torque that is needed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.twin.reproduce.experiment import Outcome, Outcomes, Section, Table
from spheretwin.twin.reproduce.faults import drawing
from spheretwin.twin.reproduce.faults.by_groups import found_of
from spheretwin.twin.reproduce.faults.conditions.cases import sets
from spheretwin.twin.reproduce.faults.conditions.sets import Groups
from spheretwin.twin.reproduce.faults.conditions.ways import (
    BOUNDED,
    DETECTING,
    NOT_TOLD,
    OF_GROUPS,
    TOLD,
    Way,
)
from spheretwin.twin.reproduce.faults.found import tracks

HOW = (
    "Along the path of the healthy run, every 10 ms from the fault on: the *rank* and least singular value of"
    " the torque matrix without the open groups; the *torque left over the torque needed*, that is, the"
    " largest torque that any currents within the limit give in the direction of the torque that the healthy"
    " run needed there, over that torque, and the same of least-norm currents; and, for those who are not"
    " told, the *share that comes* of a torque that all groups are asked for, in the worst direction (the"
    " least eigenvalue of G_left G_leftᵀ (G Gᵀ)⁻¹). The least along the path is told."
)
HEAD = (
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


def section(outcomes: Outcomes) -> Section:
    """How well rank and torque tell the sets that track, and the smallest sets that do not."""
    by_way = {way.name: found_of(outcomes, sets(), way) for way in OF_GROUPS}
    figures = [(way, *figure) for way, figure in JUDGED if by_way[way.name]]
    rows = [_row(by_way[way.name], way, name, label) for way, name, label in figures]
    small = [row for way in (TOLD, BOUNDED) for row in _smallest(by_way[way.name], way)]
    points = {way.name: _points(by_way[way.name]) for way in (TOLD, BOUNDED) if by_way[way.name]}
    return Section(
        "Why some sets do not track",
        f"{HOW}{_ranks(by_way)}{_verdict(by_way[TOLD.name], TOLD)}{_verdict(by_way[BOUNDED.name], BOUNDED)}",
        [
            Table("How well one figure tells the sets that track, each with the first seed", HEAD, rows, 2),
            Table(f"The smallest sets that do not track, at most {LISTED} of each way", SMALL, small, 4),
        ],
        [lambda: drawing.torque_left(points)] if points else [],
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


def _row(
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


def _verdict(found: Sequence[tuple[Groups, Sequence[Outcome]]], way: Way) -> str:
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
