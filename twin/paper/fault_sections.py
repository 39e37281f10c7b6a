"""Sections of the fault study on open groups and on failures of sensors, supply and controller."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from spheretwin.control.supervision.watchdog import Reason
from spheretwin.models.telemetry.status import Status
from spheretwin.paper import fault_cases as cases
from spheretwin.paper.cells import NONE, Numbers, statuses_text, table
from spheretwin.paper.experiment import Array, ExperimentSection, RunOutcome
from spheretwin.paper.fault_cases import COILS, FEW, FILE, FaultRuns
from spheretwin.paper.fault_outcomes import TWICE, FaultData, tracks
from spheretwin.viz.pages.markdown import Drawing


def parts_section(faults: FaultRuns) -> ExperimentSection:
    """Result of every mode of every part in its three ways."""
    failures = [item["failure"] for item in faults.of("part", way=cases.ALONE.name)]
    by_way = {
        way.name: {item["failure"]: item.runs for item in faults.of("part", way=way.name)}
        for way in cases.OF_PARTS
    }
    stopped = by_way[cases.RELEASE.name]
    cells: dict[str, Callable[[str], str]] = {"part and mode": str}
    cells |= {way: partial(_cell, of_way) for way, of_way in by_way.items()}
    cells |= {"stopped for": partial(_reasons, stopped), "after the fault, ms": partial(_delay, stopped)}
    title = "Failures that start at a random time: status of the runs, and their error ratio"
    text = f"{_healthy(faults)}{_watchdog_text(by_way, failures)}"
    return FILE.section("parts", [table(title, failures, cells, len(cells) - 1)], more=text)


Runs = Mapping[str, Sequence[RunOutcome]]
"""Runs by the name of the failure."""


def _cell(of_way: Runs, failure: str) -> str:
    runs = of_way.get(failure)
    return f"{statuses_text(runs)}: {np.median([run.data.ratio for run in runs]):.3g}" if runs else "not run"


def _stops(of_way: Runs, failure: str) -> list[FaultData]:
    data = [run.data for run in of_way.get(failure, ())]
    return [stop for stop in data if stop.stop_reason is not Reason.NONE]


def _reasons(of_way: Runs, failure: str) -> str:
    return "; ".join(dict.fromkeys(stop.stop_reason.text for stop in _stops(of_way, failure))) or NONE


def _delay(of_way: Runs, failure: str) -> str:
    delays = [1e3 * (stop.stopped_s - stop.start_s) for stop in _stops(of_way, failure)]
    return f"{np.median(delays):.0f}" if delays else NONE


def _healthy(faults: FaultRuns) -> str:
    errors = [
        np.degrees(run.data.after_rad)
        for item in faults.of("healthy")
        if item.case is cases.HEALTHY_ELECTRONICS
        for run in item.runs
    ]
    if not errors:
        return ""
    return f" The largest error with healthy electronics is {np.median(errors):.2f}° (median over the seeds)."


def _watchdog_text(by_way: Mapping[str, Runs], failures: Sequence[str]) -> str:
    """Count the failures that lose the rotor without a watchdog, and those that the watchdog stops."""
    lost = [failure for failure in failures if not all(map(tracks, by_way[cases.ALONE.name][failure]))]
    if not lost:
        return ""
    stopped = [by_way[way.name] for way in (cases.RELEASE, cases.BRAKE)]
    missed = [
        failure
        for failure in lost
        if any(run.status != Status.FAILSAFE for of_way in stopped for run in of_way.get(failure, ()))
    ]
    text = (
        f"\n\nWithout a watchdog {len(failures) - len(lost)} of {len(failures)} failures leave a rotor that"
        f" tracks under every seed. Of the {len(lost)} others the watchdog stops {len(lost) - len(missed)}"
        " under every seed."
    )
    return text + (f" What it does not always see: {', '.join(missed)}." if missed else "")


ERROR = "error ratio"


def _draw_shares(faults: FaultRuns) -> Drawing:
    from spheretwin.viz.figures import faults as figures

    by_way: dict[str, dict[int, float]] = {}
    for way in cases.OF_GROUPS:
        tracked: dict[int, list[bool]] = {}
        for item in faults.of(*COILS, way=way.name):
            tracked.setdefault(len(item["groups"]), []).extend(map(tracks, item.runs))
        by_way[way.name] = {number: float(np.mean(tracked[number])) for number in sorted(tracked)}
    figure = figures.shares(by_way, "open groups", "runs that track, %", "How many groups may be open")
    return FILE.drawing("shares", figure, times=TWICE)


def _draw_pairs(faults: FaultRuns) -> Drawing:
    from spheretwin.viz.figures import faults as figures

    panels = {way.name: ratios(faults, way) for way in (cases.UNREPORTED, cases.REPORTED, cases.DETECTING)}
    figure = figures.triangles(panels, "open group", ERROR, TWICE, "Every pair of groups open")
    return FILE.drawing("pairs", figure, times=TWICE)


def ratios(faults: FaultRuns, way: cases.Way) -> Array:
    """(groups, groups) median error ratio of a way; NaN above the diagonal or without a run."""
    medians = np.full((cases.count(), cases.count()), np.nan)
    for item in faults.of(*FEW, way=way.name):
        groups = item["groups"]
        medians[groups[-1], groups[0]] = np.median([run.data.ratio for run in item.runs])
    return medians


class Group(NamedTuple):
    """Runs of one row of a table."""

    name: str
    way: str
    sets: int
    runs: Sequence[RunOutcome]


MEASURES: dict[str, Callable[[Group], Any]] = {
    "number": lambda group: len(group.runs),
    "ratio": lambda group: Numbers(run.data.ratio for run in group.runs),
    "completed": lambda group: percent([run.is_complete for run in group.runs]),
    "track": lambda group: percent([tracks(run) for run in group.runs]),
}
INTERVALS_s = ((0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0), (4.0, 5.0))
"""Intervals of the run, of 5 s, in which faults start."""


def groups_section(faults: FaultRuns) -> ExperimentSection:
    """Shares that complete and track, pairs, and the smallest torque that is left."""
    by_number = [
        _of_number(faults, number, way) for number in (1, 2, *cases.SIZES) for way in cases.OF_GROUPS
    ]
    by_start = [_started(faults, *interval, way) for interval in INTERVALS_s for way in cases.OF_GROUPS]
    by_number, by_start = ([group for group in groups if group.runs] for groups in (by_number, by_start))
    tables = [
        FILE.table("by_number", by_number, **MEASURES),
        FILE.table("by_start", by_start, **MEASURES),
    ]
    drawings = [lambda: _draw_shares(faults), lambda: _draw_pairs(faults)] if by_number else []
    text = f" {_numbers(faults)}{_goal(faults)}"
    return FILE.section("groups", tables, drawings, text, times=TWICE, random=cases.RANDOM_SETS)


def _of_number(faults: FaultRuns, number: int, way: cases.Way) -> Group:
    items = [item for item in faults.of(*COILS, way=way.name) if len(item["groups"]) == number]
    return Group(str(number), way.name, len(items), [run for item in items for run in item.runs])


def _started(faults: FaultRuns, first_s: float, end_s: float, way: cases.Way) -> Group:
    runs = [run for run in faults.runs(*FEW, way=way.name) if first_s <= run.data.start_s < end_s]
    return Group(f"{first_s:g} to {end_s:g}", way.name, len(runs), runs)


def percent(true: Sequence[bool]) -> str:
    """Percentage; 0 and 100 only if the share is exactly that."""
    share = 100 * sum(true) / len(true)
    return f"{share:.0f} %" if share in (0, 100) else f"{np.clip(share, 0.1, 99.9):.1f} %"


def _numbers(faults: FaultRuns) -> str:
    """Count the runs without a status or with numbers that are not finite."""
    runs = faults.runs(*cases.KINDS)
    broken = sum(not run.data.is_finite or run.status == Status.DIVERGED for run in runs)
    wrongly = sum(run.data.false_detections for run in runs)
    ended = "each" if not broken else f"all but {broken}"
    return (
        f"Of the {len(runs)} runs of the whole study, {ended} ended with a status and with nothing but"
        f" numbers in its telemetry. The detector took {wrongly or 'no'} groups that work for open ones."
    )


def _goal(faults: FaultRuns) -> str:
    """State how many of the runs with one or two open groups track."""
    texts = []
    for way in (cases.REPORTED, cases.DETECTING, cases.UNREPORTED):
        if runs := faults.runs(*FEW, way=way.name):
            ratios = [run.data.ratio for run in runs]
            texts.append(
                f"{way.name}, {sum(map(tracks, runs))} of {len(runs)} runs track, with a median error ratio"
                f" of {np.median(ratios):.2f} and at most {max(ratios):.2f}"
            )
    return f" With one or two groups open: {'; '.join(texts)}." if texts else ""
