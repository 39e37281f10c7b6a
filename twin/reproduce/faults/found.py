"""Result of one run of the fault study, and the criterion of tracking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite, nan
from typing import Any, NamedTuple

import numpy as np

from spheretwin.control.supervision.detector import LEAST_SHARE
from spheretwin.control.supervision.groups import TOLD
from spheretwin.control.supervision.watchdog import REASONS, Reason
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.reproduce.experiment import Outcome
from spheretwin.twin.reproduce.faults.left import Left
from spheretwin.twin.reproduce.faults.reference import healthy, largest, left_by, reference, start_tick
from spheretwin.twin.simulation import Run

TWICE = 2.0
"""A run tracks if it completes and its error ratio is at most this."""


class Found(NamedTuple):
    """Result of a run. Errors are the largest of any hinge from the start of the fault to the run's end."""

    start_s: float
    """Start of the fault; 0 for a healthy run."""
    after_rad: float
    healthy_rad: float
    """The same error of the healthy run with the same seed, over the same control ticks."""
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
    """For each failed group, detection latency: time from fault to detection; None if not detected."""
    driven_ticks: tuple[int, ...]
    """For each failed group, control ticks from the fault to its detection, or to the end of the run, at
    which its command is above the threshold of the detector."""
    wrongly_found: int
    """Groups that work, and were found not to."""

    @property
    def ratio(self) -> float:
        """Error over that of the healthy run."""
        return self.after_rad / self.healthy_rad


def keep(run: Run) -> Found:
    """Reduce a run."""
    base, first, table = healthy(run.scenario), start_tick(run.scenario), run.telemetry
    healthy_error_rad = reference(base).error_rad
    failed = tuple(fault.place for fault in run.scenario.fault if fault.kind.each_group)
    detected = _detected_s(table)
    stopped, stopped_s = _stopped(table)
    return Found(
        start_s=first * run.scenario.controller.period_s,
        after_rad=largest(table["error_rad"][first:]),
        healthy_rad=largest(healthy_error_rad[first : len(table)]),
        ended_s=len(table) * run.scenario.controller.period_s,
        numbers=bool(np.isfinite(table.values).all()),
        stopped=stopped,
        stopped_s=stopped_s,
        told=run.scenario.detects or any(fault.known for fault in run.scenario.fault),
        least_norm=run.scenario.allocation == "least_norm",
        left=left_by(base, failed, first) if failed and first < len(healthy_error_rad) else None,
        found_s=tuple(detected.get(group) for group in failed),
        driven_ticks=tuple(_driven_ticks(run, group, first, detected.get(group)) for group in failed),
        wrongly_found=len(set(detected) - set(failed)),
    )


def tracks(outcome: Outcome) -> bool:
    """Whether a run completed, and stayed close."""
    return outcome.status == Status.COMPLETED and outcome.kept.ratio <= TWICE


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
        "start_s": [each.start_s for each in kept],
        "error_after_fault_rad": [_plain(each.after_rad) for each in kept],
        "healthy_error_after_fault_rad": [_plain(each.healthy_rad) for each in kept],
        "error_ratio": _plain(np.median([each.ratio for each in kept])),
        "error_ratio_range": [
            _plain(min(each.ratio for each in kept)),
            _plain(max(each.ratio for each in kept)),
        ],
        "ended_s": float(np.median([each.ended_s for each in kept])),
        "time_to_detection_s": [list(each.found_s) for each in kept],
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


def _driven_ticks(run: Run, group: int, first: int, latency_s: float | None) -> int:
    """Count the ticks from the fault to the detection at which a group is commanded more than the threshold.

    The detector compares the measured current with that of the command of the tick before. On ideal hardware
    its threshold is a share of the current limit.
    """
    threshold_A = LEAST_SHARE * run.actuator.group.current_limit_A
    ticks = None if latency_s is None else round(latency_s / run.scenario.controller.period_s)
    command_A = run.telemetry["current_command_A"][:, group]
    rows = slice(max(first - 1, 0), None if ticks is None else first + ticks)
    return int(np.count_nonzero(np.abs(command_A[rows]) > threshold_A))


def _plain(value: Any) -> float | None:
    return float(value) if isfinite(value) else None
