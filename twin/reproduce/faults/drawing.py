"""Figures of the fault study's page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spheretwin.twin.reproduce.experiment import Outcomes
from spheretwin.twin.reproduce.faults.conditions.cases import of_groups
from spheretwin.twin.reproduce.faults.conditions.sets import count, singles
from spheretwin.twin.reproduce.faults.conditions.sets import pairs as all_pairs
from spheretwin.twin.reproduce.faults.conditions.ways import DETECTING, NOT_TOLD, TOLD, Way
from spheretwin.twin.reproduce.faults.found import TWICE
from spheretwin.viz.figures.drawing import Drawing

ERROR = "error ratio"


def shares(by_way: Mapping[str, Mapping[int, float]]) -> Drawing:
    """Share of the runs that track, by the number of open groups."""
    from spheretwin.viz.figures import faults as figures

    figure = figures.shares(by_way, "open groups", "runs that track, %", "How many groups may be open")
    caption = (
        f"Share of the runs that complete and err at most {TWICE:g} times as much as the healthy run"
        " after the fault, by the number of open groups."
    )
    return Drawing("faults_shares.png", caption, figure)


def pairs(outcomes: Outcomes) -> Drawing:
    """Error of every pair, and of every single group on the diagonal."""
    from spheretwin.viz.figures import faults as figures

    panels = {way.name: ratios(outcomes, way) for way in (NOT_TOLD, TOLD, DETECTING)}
    figure = figures.triangles(panels, "open group", ERROR, TWICE, "Every pair of groups open")
    caption = (
        "Largest error of any hinge after the fault over that of the healthy run over the same window, median"
        f" over the seeds; on the diagonal a single group. A cross: more than {TWICE:g}."
    )
    return Drawing("faults_pairs.png", caption, figure)


def ratios(outcomes: Outcomes, way: Way) -> NDArray[np.float64]:
    """(groups, groups) median error of a way over the healthy one; none above the diagonal, or not run."""
    found = np.full((count(), count()), np.nan)
    for groups in (*singles(), *all_pairs()):
        runs = outcomes.get(of_groups(groups, way).name, ())
        if runs:
            found[groups[-1], groups[0]] = np.median([run.kept.ratio for run in runs])
    return found


def latencies(by_kind: Mapping[str, Sequence[float]]) -> Drawing:
    """Share of the faults that are not detected yet, over the time since the fault."""
    from spheretwin.viz.figures import faults as figures

    figure = figures.remaining(
        by_kind, "time since the fault, s", "faults not detected yet, %", "Detection latency"
    )
    caption = (
        "Share of the faults that are not detected yet. What remains at the right is not detected in the run."
    )
    return Drawing("faults_latency.png", caption, figure)


def torque_left(points: Mapping[str, Sequence[tuple[float, float, int]]]) -> Drawing:
    """Error of every set over the torque that is left."""
    from spheretwin.viz.figures import faults as figures

    figure = figures.clouds(
        points,
        ("torque left / torque needed, least along the path", ERROR, "open groups"),
        (1.0, TWICE),
        "What is left decides",
    )
    caption = (
        "Every run of the open groups: its error against the least share of the needed torque that the groups"
        f" left can give. Dashed: as much as is needed, and {TWICE:g} times the healthy error."
    )
    return Drawing("faults_torque.png", caption, figure)
