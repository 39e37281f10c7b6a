"""Which faults are at work at a control tick: a function of plan, seed and tick alone.

Neither chunks nor restored snapshots can move a fault. What comes and goes does so by stretches of a stated
length, counted from the start of the run; for each stretch a coin of its own is tossed, from the seed, the
name of the part and the number of the stretch: ``default_rng([seed, stream_key("NAME intermittent"),
stretch])``.
"""

from __future__ import annotations

from functools import cache
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.electronics.random_streams import Streams, stream_key
from spheretwin.faults.effects import ActiveFault, Effects
from spheretwin.faults.fault import MODES, Fault
from spheretwin.faults.targets import TARGETS

NEVER = 2**62

# Times and periods are decimal fractions: a tick that falls on a start does so to rounding only.
ROUNDING = 1e-6

COLUMNS_A_PART = 2
"""Random numbers a tick of a part with noise: one for each channel that it has."""


class Planned(NamedTuple):
    """A fault in control ticks."""

    fault: Fault
    name: str
    """Of the part, which its random numbers are keyed by."""
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
        self._columns = {name: COLUMNS_A_PART * i for i, name in enumerate(_noisy(faults, groups))}

    def __len__(self) -> int:
        return len(self._planned)

    def active(self, tick: int) -> tuple[int, ...]:
        """Places in the plan of the faults that act at a tick."""
        return tuple(i for i, planned in enumerate(self._planned) if self._acts(planned, tick))

    def next_change(self, tick: int) -> int:
        """First later tick at which others may act; `NEVER` where there is none."""
        return min((self._next(planned, tick) for planned in self._planned), default=NEVER)

    def apply(self, active: tuple[int, ...], effects: Effects) -> None:
        """Apply some faults of the plan to the stages, in their order."""
        for i in active:
            planned = self._planned[i]
            column = self._columns.get(planned.name, 0)
            planned.fault.way.apply(effects, ActiveFault(planned.fault.place, planned.fault.number, column))

    def told(self, active: tuple[int, ...]) -> NDArray[np.bool_]:
        """Groups (n,) that the allocation is told to leave out."""
        told = np.zeros(self._groups, dtype=np.bool_)
        for i in active:
            if self._planned[i].fault.known:
                told[self._planned[i].fault.place] = True
        return told

    def marks(self, active: tuple[int, ...]) -> NDArray[np.float64]:
        """For every part the number of its mode, from 1 on, or 0 where it works."""
        marks = np.zeros(len(part_names(self._groups)))
        for i in active:
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

    def _in_ticks(self, fault: Fault) -> Planned:
        stretch = max(1, round(fault.number / self.period_s)) if fault.way.intermittent else 0
        end = NEVER if fault.end_s is None else self._tick(fault.end_s)
        name, part = part_name(fault, self._groups), part_of(fault, self._groups)
        return Planned(fault, name, part, self._tick(fault.start_s), end, stretch)

    def _tick(self, t_s: float) -> int:
        periods = t_s / self.period_s
        nearest = round(periods)
        return nearest if abs(periods - nearest) <= ROUNDING else ceil(periods)

    def _acts(self, planned: Planned, tick: int) -> bool:
        if not planned.first <= tick < planned.end:
            return False
        if not planned.stretch:
            return True
        key = stream_key(f"{planned.name} intermittent")
        coin = np.random.default_rng([self._seed, key, tick // planned.stretch])
        return bool(coin.random() < 0.5)

    @staticmethod
    def _next(planned: Planned, tick: int) -> int:
        if tick < planned.first:
            return planned.first
        if tick >= planned.end:
            return NEVER
        stretch = (tick // planned.stretch + 1) * planned.stretch if planned.stretch else NEVER
        return min(planned.end, stretch)


def noise_streams(faults: tuple[Fault, ...], groups: int) -> Streams:
    """Random streams of the noise that faults bring, a part each."""
    return tuple((f"{name} noise", COLUMNS_A_PART) for name in _noisy(faults, groups))


def _noisy(faults: tuple[Fault, ...], groups: int) -> tuple[str, ...]:
    """Names of the parts that faults make noisy."""
    return tuple(dict.fromkeys(part_name(fault, groups) for fault in faults if fault.mode == "noise"))


def part_name(fault: Fault, groups: int) -> str:
    """Name of the part that a fault modifies, in its one spelling."""
    return fault.kind.names(groups)[fault.place]


@cache
def part_names(groups: int) -> tuple[str, ...]:
    """Every part that can fail, kind by kind."""
    return tuple(name for target in TARGETS.values() for name in target.names(groups))


def part_of(fault: Fault, groups: int) -> int:
    """Place among all parts of the one that a fault modifies."""
    before = 0
    for target in TARGETS.values():
        if target is fault.kind:
            return before + fault.place
        before += len(target.names(groups))
    raise AssertionError(fault.target)  # it was checked when it was made
