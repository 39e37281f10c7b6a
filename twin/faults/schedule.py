"""Fault schedule: the active faults at a control tick depend only on faults, seed and tick.

Neither chunks nor restored snapshots move a fault. An intermittent fault is on or off for intervals of a
stated length, counted from the start of the run. A random bit decides each interval; it depends on the seed,
the name of the part and the number of the interval: ``default_rng([seed, stream_key("NAME intermittent"),
interval])``.
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

# Times and periods are decimal fractions: a start time equals a tick only up to rounding.
ROUNDING = 1e-6

NUMBERS_PER_PART = 2
"""Random numbers per tick of a part with noise: one for each of its channels."""


class ScheduledFault(NamedTuple):
    """A fault with its times in control ticks."""

    fault: Fault
    name: str
    """Name of the part, which keys its random numbers."""
    part: int
    """Index of the part among all parts."""
    first: int
    end: int
    interval: int
    """Ticks of an interval; 0 if the fault is not intermittent."""


class FaultSchedule:
    """Active faults of a scenario at each tick.

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
        self._scheduled = tuple(self._in_ticks(fault) for fault in faults)
        self._columns = {name: NUMBERS_PER_PART * i for i, name in enumerate(_noisy(faults, groups))}

    def __len__(self) -> int:
        return len(self._scheduled)

    def active(self, tick: int) -> tuple[int, ...]:
        """Return the indices of the faults that act at a tick."""
        return tuple(i for i, scheduled in enumerate(self._scheduled) if self._acts(scheduled, tick))

    def next_change(self, tick: int) -> int:
        """Return the first later tick at which other faults may act; `NEVER` if there is none."""
        return min((self._next(scheduled, tick) for scheduled in self._scheduled), default=NEVER)

    def apply(self, active: tuple[int, ...], effects: Effects) -> None:
        """Apply the faults of some indices to the stages, in their order."""
        for i in active:
            scheduled = self._scheduled[i]
            column = self._columns.get(scheduled.name, 0)
            scheduled.fault.failure_mode.apply(
                effects, ActiveFault(scheduled.fault.place, scheduled.fault.effective_value, column)
            )

    def reported_groups(self, active: tuple[int, ...]) -> NDArray[np.bool_]:
        """Return the groups (n,) whose fault is reported to the allocation, which then leaves them out."""
        reported = np.zeros(self._groups, dtype=np.bool_)
        for i in active:
            if self._scheduled[i].fault.reported_to_controller:
                reported[self._scheduled[i].fault.place] = True
        return reported

    def mode_numbers(self, active: tuple[int, ...]) -> NDArray[np.float64]:
        """Return for every part the number of its failure mode, from 1 on, or 0 if it works."""
        numbers = np.zeros(len(part_names(self._groups)))
        for i in active:
            numbers[self._scheduled[i].part] = 1 + MODES.index(self._scheduled[i].fault.mode)
        return numbers

    def fault_start_s(self, tick: int) -> NDArray[np.float64]:
        """Return the start of the last started fault of each group (n,), s; below 0 if none has started."""
        start_s = np.full(self._groups, -1.0)
        for scheduled in self._scheduled:
            if scheduled.fault.kind.each_group and scheduled.first <= tick:
                place = scheduled.fault.place
                start_s[place] = max(start_s[place], scheduled.first * self.period_s)
        return start_s

    def _in_ticks(self, fault: Fault) -> ScheduledFault:
        interval = (
            max(1, round(fault.effective_value / self.period_s)) if fault.failure_mode.intermittent else 0
        )
        end = NEVER if fault.end_s is None else self._tick(fault.end_s)
        name, part = part_name(fault, self._groups), part_of(fault, self._groups)
        return ScheduledFault(fault, name, part, self._tick(fault.start_s), end, interval)

    def _tick(self, t_s: float) -> int:
        periods = t_s / self.period_s
        nearest = round(periods)
        return nearest if abs(periods - nearest) <= ROUNDING else ceil(periods)

    def _acts(self, scheduled: ScheduledFault, tick: int) -> bool:
        if not scheduled.first <= tick < scheduled.end:
            return False
        if not scheduled.interval:
            return True
        key = stream_key(f"{scheduled.name} intermittent")
        generator = np.random.default_rng([self._seed, key, tick // scheduled.interval])
        return bool(generator.random() < 0.5)

    @staticmethod
    def _next(scheduled: ScheduledFault, tick: int) -> int:
        if tick < scheduled.first:
            return scheduled.first
        if tick >= scheduled.end:
            return NEVER
        interval_end = (tick // scheduled.interval + 1) * scheduled.interval if scheduled.interval else NEVER
        return min(scheduled.end, interval_end)


def noise_streams(faults: tuple[Fault, ...], groups: int) -> Streams:
    """Return the random streams of the noise of faults, one for each part."""
    return tuple((f"{name} noise", NUMBERS_PER_PART) for name in _noisy(faults, groups))


def _noisy(faults: tuple[Fault, ...], groups: int) -> tuple[str, ...]:
    """Return the names of the parts with a noise fault."""
    return tuple(dict.fromkeys(part_name(fault, groups) for fault in faults if fault.mode == "noise"))


def part_name(fault: Fault, groups: int) -> str:
    """Return the canonical name of the part that a fault modifies."""
    return fault.kind.names(groups)[fault.place]


@cache
def part_names(groups: int) -> tuple[str, ...]:
    """Return the names of all parts that can fail, in the order of the targets."""
    return tuple(name for target in TARGETS.values() for name in target.names(groups))


def part_of(fault: Fault, groups: int) -> int:
    """Return the index of the part that a fault modifies, among all parts."""
    before = 0
    for target in TARGETS.values():
        if target is fault.kind:
            return before + fault.place
        before += len(target.names(groups))
    raise AssertionError(fault.target)  # `Fault` has checked it
