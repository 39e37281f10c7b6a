"""What the study keeps of a run, and what it calls tracking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite, nan
from typing import Any, NamedTuple

import numpy as np

from spheretwin.control.supervision.groups import TOLD
from spheretwin.control.supervision.watchdog import REASONS, Reason
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.reproduce.experiment import Outcome
from spheretwin.twin.reproduce.faults.left import Left
from spheretwin.twin.reproduce.faults.reference import healthy, largest, left_by, reference
from spheretwin.twin.simulation import Run

TWICE = 2.0
"""A run tracks where it completes, and errs after the fault no more than so many times as the healthy run."""


class Found(NamedTuple):
    """What remains of a run; errors are those of any hinge over the healthy run's of the same seed."""

    after: float
    """From the fault on."""
    whole: float
    after_rad: float
    ended_s: float
    numbers: bool
    """Whether all of its telemetry are numbers."""
    stopped: Reason
    """Why the watchdog took the currents away."""
    stopped_s: float
    """When; no number where it did not."""
    told: bool
    """Whether the allocation was told what is open, or could find it."""
    least_norm: bool
    """Whether the allocation is that of least norm."""
    left: Left | None
    """None where no groups are open."""
    found_s: tuple[float | None, ...]
    """For each open group, time from the fault until the detector found it."""
    wrongly_found: int
    """Groups that work, and were found not to."""


def keep(run: Run) -> Found:
    """Reduce a run."""
    base = healthy(run.scenario)
    beside, table = reference(base), run.telemetry
    opened = tuple(fault.place for fault in run.scenario.fault if fault.kind.each_group)
    detected = _detected_s(table)
    after_rad = largest(table, run.scenario)
    stopped, stopped_s = _stopped(table)
    return Found(
        after=after_rad / beside.after_rad,
        whole=largest(table) / beside.largest_rad,
        after_rad=after_rad,
        ended_s=len(table) * run.scenario.controller.period_s,
        numbers=bool(np.isfinite(table.values).all()),
        stopped=stopped,
        stopped_s=stopped_s,
        told=run.scenario.detects or any(fault.known for fault in run.scenario.fault),
        least_norm=run.scenario.allocation == "least_norm",
        left=left_by(base, opened) if opened else None,
        found_s=tuple(detected.get(group) for group in opened),
        wrongly_found=len(set(detected) - set(opened)),
    )


def tracks(outcome: Outcome) -> bool:
    """Whether a run completed, and stayed close."""
    return outcome.status == Status.COMPLETED and outcome.kept.after <= TWICE


def reason(outcome: Outcome) -> str | None:
    """Why a run does not track, or was stopped; None where it tracks, or nothing can be said."""
    kept: Found = outcome.kept
    if kept.stopped is not Reason.NONE:
        return kept.stopped.told
    if tracks(outcome) or kept.left is None:
        return None
    if kept.left.rank < 3:
        return f"rank {kept.left.rank}"
    if kept.told:
        by_least_norm = f", {kept.left.least_norm:.2f} by least norm" if kept.least_norm else ""
        return f"{kept.left.torque:.2f} of the torque needed is left{by_least_norm}"
    return f"{kept.left.comes:.3f} of the torque asked for comes"


def more(outcomes: Sequence[Outcome]) -> Mapping[str, Any]:
    """What the JSON says of a case besides: medians and ranges over the seeds, the least of what is left."""
    kept: list[Found] = [outcome.kept for outcome in outcomes]
    sets = [each.left for each in kept if each.left is not None]
    reasons = [why for outcome in outcomes if (why := reason(outcome))]
    return {
        "tracks": [tracks(outcome) for outcome in outcomes].count(True),
        "reason": reasons[0] if reasons else None,
        "error_ratio": _plain(np.median([each.after for each in kept])),
        "error_ratio_range": [
            _plain(min(each.after for each in kept)),
            _plain(max(each.after for each in kept)),
        ],
        "error_ratio_whole_run": _plain(np.median([each.whole for each in kept])),
        "ended_s": float(np.median([each.ended_s for each in kept])),
        "time_to_detection_s": [
            _middle(times) for times in zip(*(each.found_s for each in kept), strict=True)
        ],
        "wrongly_found": sum(each.wrongly_found for each in kept),
        "torque_left_over_needed": min((each.torque for each in sets), default=None),
        "least_norm_torque_over_needed": min((each.least_norm for each in sets), default=None),
        "share_that_comes_untold": min((each.comes for each in sets), default=None),
        "least_singular_value_Nm_per_A": min((each.singular_value_Nm_per_A for each in sets), default=None),
        "rank": min((each.rank for each in sets), default=None),
    }


def _detected_s(table: Table) -> dict[int, float]:
    """For each group that was found not to follow, time from its fault, s; for one that works, none."""
    if not len(table) or "group_out" not in {signal.name for signal in table.signals}:
        return {}
    groups = np.flatnonzero(table["group_out"][-1] > TOLD)
    return {int(group): float(table["time_to_detection_s"][-1, group]) for group in groups}


def _stopped(table: Table) -> tuple[Reason, float]:
    """Why the watchdog stepped in, and when."""
    if "failsafe_reason" not in {signal.name for signal in table.signals}:
        return Reason.NONE, nan
    ticks = np.flatnonzero(table["failsafe_reason"])
    if not len(ticks):
        return Reason.NONE, nan
    return REASONS[int(table["failsafe_reason"][ticks[0]])], float(table["t_s"][ticks[0]])


def _middle(times_s: Sequence[float | None]) -> float | None:
    """Median over the seeds; None where one was not found under each of them."""
    known = [time_s for time_s in times_s if time_s is not None]
    return float(np.median(known)) if known and len(known) == len(times_s) else None


def _plain(value: Any) -> float | None:
    return float(value) if isfinite(value) else None
