"""Fault injection: at each control tick, the stages have the faults that are due, and no others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.supervision.groups import Groups, tell
from spheretwin.models.base.copying import arrays_of
from spheretwin.twin.faults.plan import NEVER, FaultPlan
from spheretwin.twin.faults.target import Effects


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
        groups: Groups,
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
            tell(self._groups, self._plan.told(active), tick * self._plan.period_s)
            if self._effects:
                self._clear()
                self._plan.apply(active, self._effects)
        return self._plan.next_change(tick)

    def _clear(self) -> None:
        for array, healthy in zip(self._written, self._healthy, strict=True):
            array[...] = healthy
