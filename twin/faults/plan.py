"""Which faults are at work at a control tick: a function of plan, seed and tick alone.

Neither chunks nor restored snapshots can move a fault. What comes and goes does so by stretches of a stated
length, counted from the start of the run; for each stretch a coin of its own is tossed, from seed, part and
number of the stretch.
"""

from __future__ import annotations

from functools import cache
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.twin.faults.fault import MODES, Fault
from spheretwin.twin.faults.target import Effects, Strike
from spheretwin.twin.faults.targets.registry import TARGETS

STAGE = 201
"""Of the coins: ``default_rng([seed, STAGE, part, stretch])``."""

NEVER = 2**62

# Times and periods are decimal fractions: a tick that falls on a start does so to rounding only.
ROUNDING = 1e-6

_KINDS = tuple(TARGETS)

COLUMNS_A_PART = 2
"""Random numbers a tick."""


class Planned(NamedTuple):
    """A fault in control ticks."""

    fault: Fault
    part: int
    """Its place among all parts."""
    first: int
    end: int
    stretch: int
    """Ticks; 0 for what does not come and go."""


class FaultPlan:
    """Faults of a scenario, tick by tick.

    Parameters
    ----------
    faults : tuple of Fault
    groups : int
        Coil groups.
    period_s : float, s
        Control period.
    seed : int
    """

    def __init__(self, faults: tuple[Fault, ...], groups: int, period_s: float, seed: int) -> None:
        self._groups, self.period_s, self._seed = groups, period_s, seed
        self._planned = tuple(self._in_ticks(fault) for fault in faults)

    def __len__(self) -> int:
        return len(self._planned)

    def at_work(self, tick: int) -> tuple[int, ...]:
        """Places in the plan of the faults that act at a tick."""
        return tuple(i for i, planned in enumerate(self._planned) if self._acts(planned, tick))

    def next_change(self, tick: int) -> int:
        """First later tick at which others may act; `NEVER` where there is none."""
        return min((self._next(planned, tick) for planned in self._planned), default=NEVER)

    def strike(self, at_work: tuple[int, ...], effects: Effects) -> None:
        """Let some faults of the plan act: what is further from the coils first, of one kind in its order.

        What is wrong with a converter passes through its amplifier, whatever the order of the two in a plan.
        """
        for i in sorted(at_work, key=self._distance_from_the_coils, reverse=True):
            planned = self._planned[i]
            column = COLUMNS_A_PART * planned.part
            planned.fault.way.strike(effects, Strike(planned.fault.place, planned.fault.number, column))

    def told(self, at_work: tuple[int, ...]) -> NDArray[np.bool_]:
        """Groups (n,) that the allocation is told to leave out."""
        told = np.zeros(self._groups, dtype=np.bool_)
        for i in at_work:
            if self._planned[i].fault.known:
                told[self._planned[i].fault.place] = True
        return told

    def marks(self, at_work: tuple[int, ...]) -> NDArray[np.float64]:
        """For every part the number of its mode, from 1 on, or 0 where it works."""
        marks = np.zeros(len(part_names(self._groups)))
        for i in at_work:
            marks[self._planned[i].part] = 1 + MODES.index(self._planned[i].fault.mode)
        return marks

    def began_s(self, tick: int) -> NDArray[np.float64]:
        """When the last fault of each group (n,) that has begun did so, s; below 0 where none has."""
        began = np.full(self._groups, -1.0)
        for planned in self._planned:
            if planned.fault.kind.each_group and planned.first <= tick:
                place = planned.fault.place
                began[place] = max(began[place], planned.first * self.period_s)
        return began

    def _distance_from_the_coils(self, i: int) -> int:
        return _KINDS.index(self._planned[i].fault.kind.name)

    def _in_ticks(self, fault: Fault) -> Planned:
        stretch = max(1, round(fault.number / self.period_s)) if fault.way.intermittent else 0
        end = NEVER if fault.end_s is None else self._tick(fault.end_s)
        return Planned(fault, part_of(fault, self._groups), self._tick(fault.start_s), end, stretch)

    def _tick(self, t_s: float) -> int:
        periods = t_s / self.period_s
        nearest = round(periods)
        return nearest if abs(periods - nearest) <= ROUNDING else ceil(periods)

    def _acts(self, planned: Planned, tick: int) -> bool:
        if not planned.first <= tick < planned.end:
            return False
        if not planned.stretch:
            return True
        coin = np.random.default_rng([self._seed, STAGE, planned.part, tick // planned.stretch])
        return bool(coin.random() < 0.5)

    @staticmethod
    def _next(planned: Planned, tick: int) -> int:
        if tick < planned.first:
            return planned.first
        if tick >= planned.end:
            return NEVER
        stretch = (tick // planned.stretch + 1) * planned.stretch if planned.stretch else NEVER
        return min(planned.end, stretch)


def draws_width(groups: int) -> int:
    """Random numbers a tick: those of every part, then one for the sensor of each group's current."""
    return COLUMNS_A_PART * len(part_names(groups)) + groups


@cache
def part_names(groups: int) -> tuple[str, ...]:
    """Every part that can fail, kind by kind."""
    return tuple(name for target in TARGETS.values() for name in target.names(groups))


def part_of(fault: Fault, groups: int) -> int:
    """Place among all parts of the one that a fault strikes."""
    before = 0
    for target in TARGETS.values():
        if target is fault.kind:
            return before + fault.place
        before += len(target.names(groups))
    raise AssertionError(fault.target)  # it was checked when it was made
