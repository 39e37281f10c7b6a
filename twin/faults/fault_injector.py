"""Fault injection: apply the scheduled faults of each control tick to the stages."""

from __future__ import annotations

from spheretwin.control.supervision.enabled_groups import mark_faulty_groups
from spheretwin.faults.effects import Effects
from spheretwin.faults.schedule import NEVER, FaultSchedule
from spheretwin.models.base.record import Rows, columns_of


class FaultInjector:
    """Applies the faults of a schedule to the stages that they modify.

    Parameters
    ----------
    schedule : FaultSchedule
    run : array of one RunData
        Without a fault. Its stages are modified, its controller gets the marks of reported groups, and its
        plant the modes and the starts of the faults.
    step_s : float, s
        Physics step.
    """

    def __init__(self, schedule: FaultSchedule, run: Rows, step_s: float) -> None:
        self._schedule, self._effects = schedule, Effects(run, schedule.period_s, step_s)
        self._plant, self._groups = run["plant"], run["controller"]["supervision"]["groups"]
        self._written = list(columns_of(run, lambda field: field.set_by_faults)) if len(schedule) else []
        self._healthy = [array.copy() for array in self._written]
        self._applied: tuple[tuple[int, ...], bytes] | None = None

    def apply(self, tick: int) -> int:
        """Apply the faults that are due at a control tick; return the next tick at which they may change."""
        if self._applied and not len(self._schedule):
            return NEVER  # most runs have no faults: a tick must not cost time for them
        active, fault_start_s = self._schedule.active(tick), self._schedule.fault_start_s(tick)
        if (active, fault_start_s.tobytes()) != self._applied:
            self._applied = active, fault_start_s.tobytes()
            self._plant["fault_start_s"] = fault_start_s
            self._plant["fault_modes"] = self._schedule.mode_numbers(active)
            mark_faulty_groups(
                self._groups, self._schedule.reported_groups(active), tick * self._schedule.period_s
            )
            for array, healthy in zip(self._written, self._healthy, strict=True):
                array[...] = healthy
            self._schedule.apply(active, self._effects)
        return self._schedule.next_change(tick)
