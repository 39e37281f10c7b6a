"""Sections of the fault study on open groups and on failures of sensors, supply and controller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.supervision.watchdog import Reason
from spheretwin.models.telemetry.status import Status
from spheretwin.paper import fault_cases as cases
from spheretwin.paper.experiment import Outcome, Outcomes, ResultTable, Section
from spheretwin.paper.fault_outcomes import TWICE, tracks
from spheretwin.paper.page import statuses_text
from spheretwin.study.statistics import quantile_text
from spheretwin.viz.pages.markdown import Drawing

PARTS_METHOD = (
    "Hardware set `electronics`, as ideal hardware has none of these parts. There are no groups to leave out,"
    " so the ways are others: *no watchdog*; one that takes the currents away (*release*); one that shorts"
    " the coils, which brakes (*short*). The number is the error ratio as above, with the healthy electronics"
    " as reference, median over the seeds. The window of a run that is stopped ends there. What is"
    " intermittent fails in every other stretch of 10 ms, by a coin; what is stuck stays where it was."
)
PARTS_HEAD = ("part and mode", *(way.name for way in cases.OF_PARTS), "stopped for", "after the fault, ms")


def parts_section(outcomes: Outcomes) -> Section:
    """Result of every mode of every part in its three ways."""
    failures = [failure for failure in cases.failures() if outcomes.runs(cases.of_part(failure, cases.ALONE))]
    rows = [_parts_row(outcomes, failure) for failure in failures]
    title = "Failures that start at a random time: status of the runs, and their error ratio"
    return Section(
        "Sensors, supply and controller",
        f"{PARTS_METHOD}{_healthy(outcomes)}{_watchdog_text(outcomes, failures)}",
        [ResultTable(title, PARTS_HEAD, rows, len(PARTS_HEAD) - 1)],
    )


def _parts_row(outcomes: Outcomes, failure: cases.Failure) -> tuple[str, ...]:
    cells = [_cell(outcomes.runs(cases.of_part(failure, way))) for way in cases.OF_PARTS]
    stopped = _stopped(outcomes.runs(cases.of_part(failure, cases.RELEASE)))
    return failure.name, *cells, *stopped


def _cell(runs: Sequence[Outcome]) -> str:
    return f"{statuses_text(runs)}: {np.median([run.data.ratio for run in runs]):.3g}" if runs else "not run"


def _stopped(runs: Sequence[Outcome]) -> tuple[str, str]:
    """Reasons and median time of the stops by the watchdog."""
    stops = [run.data for run in runs if run.data.stop_reason is not Reason.NONE]
    if not stops:
        return "–", "–"
    reasons = dict.fromkeys(stop.stop_reason.text for stop in stops)
    return "; ".join(reasons), f"{np.median([1e3 * (stop.stopped_s - stop.start_s) for stop in stops]):.0f}"


def _healthy(outcomes: Outcomes) -> str:
    errors = [np.degrees(run.data.after_rad) for run in outcomes.runs(cases.HEALTHY_ELECTRONICS)]
    if not errors:
        return ""
    return f" The largest error with healthy electronics is {np.median(errors):.2f}° (median over the seeds)."


def _watchdog_text(outcomes: Outcomes, failures: Sequence[cases.Failure]) -> str:
    """Count the failures that lose the rotor without a watchdog, and those that the watchdog stops."""
    lost = [failure for failure in failures if not _all_track(outcomes, failure)]
    if not lost:
        return ""
    missed = [failure.name for failure in lost if not _all_stopped(outcomes, failure)]
    text = (
        f"\n\nWithout a watchdog {len(failures) - len(lost)} of {len(failures)} failures leave a rotor that"
        f" tracks under every seed. Of the {len(lost)} others the watchdog stops {len(lost) - len(missed)}"
        " under every seed."
    )
    return text + (f" What it does not always see: {', '.join(missed)}." if missed else "")


def _all_track(outcomes: Outcomes, failure: cases.Failure) -> bool:
    return all(map(tracks, outcomes.runs(cases.of_part(failure, cases.ALONE))))


def _all_stopped(outcomes: Outcomes, failure: cases.Failure) -> bool:
    runs = [run for way in (cases.RELEASE, cases.BRAKE) for run in outcomes.runs(cases.of_part(failure, way))]
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
    return Drawing("faults_shares.svg", caption, figure)


def draw_pairs(outcomes: Outcomes) -> Drawing:
    """Error of every pair, and of every single group on the diagonal."""
    from spheretwin.viz.figures import faults as figures

    panels = {way.name: ratios(outcomes, way) for way in (cases.UNREPORTED, cases.REPORTED, cases.DETECTING)}
    figure = figures.triangles(panels, "open group", ERROR, TWICE, "Every pair of groups open")
    caption = (
        "Largest error of any hinge after the fault over that of the healthy run over the same window, median"
        f" over the seeds; on the diagonal a single group. A cross: more than {TWICE:g}."
    )
    return Drawing("faults_pairs.svg", caption, figure)


def ratios(outcomes: Outcomes, way: cases.Way) -> NDArray[np.float64]:
    """(groups, groups) median error ratio of a way; NaN above the diagonal or without a run."""
    medians = np.full((cases.count(), cases.count()), np.nan)
    for groups, runs in runs_by_set(outcomes, [*cases.singles(), *cases.pairs()], way).items():
        medians[groups[-1], groups[0]] = np.median([run.data.ratio for run in runs])
    return medians


def latencies(by_kind: Mapping[str, Sequence[float]]) -> Drawing:
    """Share of the faults that are not detected yet, over the time since the fault."""
    from spheretwin.viz.figures import faults as figures

    figure = figures.remaining(
        by_kind, "time since the fault, s", "faults not detected yet, %", "Detection latency"
    )
    caption = (
        "Share of the faults that are not detected yet. What remains at the right is not detected in the run."
    )
    return Drawing("faults_latency.svg", caption, figure)


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
    return Drawing("faults_torque.svg", caption, figure)


GROUPS_METHOD = (
    "Coils on ideal hardware, the least-norm allocation with its limit of 8 A unless it says *bounded* (all"
    " that the limit allows). *Not reported*: the controller has no information about the fault. *Reported*:"
    " the allocation excludes the groups from the tick at which they open. *Detecting*: the allocation"
    " excludes the groups that the detector identifies.\n\n"
    "The fault starts at a random control tick of the run, which depends on the seed; all ways of a set"
    " share it. The *error ratio* is the largest error of any hinge from the start of the fault to the end of"
    " the run, divided by the same error of the healthy run with the same seed, allocation and window. A run"
    f" *tracks* if it completes and its error ratio is at most {TWICE:g}. Quantiles have their 95 % interval"
    " in brackets; a largest value is that of the stated number of runs.\n\n"
    f"Every group and every pair runs with every seed; {cases.RANDOM_SETS} larger random sets run with"
    " one seed each."
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
    by_number = [(number, _of_number(number)) for number in (1, 2, *cases.SIZES)]
    rows = [
        row
        for number, listed in by_number
        for way in cases.OF_GROUPS
        if (row := _groups_row(outcomes, number, listed, way))
    ]
    title = "Open groups by their number and way"
    by_start = [
        row
        for interval in INTERVALS_s
        for way in cases.OF_GROUPS
        if (row := _started(outcomes, interval, way))
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


RunsBySet = Mapping[cases.Groups, Sequence[Outcome]]


def runs_by_set(outcomes: Outcomes, sets: Sequence[cases.Groups], way: cases.Way) -> RunsBySet:
    """Outcomes of the sets that were run in a way."""
    return {groups: runs for groups in sets if (runs := outcomes.runs(cases.of_groups(groups, way)))}


def _of_number(number: int) -> Sequence[cases.Groups]:
    if number == 1:
        return cases.singles()
    return (
        cases.pairs()
        if number == 2
        else [groups for groups in cases.random_groups() if len(groups) == number]
    )


def _groups_row(
    outcomes: Outcomes, number: int, listed: Sequence[cases.Groups], way: cases.Way
) -> tuple[str, ...] | None:
    by_set = runs_by_set(outcomes, listed, way)
    runs = [run for of_set in by_set.values() for run in of_set]
    if not runs:
        return None
    completed = [run.is_complete for run in runs]
    return (str(number), way.name, str(len(by_set)), str(len(runs)), percent(completed), *_tracking(runs))


def _started(outcomes: Outcomes, interval_s: tuple[float, float], way: cases.Way) -> tuple[str, ...] | None:
    """Row of the faults of one or two groups that start in an interval."""
    first, end = interval_s
    runs = [run for run in few(outcomes, way) if first <= run.data.start_s < end]
    return (f"{first:g} to {end:g}", way.name, str(len(runs)), *_tracking(runs)) if runs else None


def _tracking(runs: Sequence[Outcome]) -> tuple[str, ...]:
    """Return the share that tracks, and quantiles of the error ratio with their intervals."""
    ratios = [run.data.ratio for run in runs]
    quantiles = (quantile_text(ratios, "{:.2f}".format, share) for share in (0.5, 0.95, 0.99))
    return percent([tracks(run) for run in runs]), *quantiles, f"{np.max(ratios):.2f}"


def few(outcomes: Outcomes, way: cases.Way) -> list[Outcome]:
    """Return the runs with one or two open groups in a way."""
    return [
        run
        for runs in runs_by_set(outcomes, [*cases.singles(), *cases.pairs()], way).values()
        for run in runs
    ]


def percent(true: Sequence[bool]) -> str:
    """Percentage; 0 and 100 only if the share is exactly that."""
    share = 100 * sum(true) / len(true)
    return f"{share:.0f} %" if share in (0, 100) else f"{np.clip(share, 0.1, 99.9):.1f} %"


def _numbers(outcomes: Outcomes) -> str:
    """Count the runs without a status or with numbers that are not finite."""
    runs = [run for of_case in outcomes.values() for run in of_case]
    broken = sum(not run.data.is_finite or run.status == Status.DIVERGED for run in runs)
    wrongly = sum(run.data.false_detections for run in runs)
    ended = "each" if not broken else f"all but {broken}"
    return (
        f"Of the {len(runs)} runs of the whole study, {ended} ended with a status and with nothing but"
        f" numbers in its telemetry. The detector took {wrongly or 'no'} groups that work for open ones."
    )


def _goal(outcomes: Outcomes) -> str:
    """State how many of the runs with one or two open groups track."""
    texts = []
    for way in (cases.REPORTED, cases.DETECTING, cases.UNREPORTED):
        runs = few(outcomes, way)
        if runs:
            ratios = [run.data.ratio for run in runs]
            texts.append(
                f"{way.name}, {sum(map(tracks, runs))} of {len(runs)} runs track, with a median error ratio"
                f" of {np.median(ratios):.2f} and at most {max(ratios):.2f}"
            )
    return f" With one or two groups open: {'; '.join(texts)}." if texts else ""


def _shares(outcomes: Outcomes) -> dict[str, dict[int, float]]:
    """Share of the runs that track, by way and number of open groups."""
    return {way.name: _share_by_number(runs_by_set(outcomes, cases.sets(), way)) for way in cases.OF_GROUPS}


def _share_by_number(by_set: RunsBySet) -> dict[int, float]:
    tracked: dict[int, list[bool]] = {}
    for groups, runs in by_set.items():
        tracked.setdefault(len(groups), []).extend(tracks(run) for run in runs)
    return {number: float(np.mean(tracked[number])) for number in sorted(tracked)}
