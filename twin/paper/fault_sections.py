"""Open groups: how many may be open, and what the controller has to know of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.supervision.watchdog import Reason
from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import Outcome, Outcomes, ResultTable, Section
from spheretwin.paper.fault_cases import (
    ALONE,
    BRAKE,
    DETECTING,
    DRAWN,
    HEALTHY_PROTOTYPE,
    NOT_TOLD,
    OF_GROUPS,
    OF_PARTS,
    RELEASE,
    SIZES,
    TOLD,
    Failure,
    Groups,
    Way,
    count,
    failures,
    of_groups,
    of_part,
    pairs,
    random_groups,
    sets,
    singles,
)
from spheretwin.paper.fault_cases import pairs as all_pairs
from spheretwin.paper.fault_outcomes import TWICE, tracks
from spheretwin.paper.rows import ended
from spheretwin.viz.pages.markdown import Drawing

PARTS_METHOD = (
    "The prototype, as nothing else has these parts. There are no groups to leave out, so the ways are"
    " others: *no watchdog*; one that takes the currents away (*release*); one that shorts the coils, which"
    " brakes (*short*). The number is the error ratio as above, with the healthy prototype as"
    " reference, median over the seeds. The window of a run that is"
    " stopped ends there. What is intermittent fails in every other"
    " stretch of 10 ms, by a coin; what is stuck stays where it was."
)
PARTS_HEAD = ("part and mode", *(way.name for way in OF_PARTS), "stopped for", "after the fault, ms")


def parts_section(outcomes: Outcomes) -> Section:
    """How every mode of every part ends in its three ways."""
    ran = [failure for failure in failures() if of_part(failure, ALONE).name in outcomes]
    rows = [_parts_row(outcomes, failure) for failure in ran]
    title = "Failures that start at a drawn time: how the runs ended, and their error ratio"
    return Section(
        "Sensors, supply and controller",
        f"{PARTS_METHOD}{_healthy(outcomes)}{_detection_text(outcomes, ran)}",
        [ResultTable(title, PARTS_HEAD, rows, len(PARTS_HEAD) - 1)],
    )


def _parts_row(outcomes: Outcomes, failure: Failure) -> tuple[str, ...]:
    cells = [_cell(outcomes.get(of_part(failure, way).name, ())) for way in OF_PARTS]
    stopped = _stopped(outcomes.get(of_part(failure, RELEASE).name, ()))
    return failure.name, *cells, *stopped


def _cell(runs: Sequence[Outcome]) -> str:
    return f"{ended(runs)}: {np.median([run.kept.ratio for run in runs]):.3g}" if runs else "not run"


def _stopped(runs: Sequence[Outcome]) -> tuple[str, str]:
    """Why the watchdog stepped in, and when."""
    kept = [run.kept for run in runs if run.kept.stopped is not Reason.NONE]
    if not kept:
        return "–", "–"
    reasons = dict.fromkeys(each.stopped.text for each in kept)
    return "; ".join(reasons), f"{np.median([1e3 * (each.stopped_s - each.start_s) for each in kept]):.0f}"


def _healthy(outcomes: Outcomes) -> str:
    if HEALTHY_PROTOTYPE.name not in outcomes:
        return ""
    errors = [np.degrees(run.kept.after_rad) for run in outcomes[HEALTHY_PROTOTYPE.name]]
    return f" The largest error of the healthy prototype is {np.median(errors):.2f}° (median over the seeds)."


def _detection_text(outcomes: Outcomes, ran: Sequence[Failure]) -> str:
    """What the rotor is lost to without a watchdog, what one sees of it, and what it does not."""
    lost = [failure for failure in ran if not _all_track(outcomes, failure)]
    if not lost:
        return ""
    unseen = [failure.name for failure in lost if not _all_stopped(outcomes, failure)]
    seen = len(lost) - len(unseen)
    text = (
        f"\n\nWithout a watchdog {len(ran) - len(lost)} of {len(ran)} failures leave a rotor that tracks"
        f" under every seed. Of the {len(lost)} others the watchdog stops {seen} under every seed."
    )
    return text + (f" What it does not always see: {', '.join(unseen)}." if unseen else "")


def _all_track(outcomes: Outcomes, failure: Failure) -> bool:
    return all(map(tracks, outcomes[of_part(failure, ALONE).name]))


def _all_stopped(outcomes: Outcomes, failure: Failure) -> bool:
    runs = [run for way in (RELEASE, BRAKE) for run in outcomes.get(of_part(failure, way).name, ())]
    return all(run.status == Status.FAILSAFE for run in runs)


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


def draw_pairs(outcomes: Outcomes) -> Drawing:
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


GROUPS_METHOD = (
    "Coils on ideal hardware, the least-norm allocation with its limit of 8 A unless it says *bounded* (all"
    " that the limit allows). *Not told*: nobody knows. *Told*: the allocation leaves the groups out from the"
    " tick on at which they open. *Detecting*: it leaves out what the detector has found by itself.\n\n"
    "The fault starts at a control tick drawn from the seed, evenly over the whole run; all ways of a set"
    " share it. The *error ratio* is the largest error of any hinge from the start of the fault to the end of"
    " the run, divided by the same error of the healthy run with the same seed, allocation and window. A run"
    f" *tracks* if it completes and its error ratio is at most {TWICE:g}.\n\n"
    f"Every group and every pair runs with every seed; {DRAWN} larger sets, drawn once, run with one each."
)
GROUPS_HEAD = (
    "open groups", "way", "sets", "runs", "completed", "track",
    "error ratio: median", "95 %", "99 %", "largest",
)  # fmt: skip
OUT_OF = 2
BY_START = ("fault starts, s", "way", "runs", "track", "error ratio: median", "95 %", "99 %", "largest")
INTERVALS_s = ((0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0), (4.0, 5.0))
"""Intervals of the run, of 5 s, in which faults start."""


def groups_section(outcomes: Outcomes) -> Section:
    """Shares that complete and track, pairs, and the smallest torque that is left."""
    by_number = [(number, _of_number(number)) for number in (1, 2, *SIZES)]
    rows = [
        row
        for number, listed in by_number
        for way in OF_GROUPS
        if (row := _groups_row(outcomes, number, listed, way))
    ]
    title = "Open groups by their number and way"
    by_start = [
        row for interval in INTERVALS_s for way in OF_GROUPS if (row := _started(outcomes, interval, way))
    ]
    return Section(
        "Open groups",
        f"{GROUPS_METHOD} {_numbers(outcomes)}{_goal(outcomes)}",
        [
            ResultTable(title, GROUPS_HEAD, rows, OUT_OF),
            ResultTable("One or two open groups, by the start of the fault", BY_START, by_start, 2),
        ],
        [lambda: shares(_shares(outcomes)), lambda: draw_pairs(outcomes)] if rows else [],
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
    return pairs() if number == 2 else [groups for groups in random_groups() if len(groups) == number]


def _groups_row(
    outcomes: Outcomes, number: int, listed: Sequence[Groups], way: Way
) -> tuple[str, ...] | None:
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
