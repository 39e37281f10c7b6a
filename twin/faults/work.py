"""Faults at work in the parts of a loop: those that are due act, all others are undone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.supervision.groups import Groups, tell
from spheretwin.twin.electronics.driving import faulty as driving
from spheretwin.twin.electronics.sensing import faulty as sensing
from spheretwin.twin.faults.plan import NEVER, FaultPlan
from spheretwin.twin.faults.target import Effects


class FaultsAtWork:
    """Brings the faults of a plan to the parts that they strike.

    Parameters
    ----------
    plan : FaultPlan
    effects : Effects or None
        The parts; None where nothing can fail.
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
        self._healthy_gain = effects.group_gain.copy() if effects else np.empty(0)
        self._as_of: tuple[tuple[int, ...], bytes] | None = None

    def strike(self, tick: int) -> int:
        """Let act what is due at a control tick, and nothing else; returns the next at which others may."""
        if self._as_of and not len(self._plan):
            return NEVER  # as most runs are: a tick by itself shall not pay for what nobody planned
        at_work, began_s = self._plan.at_work(tick), self._plan.began_s(tick)
        if (at_work, began_s.tobytes()) != self._as_of:
            self._as_of = at_work, began_s.tobytes()
            self._began_s[:], self._marks[:] = began_s, self._plan.marks(at_work)
            tell(self._groups, self._plan.told(at_work), tick * self._plan.period_s)
            if self._effects:
                self._heal(self._effects)
                self._plan.strike(at_work, self._effects)
        return self._plan.next_change(tick)

    def _heal(self, effects: Effects) -> None:
        driving.heal(effects.drive)
        sensing.heal(effects.sensors)
        effects.group_gain[:] = self._healthy_gain
