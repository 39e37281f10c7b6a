"""Open groups: how many may be open, and what the controller has to know of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Outcome, Outcomes, Section, Table
from spheretwin.twin.reproduce.faults import drawing
from spheretwin.twin.reproduce.faults.conditions.cases import of_groups, sets
from spheretwin.twin.reproduce.faults.conditions.sets import DRAWN, SIZES, Groups, drawn, pairs, singles
from spheretwin.twin.reproduce.faults.conditions.ways import DETECTING, NOT_TOLD, OF_GROUPS, TOLD, Way
from spheretwin.twin.reproduce.faults.found import TWICE, tracks

HOW = (
    "Coils on ideal hardware, the least-norm allocation with its limit of 8 A unless it says *bounded* (all"
    " that the limit allows). *Not told*: nobody knows. *Told*: the allocation leaves the groups out from the"
    " tick on at which they open. *Detecting*: it leaves out what the detector has found by itself.\n\n"
    "The fault starts at a control tick drawn from the seed, evenly over the whole run; all ways of a set"
    " share it. The *error ratio* is the largest error of any hinge from the start of the fault to the end of"
    " the run, divided by the same error of the healthy run with the same seed, allocation and window. A run"
    f" *tracks* if it completes and its error ratio is at most {TWICE:g}.\n\n"
    f"Every group and every pair runs with every seed; {DRAWN} larger sets, drawn once, run with one each."
)
HEAD = (
    "open groups", "way", "sets", "runs", "completed", "track",
    "error ratio: median", "95 %", "99 %", "largest",
)  # fmt: skip
OUT_OF = 2
BY_START = ("fault starts, s", "way", "runs", "track", "error ratio: median", "95 %", "99 %", "largest")
INTERVALS_s = ((0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0), (4.0, 5.0))
"""Intervals of the run, of 5 s, in which faults start."""


def section(outcomes: Outcomes) -> Section:
    """Shares that complete and track, pairs, and the smallest torque that is left."""
    by_number = [(number, _of_number(number)) for number in (1, 2, *SIZES)]
    rows = [
        row
        for number, listed in by_number
        for way in OF_GROUPS
        if (row := _row(outcomes, number, listed, way))
    ]
    title = "Open groups by their number and way"
    by_start = [
        row for interval in INTERVALS_s for way in OF_GROUPS if (row := _started(outcomes, interval, way))
    ]
    return Section(
        "Open groups",
        f"{HOW} {_numbers(outcomes)}{_goal(outcomes)}",
        [
            Table(title, HEAD, rows, OUT_OF),
            Table("One or two open groups, by the start of the fault", BY_START, by_start, 2),
        ],
        [lambda: drawing.shares(_shares(outcomes)), lambda: drawing.pairs(outcomes)] if rows else [],
    )


def found_of(
    outcomes: Outcomes, listed: Sequence[Groups], way: Way
) -> list[tuple[Groups, Sequence[Outcome]]]:
    """Sets that were run in a way, each with its outcomes."""
    named = [(groups, of_groups(groups, way).name) for groups in listed]
    return [(groups, outcomes[name]) for groups, name in named if name in outcomes]


def _of_number(number: int) -> Sequence[Groups]:
    if number == 1:
        return singles()
    return pairs() if number == 2 else [groups for groups in drawn() if len(groups) == number]


def _row(outcomes: Outcomes, number: int, listed: Sequence[Groups], way: Way) -> tuple[str, ...] | None:
    found = found_of(outcomes, listed, way)
    runs = [outcome for _, each in found for outcome in each]
    if not runs:
        return None
    completed = [run.status == Status.COMPLETED for run in runs]
    return (str(number), way.name, str(len(found)), str(len(runs)), percent(completed), *_tracking(runs))


def _started(outcomes: Outcomes, interval_s: tuple[float, float], way: Way) -> tuple[str, ...] | None:
    """Row of the faults of one or two groups that start in an interval."""
    first, end = interval_s
    runs = [run for run in few(outcomes, way) if first <= run.kept.start_s < end]
    return (f"{first:g} to {end:g}", way.name, str(len(runs)), *_tracking(runs)) if runs else None


def _tracking(runs: Sequence[Outcome]) -> tuple[str, ...]:
    """Return the share that tracks, and quantiles of the error ratio."""
    ratios = np.quantile([run.kept.ratio for run in runs], [0.5, 0.95, 0.99, 1.0])
    return percent([tracks(run) for run in runs]), *(f"{ratio:.2f}" for ratio in ratios)


def few(outcomes: Outcomes, way: Way) -> list[Outcome]:
    """Return the runs with one or two open groups in a way."""
    return [run for _, runs in found_of(outcomes, [*singles(), *pairs()], way) for run in runs]


def percent(true: Sequence[bool]) -> str:
    """Share, in full only where it is whole."""
    share = 100 * sum(true) / len(true)
    return f"{share:.0f} %" if share in (0, 100) else f"{np.clip(share, 0.1, 99.9):.1f} %"


def _numbers(outcomes: Outcomes) -> str:
    """Whether all runs of the study ended as runs should, whatever failed."""
    runs = [run for each in outcomes.values() for run in each]
    broken = sum(not run.kept.numbers or run.status == Status.DIVERGED for run in runs)
    wrongly = sum(run.kept.wrongly_found for run in runs)
    ended = "each" if not broken else f"all but {broken}"
    return (
        f"Of the {len(runs)} runs of the whole study, {ended} ended with a status and with nothing but"
        f" numbers in its telemetry. The detector took {wrongly or 'no'} groups that work for open ones."
    )


def _goal(outcomes: Outcomes) -> str:
    """Whether every single group and every pair may be open."""
    told = []
    for way in (TOLD, DETECTING, NOT_TOLD):
        runs = few(outcomes, way)
        if runs:
            ratios = [run.kept.ratio for run in runs]
            told.append(
                f"{way.name}, {sum(map(tracks, runs))} of {len(runs)} runs track, with a median error ratio"
                f" of {np.median(ratios):.2f} and at most {max(ratios):.2f}"
            )
    return f" With one or two groups open: {'; '.join(told)}." if told else ""


def _shares(outcomes: Outcomes) -> dict[str, dict[int, float]]:
    """By way and number of open groups, share of the runs that track."""
    return {way.name: _share_by_number(found_of(outcomes, sets(), way)) for way in OF_GROUPS}


def _share_by_number(found: Sequence[tuple[Groups, Sequence[Outcome]]]) -> dict[int, float]:
    tracked: dict[int, list[bool]] = {}
    for groups, runs in found:
        tracked.setdefault(len(groups), []).extend(tracks(run) for run in runs)
    return {number: float(np.mean(tracked[number])) for number in sorted(tracked)}
