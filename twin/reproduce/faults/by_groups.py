"""Open groups: how many may be open, and what the controller has to know of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Outcome, Outcomes, Section, Table
from spheretwin.twin.reproduce.faults import drawing
from spheretwin.twin.reproduce.faults.conditions.cases import FAULT_s, of_groups, sets
from spheretwin.twin.reproduce.faults.conditions.sets import DRAWN, SIZES, Groups, drawn, pairs, singles
from spheretwin.twin.reproduce.faults.conditions.ways import DETECTING, OF_GROUPS, TOLD, Way
from spheretwin.twin.reproduce.faults.found import TWICE, tracks

HOW = (
    "Coils on ideal hardware, the least-norm allocation with its limit of 8 A unless it says *bounded* (all"
    " that the limit allows). *Not told*: nobody knows. *Told*: the allocation leaves the groups out from the"
    " tick on at which they open. *Detecting*: it leaves out what the detector has found by itself.\n\n"
    f"A run *tracks* where it completes and its largest error of any hinge after the fault, at {FAULT_s:g} s,"
    f" is at most {TWICE:g} times that of the healthy run of the same seed. The fault is not at the start:"
    " there the rotor is at rest and the reference is not, and that first error, larger than all that"
    " follow, would hide what the fault does. The column *whole run* has it in; bounded currents make less of"
    " it, with or without a fault.\n\n"
    f"Every group and every pair runs with every seed; {DRAWN} larger sets, drawn once, run with one each."
)
HEAD = (
    "open groups", "way", "sets", "runs", "completed", "track",
    "error / healthy: median", "largest", "whole run: largest",
    "found after, ms: median", "longest", "not found",
)  # fmt: skip
OUT_OF = 2


def section(outcomes: Outcomes) -> Section:
    """Shares that complete and track, pairs, and the smallest torque that is left."""
    by_number = [(number, _of_number(number)) for number in (1, 2, *SIZES)]
    rows = [
        row
        for number, listed in by_number
        for way in OF_GROUPS
        if (row := _row(outcomes, number, listed, way))
    ]
    title = "Open groups by their number and way; errors of any hinge over those of the healthy run"
    return Section(
        "Open groups",
        f"{HOW} {_numbers(outcomes)}{_goal(outcomes)}",
        [Table(title, HEAD, rows, OUT_OF)],
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
    after, whole = ([getattr(run.kept, name) for run in runs] for name in ("after", "whole"))
    completed = [run.status == Status.COMPLETED for run in runs]
    return (
        str(number), way.name, str(len(found)), str(len(runs)),
        percent(completed), percent([tracks(run) for run in runs]),
        f"{np.median(after):.2f}", f"{max(after):.2f}", f"{max(whole):.2f}", *_delays(runs, way),
    )  # fmt: skip


def _delays(runs: Sequence[Outcome], way: Way) -> tuple[str, str, str]:
    """How soon open groups were found: median and longest, ms, and how many were not."""
    if way is not DETECTING:
        return "–", "–", "–"
    times = [time_s for run in runs for time_s in run.kept.found_s]
    known = [1e3 * time_s for time_s in times if time_s is not None]
    if not known:
        return "–", "–", str(len(times))
    return f"{np.median(known):.0f}", f"{max(known):.0f}", str(len(times) - len(known))


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
    for way in (TOLD, DETECTING):
        runs = [run for _, each in found_of(outcomes, [*singles(), *pairs()], way) for run in each]
        if runs:
            count = sum(map(tracks, runs))
            worst = max(run.kept.after for run in runs)
            told.append(f"{way.name}, {count} of {len(runs)} runs track, the worst with {worst:.2f}")
    return f" With one or two groups open: {'; '.join(told)} times the healthy error." if told else ""


def _shares(outcomes: Outcomes) -> dict[str, dict[int, float]]:
    """By way and number of open groups, share of the runs that track."""
    return {way.name: _share_by_number(found_of(outcomes, sets(), way)) for way in OF_GROUPS}


def _share_by_number(found: Sequence[tuple[Groups, Sequence[Outcome]]]) -> dict[int, float]:
    tracked: dict[int, list[bool]] = {}
    for groups, runs in found:
        tracked.setdefault(len(groups), []).extend(tracks(run) for run in runs)
    return {number: float(np.mean(tracked[number])) for number in sorted(tracked)}
