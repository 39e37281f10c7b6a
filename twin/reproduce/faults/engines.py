"""A sample of the sets on MuJoCo: the equations of motion, which the study runs by, agree."""

from __future__ import annotations

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Outcome, Outcomes, Section, Table
from spheretwin.twin.reproduce.faults.conditions.cases import SAMPLE, of_groups, on_other_engine, sample
from spheretwin.twin.reproduce.faults.conditions.ways import OF_GROUPS, Way
from spheretwin.twin.reproduce.faults.found import tracks

BOUND_rad = 1e-9
"""Largest errors of the two engines differ by no more in runs that track: 10,000 steps round otherwise, and a
closed loop holds the difference small."""

HEAD = (
    "way",
    "sets",
    "ended alike",
    "track alike",
    "apart where they track, rad",
    "where they complete, rad",
)


def section(outcomes: Outcomes) -> Section:
    """How far the engines are apart."""
    rows = [row for way in OF_GROUPS if (row := _row(outcomes, way))]
    text = (
        f"The study runs by the equations of motion, the faster engine. One set in {SAMPLE} runs on MuJoCo"
        " too, with the first seed. The largest errors of runs that track are to agree within"
        f" {BOUND_rad:g} rad; of others, that they end alike is all that is asked."
    )
    title = "Largest error of each hinge on the two engines"
    return Section("The other engine", text + _verdict(outcomes), [Table(title, HEAD, rows)])


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


def _verdict(outcomes: Outcomes) -> str:
    both = [pair for way in OF_GROUPS for pair in compared(outcomes, way)]
    if not both:
        return ""
    return f" {sum(agree(*pair) for pair in both)} of {len(both)} do."


def _row(outcomes: Outcomes, way: Way) -> tuple[str, ...] | None:
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
