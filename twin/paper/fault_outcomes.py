"""Result of one run of the fault study, and the criterion of tracking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from math import isfinite, nan
from typing import Any, NamedTuple

import numpy as np

from spheretwin.control.allocation.bounded import SCRATCH_ROWS, allocate_bounded
from spheretwin.control.allocation.least_norm import allocate
from spheretwin.control.supervision.enabled_groups import REPORTED
from spheretwin.control.supervision.fault_detector import LEAST_SHARE, DetectorSection
from spheretwin.control.supervision.watchdog import REASONS, Reason, WatchdogSection
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import compiled
from spheretwin.models.design.capability import LOST, torque_matrices
from spheretwin.models.telemetry.table import Table
from spheretwin.paper.experiment import Case, RunOutcome
from spheretwin.run import Run
from spheretwin.scenario.sections import Scenario
from spheretwin.simulation import simulate

# Multiple of the needed torque that is commanded to find the largest one; larger ratios are not resolved.
MOST = 1e3


class RemainingTorque(NamedTuple):
    """Smallest values along a path without some groups."""

    torque: float
    """Largest torque in the direction that was needed, currents within the limit, over what was needed; 0
    where a direction is lost. At most `MOST`."""
    least_norm: float
    """The same of least-norm currents, scaled as a whole."""
    least_share: float
    """Share of a torque commanded to all groups, least norm, that the remaining groups give, in the worst
    direction."""
    singular_value_Nm_per_A: float
    """The smallest of the torque matrix."""
    rank: int


def remaining_torque(G: Array, torque_S: Array, limit_A: float, opened: Sequence[int]) -> RemainingTorque:
    """Return the smallest values along a path.

    Parameters
    ----------
    G : (n, 3, groups) array, N·m/A
        Torque matrices of the path's poses with all groups.
    torque_S : (n, 3) array, N·m
        Torque that was needed at each.
    limit_A : float, A
    opened : sequence of int
        Groups that give nothing.

    Notes
    -----
    Least-norm currents for a torque are ``G^T (G G^T)^-1 torque`` of the whole matrix. What is left of it,
    ``G_l``, makes ``K torque`` of them, ``K = G_l G_l^T (G G^T)^-1``. Its eigenvalues are those of the
    symmetric ``C^-1 G_l G_l^T C^-T`` with ``G G^T = C C^T``: between 0 and 1, and the smallest is the share
    that comes in the worst direction.
    """
    reduced = G.copy()
    reduced[:, :, list(opened)] = 0.0
    squared = reduced @ reduced.transpose(0, 2, 1)  # (n, 3, 3)
    sigma = np.sqrt(np.maximum(np.linalg.eigvalsh(squared), 0.0))  # (n, 3) rising
    whole = np.linalg.inv(np.linalg.cholesky(G @ G.transpose(0, 2, 1)))
    comes = np.linalg.eigvalsh(whole @ squared @ whole.transpose(0, 2, 1))[:, 0]
    most, scaled = np.empty(len(G)), np.empty(len(G))
    _fill_most(reduced, np.ascontiguousarray(torque_S), limit_A, most, scaled)
    return RemainingTorque(
        torque=float(most.min()),
        least_norm=float(scaled.min()),
        least_share=float(np.clip(comes.min(), 0.0, 1.0)),
        singular_value_Nm_per_A=float(sigma[:, 0].min()),
        rank=int(np.sum(sigma > LOST * sigma[:, 2:], axis=1).min()),
    )


@compiled
def _fill_most(G: Array, torque_S: Array, limit: float, most: Array, scaled: Array) -> None:
    groups = G.shape[2]
    command, current, scratch = np.empty(3), np.empty(groups), np.empty((SCRATCH_ROWS, groups))
    for i in range(G.shape[0]):
        command[:] = MOST * torque_S[i]
        most[i] = MOST * allocate_bounded(G[i], command, limit, current, scratch)
        scaled[i] = MOST * allocate(G[i], command, limit, current)


PATH_TICKS = 10
"""Interval of the poses on the path: 10 ms, in which the rotor turns by some 4°."""


class Reference(NamedTuple):
    """Arrays of a healthy run, one row a control tick."""

    error_rad: Array
    """(n, 3) rad: tracking error"""
    q: Array
    """(n, 3) rad"""
    torque_S: Array
    """(n, 3) N·m: torque of the coils"""
    actuator: Actuator
    limit_A: float


def healthy(scenario: Scenario) -> Scenario:
    """Return the same scenario with neither faults, detector nor watchdog."""
    return scenario.model_copy(
        update={"fault": (), "detector": DetectorSection(), "watchdog": WatchdogSection()}
    )


@cache
def reference(scenario: Scenario) -> Reference:
    """Run a healthy scenario; each is run once."""
    run = simulate(scenario)
    table = run.telemetry
    return Reference(
        error_rad=table["error_rad"].copy(),
        q=table["q_rad"].copy(),
        torque_S=table["torque_Nm"].copy(),
        actuator=run.actuator,
        limit_A=run.actuator.group.current_limit_A,
    )


@lru_cache(maxsize=1024)
def remaining_without(scenario: Scenario, opened: Sequence[int], first: int) -> RemainingTorque:
    """Return the remaining torque along the path of a healthy scenario, from a tick to the end."""
    path = reference(scenario)
    rows = slice(first, None, PATH_TICKS)
    return remaining_torque(
        torque_matrices(path.q[rows], path.actuator), path.torque_S[rows], path.limit_A, opened
    )


def start_tick(scenario: Scenario) -> int:
    """Return the control tick of the first fault; 0 for a healthy scenario."""
    starts = [fault.start_s for fault in scenario.fault]
    return round(min(starts, default=0.0) / scenario.controller.period_s)


def largest(error_rad: Array) -> float:
    """Return the largest error of any hinge over a window (n, 3); NaN for an empty one."""
    return float(np.abs(error_rad).max()) if len(error_rad) else float("nan")


TWICE = 2.0
"""A run tracks if it completes and its error ratio is at most this."""


class FaultData(NamedTuple):
    """Result of a run. Errors are the largest of any hinge from the start of the fault to the run's end."""

    start_s: float
    """Start of the fault; 0 for a healthy run."""
    after_rad: float
    healthy_rad: float
    """The same error of the healthy run with the same seed, over the same control ticks."""
    ended_s: float
    is_finite: bool
    """Whether its telemetry is finite."""
    stop_reason: Reason
    """Reason for which the watchdog removed the currents."""
    stopped_s: float
    """Time of the stop; NaN without one."""
    is_reported: bool
    """Whether faults were reported to the allocation, or detected."""
    least_norm: bool
    """Whether the allocation is that of least norm."""
    remaining: RemainingTorque | None
    """None if no groups are open."""
    latencies_s: tuple[float | None, ...]
    """For each failed group, detection latency: time from fault to detection; None if not detected."""
    driven_ticks: tuple[int, ...]
    """For each failed group, control ticks from the fault to its detection, or to the end of the run, at
    which its command is above the threshold of the detector."""
    false_detections: int
    """Number of working groups that were detected as failed."""

    @property
    def ratio(self) -> float:
        """Error over that of the healthy run."""
        return self.after_rad / self.healthy_rad


def reduce(run: Run) -> FaultData:
    """Reduce a run."""
    base, first, table = healthy(run.scenario), start_tick(run.scenario), run.telemetry
    healthy_error_rad = reference(base).error_rad
    failed = tuple(fault.place for fault in run.scenario.fault if fault.kind.each_group)
    detected = _detected_s(table)
    stop_reason, stopped_s = _stop(table)
    return FaultData(
        start_s=first * run.scenario.controller.period_s,
        after_rad=largest(table["error_rad"][first:]),
        healthy_rad=largest(healthy_error_rad[first : len(table)]),
        ended_s=len(table) * run.scenario.controller.period_s,
        is_finite=bool(np.isfinite(table.values).all()),
        stop_reason=stop_reason,
        stopped_s=stopped_s,
        is_reported=run.scenario.detects or any(fault.reported_to_controller for fault in run.scenario.fault),
        least_norm=run.scenario.allocation == "least_norm",
        remaining=remaining_without(base, failed, first)
        if failed and first < len(healthy_error_rad)
        else None,
        latencies_s=tuple(detected.get(group) for group in failed),
        driven_ticks=tuple(_driven_ticks(run, group, first, detected.get(group)) for group in failed),
        false_detections=len(set(detected) - set(failed)),
    )


def tracks(outcome: RunOutcome) -> bool:
    """True if a run completed and its error ratio is at most `TWICE`."""
    return outcome.is_complete and outcome.data.ratio <= TWICE


def reason(outcome: RunOutcome) -> str | None:
    """Reason for which a run does not track or was stopped; None if it tracks or the reason is unknown."""
    data: FaultData = outcome.data
    if data.stop_reason is not Reason.NONE:
        return data.stop_reason.text
    if tracks(outcome) or data.remaining is None:
        return None
    if data.remaining.rank < 3:
        return f"rank {data.remaining.rank}"
    if data.is_reported:
        by_least_norm = f", {data.remaining.least_norm:.2f} by least norm" if data.least_norm else ""
        return f"{data.remaining.torque:.2f} of the torque needed is left{by_least_norm}"
    return f"{data.remaining.least_share:.3f} of the commanded torque is delivered"


def row_fields(case: Case, outcomes: Sequence[RunOutcome]) -> Mapping[str, Any]:
    """Entries of the JSON: medians and ranges over the seeds, the smallest remaining torque."""
    data: list[FaultData] = [outcome.data for outcome in outcomes]
    remaining = [run.remaining for run in data if run.remaining is not None]
    reasons = [why for outcome in outcomes if (why := reason(outcome))]
    ratios = [run.ratio for run in data]
    return {
        "tracks": [tracks(outcome) for outcome in outcomes].count(True),
        "reason": reasons[0] if reasons else None,
        "start_s": [run.start_s for run in data],
        "error_after_fault_rad": [_plain(run.after_rad) for run in data],
        "healthy_error_after_fault_rad": [_plain(run.healthy_rad) for run in data],
        "error_ratio": _plain(np.median(ratios)),
        "error_ratio_range": [_plain(min(ratios)), _plain(max(ratios))],
        "ended_s": float(np.median([run.ended_s for run in data])),
        "time_to_detection_s": [list(run.latencies_s) for run in data],
        "wrongly_found": sum(run.false_detections for run in data),
        **{
            name: min((getattr(least, figure) for least in remaining), default=None)
            for name, figure in LEAST.items()
        },
    }


LEAST = {
    "torque_left_over_needed": "torque",
    "least_norm_torque_over_needed": "least_norm",
    "share_that_comes_untold": "least_share",
    "least_singular_value_Nm_per_A": "singular_value_Nm_per_A",
    "rank": "rank",
}
"""Smallest values of the JSON, by fields of `RemainingTorque`."""


def _detected_s(table: Table) -> dict[int, float]:
    """Time from the fault to the detection of each detected group, s; none for a working one."""
    if not len(table) or "group_out" not in {signal.name for signal in table.signals}:
        return {}
    groups = np.flatnonzero(table["group_out"][-1] > REPORTED)
    return {int(group): float(table["time_to_detection_s"][-1, group]) for group in groups}


def _stop(table: Table) -> tuple[Reason, float]:
    """Reason and time of the stop by the watchdog."""
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
