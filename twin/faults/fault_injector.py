"""Fault injection: at each control tick, the stages have the faults that are due, and no others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.supervision.enabled_groups import REPORTED, STATES, EnabledGroups, mark_faulty_groups
from spheretwin.control.supervision.watchdog import REASONS
from spheretwin.faults.effects import Effects
from spheretwin.faults.schedule import NEVER, FaultPlan
from spheretwin.models.base.compiled import arrays_of
from spheretwin.models.telemetry.table import Table


class FaultInjector:
    """Applies the faults of a plan to the stages that they modify.

    Parameters
    ----------
    plan : FaultPlan
    effects : Effects or None
        The stages, without a fault; None if nothing can fail.
    groups : Groups
        Of the controller, which is told of what it may know.
    marks : array
        Written: for every part the number of its mode, or 0.
    began_s : (n,) array
        Written: when the last fault of each group began.
    """

    def __init__(
        self,
        plan: FaultPlan,
        effects: Effects | None,
        groups: EnabledGroups,
        marks: NDArray[np.float64],
        began_s: NDArray[np.float64],
    ) -> None:
        self._plan, self._effects, self._groups = plan, effects, groups
        self._marks, self._began_s = marks, began_s
        self._written = arrays_of(effects, "fault_arrays") if effects else []
        self._healthy = [array.copy() for array in self._written]
        self._as_of: tuple[tuple[int, ...], bytes] | None = None

    def apply(self, tick: int) -> int:
        """Apply the faults that are due at a control tick; returns the next tick at which others may be."""
        if self._as_of and not len(self._plan):
            return NEVER  # as most runs are: a tick by itself shall not pay for what nobody planned
        active, began_s = self._plan.active(tick), self._plan.began_s(tick)
        if (active, began_s.tobytes()) != self._as_of:
            self._as_of = active, began_s.tobytes()
            self._began_s[:], self._marks[:] = began_s, self._plan.marks(active)
            mark_faulty_groups(self._groups, self._plan.told(active), tick * self._plan.period_s)
            if self._effects:
                self._clear()
                self._plan.apply(active, self._effects)
        return self._plan.next_change(tick)

    def _clear(self) -> None:
        for array, healthy in zip(self._written, self._healthy, strict=True):
            array[...] = healthy


Line = tuple[float, str]
"""Simulated time in s, text."""


class FaultLines:
    """Finds these events in a run's telemetry, chunk by chunk."""

    def __init__(self) -> None:
        self._last: dict[str, NDArray[np.float64]] = {}

    def of(self, rows: Table) -> list[Line]:
        """Events of one chunk, in the order of time."""
        names = {signal.name: signal for signal in rows.signals}
        found: list[Line] = []
        if len(rows) and "fault" in names:
            labels, modes = names["fault"].labels, names["fault"].states
            for t_s, part, mode in self._changes(rows, "fault"):
                found.append(
                    (t_s, f"{labels[part]} {modes[mode]}" if mode else f"{labels[part]} works again")
                )
            delays = rows["time_to_detection_s"]
            for t_s, group, out in self._changes(rows, "group_out"):
                after_s = delays[np.searchsorted(rows["t_s"], t_s), group]
                after = f", {1e3 * after_s:.0f} ms after it failed" if out > REPORTED and after_s >= 0 else ""
                found.append((t_s, f"group {group} {STATES[out]}{after}"))
        if len(rows) and "failsafe_reason" in names:
            for t_s, _, reason in self._changes(rows, "failsafe_reason"):
                found.append((t_s, f"watchdog: {REASONS[reason].text}"))
        return sorted(found, key=lambda line: line[0])

    def _changes(self, rows: Table, name: str) -> list[tuple[float, int, int]]:
        """Time, place and new value where a column differs from the row before; before the first it is 0."""
        values = rows[name].reshape(len(rows), -1)
        last = self._last.get(name, np.zeros(values.shape[1]))
        self._last[name] = values[-1].copy()
        before = np.concatenate([last[None], values[:-1]])
        ticks, places = np.nonzero(values != before)
        return [
            (float(rows["t_s"][tick]), int(place), int(values[tick, place]))
            for tick, place in zip(ticks, places, strict=True)
        ]
