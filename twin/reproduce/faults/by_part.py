"""Sensors, supply and controller: what fails by itself, what the watchdog sees, and how each run ends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spheretwin.control.supervision.watchdog import Reason
from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Outcome, Outcomes, Section, Table
from spheretwin.twin.reproduce.faults.conditions.cases import HEALTHY_PROTOTYPE, of_part
from spheretwin.twin.reproduce.faults.conditions.parts import Failure, failures
from spheretwin.twin.reproduce.faults.conditions.ways import ALONE, BRAKE, OF_PARTS, RELEASE
from spheretwin.twin.reproduce.faults.found import tracks
from spheretwin.twin.reproduce.rows import ended

HOW = (
    "The prototype, as nothing else has these parts. There are no groups to leave out, so the ways are"
    " others: *no watchdog*; one that takes the currents away (*release*); one that shorts the coils, which"
    " brakes (*short*). The number is the error ratio as above, with the healthy prototype as"
    " reference, median over the seeds. The window of a run that is"
    " stopped ends there. What is intermittent fails in every other"
    " stretch of 10 ms, by a coin; what is stuck stays where it was."
)
HEAD = ("part and mode", *(way.name for way in OF_PARTS), "stopped for", "after the fault, ms")


def section(outcomes: Outcomes) -> Section:
    """How every mode of every part ends in its three ways."""
    ran = [failure for failure in failures() if of_part(failure, ALONE).name in outcomes]
    rows = [_row(outcomes, failure) for failure in ran]
    title = "Failures that start at a drawn time: how the runs ended, and their error ratio"
    return Section(
        "Sensors, supply and controller",
        f"{HOW}{_healthy(outcomes)}{_seen(outcomes, ran)}",
        [Table(title, HEAD, rows, len(HEAD) - 1)],
    )


def _row(outcomes: Outcomes, failure: Failure) -> tuple[str, ...]:
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
    reasons = dict.fromkeys(each.stopped.told for each in kept)
    return "; ".join(reasons), f"{np.median([1e3 * (each.stopped_s - each.start_s) for each in kept]):.0f}"


def _healthy(outcomes: Outcomes) -> str:
    if HEALTHY_PROTOTYPE.name not in outcomes:
        return ""
    errors = [np.degrees(run.kept.after_rad) for run in outcomes[HEALTHY_PROTOTYPE.name]]
    return f" The largest error of the healthy prototype is {np.median(errors):.2f}° (median over the seeds)."


def _seen(outcomes: Outcomes, ran: Sequence[Failure]) -> str:
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
