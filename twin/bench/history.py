"""Rows of a bench that are shown: the newest in bins with their bounds, and every row about an event."""

from __future__ import annotations

from collections import deque
from itertools import islice
from typing import Literal, NamedTuple

import numpy as np

from spheretwin.models.base.arrays import Array, Booleans
from spheretwin.models.base.errors import InputError, did_you_mean, shown
from spheretwin.models.telemetry.signals import Signal, common_signals, width
from spheretwin.models.telemetry.table import Table, saturated
from spheretwin.viz.bench.protocols import Bins

RATE_Hz = 50.0
LENGTH_s = 60.0

TEMPERATURE = "coil_temperature_degC"

REFERENCE = ("q_ref_rad", "qdot_ref_rad_s", "error_rad")
"""Signals that need a reference."""

# Time over which the variation of the commanded currents is averaged.
CHATTER_s = 1.0


def plotted_signals(groups: int) -> tuple[Signal, ...]:
    """Return the signals of every run, and the temperatures of the windings, NaN in a run without them."""
    return *common_signals(groups), Signal(TEMPERATURE, "°C", groups, "temperatures of the windings")


def plotted_values(rows: Table, signals: tuple[Signal, ...]) -> Array:
    """Return some signals of rows as (n, width); NaN for a signal that the rows do not have."""
    parts = [
        rows[signal.name].reshape(len(rows), -1)
        if signal.name in rows
        else np.full((len(rows), signal.size), np.nan)
        for signal in signals
    ]
    return np.concatenate(parts, axis=1)


class Bin(NamedTuple):
    """Rows within 1/50 s: the first of them, the bounds of all, and the variation of the commands."""

    number: int
    row: Array
    low: Array
    high: Array
    variation_A: float
    """Σ|Δi| of the commanded currents, mean over the groups."""


class History:
    """Newest rows of the plotted signals and bounds of all rows; a reader never delays the writer.

    Parameters
    ----------
    groups : int
        Coil groups.
    period_s : float, s
        Period of the rows that are written.
    """

    _created = 0

    def __init__(self, groups: int, period_s: float) -> None:
        History._created += 1
        self.run = History._created
        self._signals = plotted_signals(groups)
        self._width = width(self._signals)
        self._stride = max(1, round(1 / (RATE_Hz * period_s)))
        self._bin_s = self._stride * period_s
        self._bins: deque[Bin] = deque(maxlen=round(LENGTH_s * RATE_Hz))
        self._last_command: Array | None = None

    def write(self, first_tick: int, rows: Table, with_reference: bool = True) -> None:
        """Add rows, in any chunks; without a reference that applies, it and the error are NaN."""
        if not len(rows):
            return
        values = plotted_values(rows, self._signals)
        if not with_reference:
            names = [signal.name for signal in self._signals for _ in range(signal.size)]
            values[:, np.isin(names, REFERENCE)] = np.nan
        variation = self._variation(rows["current_command_A"].reshape(len(rows), -1))
        numbers = (first_tick + np.arange(len(values))) // self._stride
        starts = np.flatnonzero(np.diff(numbers, prepend=numbers[0] - 1))[-(self._bins.maxlen or 0) :]
        values, variation = values[starts[0] :], variation[starts[0] :]
        starts, numbers = starts - starts[0], numbers[starts]
        low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
        sums = np.add.reduceat(variation, starts)
        for place, number in enumerate(numbers.tolist()):
            new = Bin(number, values[starts[place]].copy(), low[place], high[place], float(sums[place]))
            if self._bins and self._bins[-1].number == number:
                self._bins[-1] = _merged(self._bins[-1], new)
            else:
                self._bins.append(new)

    @property
    def chatter_A_s(self) -> float:
        """Variation of the commanded currents in the last second, mean over the groups, A/s."""
        bins = list(islice(reversed(self._bins), round(CHATTER_s / self._bin_s)))
        return sum(of.variation_A for of in bins) / (len(bins) * self._bin_s) if bins else 0.0

    def read(self, after: int = -1) -> Bins:
        """Return the bins with a number above `after`."""
        bins = [of for of in list(self._bins) if of.number > after]  # a copy: another thread may write
        return Bins(
            self.run,
            [of.number for of in bins],
            self._by_signal([of.row for of in bins]),
            self._by_signal([of.low for of in bins]),
            self._by_signal([of.high for of in bins]),
        )

    def _variation(self, command_A: Array) -> Array:
        before = command_A[:1] if self._last_command is None else self._last_command
        self._last_command = command_A[-1:].copy()
        variation: Array = np.abs(np.diff(command_A, axis=0, prepend=before)).mean(axis=1)
        return variation

    def _by_signal(self, rows: list[Array]) -> dict[str, Array]:
        table = Table(self._signals, np.array(rows).reshape(len(rows), self._width))
        return {signal.name: table[signal.name] for signal in self._signals}


def _merged(first: Bin, second: Bin) -> Bin:
    return Bin(
        first.number,
        first.row,
        np.minimum(first.low, second.low),
        np.maximum(first.high, second.high),
        first.variation_A + second.variation_A,
    )


Event = Literal["off", "level", "fault", "saturation"]
Edge = Literal["rising", "falling"]

MOST_ROWS = 50_000


class Trigger(NamedTuple):
    """Event that a capture waits for, and the time that it keeps."""

    on: Event = "off"
    """``level``: an entry of a signal crosses a level; ``fault``: a fault begins; ``saturation``: the current
    limit begins to reduce the torque."""
    signal: str = "error_rad"
    entry: int = 0
    level: float = 0.0
    edge: Edge = "rising"
    before_s: float = 0.5
    length_s: float = 2.0


class Capture:
    """Capture of one event.

    Parameters
    ----------
    trigger : Trigger
    groups : int
        Coil groups.
    period_s : float, s
        Period of the rows.

    Attributes
    ----------
    state : str
        ``off``, ``armed``, ``triggered`` or ``complete``.
    t_s : float or None
        Time of the row of the event.

    Raises
    ------
    InputError
        The signal or its entry does not exist, or the capture is empty or too long.
    """

    def __init__(self, trigger: Trigger, groups: int, period_s: float) -> None:
        self.trigger, self._period_s, self._signals = trigger, period_s, plotted_signals(groups)
        self._check()
        self.rows_before = round(trigger.before_s / period_s)
        self._rows_after = round(trigger.length_s / period_s) - self.rows_before
        self.clear()

    def clear(self) -> None:
        """Arm again: the run has restarted."""
        self.state = "off" if self.trigger.on == "off" else "armed"
        self.t_s: float | None = None
        self._before: deque[Array] = deque()
        self._after: list[Array] = []
        self._last: bool | None = None
        self._failing: Array | None = None

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk."""
        if self.state in ("off", "complete") or not len(rows):
            return
        values = plotted_values(rows, self._signals)
        if self.state == "armed":
            event = self._event(rows)
            if event is None:
                self._keep_before(values)
                return
            self.state, self.t_s = "triggered", float(rows["t_s"].reshape(-1)[event])
            self._keep_before(values[:event])
            values = values[event:]
        self._after.append(values.copy())
        if sum(map(len, self._after)) >= self._rows_after:
            self.state = "complete"

    def read(self) -> dict[str, Array]:
        """Return every captured row by signal; empty until the capture is complete."""
        if self.state != "complete":
            return {}
        before = np.concatenate([*self._before, self._after[0][:0]])
        before = before[len(before) - min(len(before), self.rows_before) :]
        table = Table(self._signals, np.concatenate([before, *self._after])[: len(before) + self._rows_after])
        return {signal.name: table[signal.name] for signal in self._signals}

    def _keep_before(self, values: Array) -> None:
        self._before.append(values.copy())
        while sum(map(len, self._before)) - len(self._before[0]) >= self.rows_before > 0:
            self._before.popleft()
        if not self.rows_before:
            self._before.clear()

    def _event(self, rows: Table) -> int | None:
        """Return the first row at which the condition becomes true, if there is one."""
        if self.trigger.on == "fault":
            return self._fault(rows)
        if self.trigger.on == "saturation":
            true = saturated(rows).reshape(-1)
        else:
            true = self._beyond(rows[self.trigger.signal].reshape(len(rows), -1)[:, self.trigger.entry])
        before = true[0] if self._last is None else self._last
        self._last = bool(true[-1])
        begins = np.flatnonzero(true & ~np.concatenate([[before], true[:-1]]))
        return int(begins[0]) if len(begins) else None

    def _beyond(self, values: Array) -> Booleans:
        level = self.trigger.level
        return values > level if self.trigger.edge == "rising" else values < level

    def _fault(self, rows: Table) -> int | None:
        modes = rows["fault"].reshape(len(rows), -1) if "fault" in rows else np.zeros((len(rows), 0))
        before = self._failing
        if before is None:
            before = modes[0]
        elif len(before) != modes.shape[1]:  # other parts can fail from here on
            before = np.zeros(modes.shape[1])
        self._failing = modes[-1].copy()
        begins = (modes != np.concatenate([before[None], modes[:-1]])) & (modes != 0)
        places = np.flatnonzero(begins.any(axis=1))
        return int(places[0]) if len(places) else None

    def _check(self) -> None:
        trigger = self.trigger
        sizes = {signal.name: signal.size for signal in self._signals}
        if trigger.signal not in sizes:
            raise InputError(
                f"bench: capture: expected one of {', '.join(sizes)}, received {shown(trigger.signal)}"
                f"{did_you_mean(trigger.signal, sizes)}"
            )
        if not 0 <= trigger.entry < sizes[trigger.signal]:
            raise InputError(
                f"bench: capture: expected an entry of {trigger.signal} from 0 to"
                f" {sizes[trigger.signal] - 1}, received {trigger.entry}"
            )
        longest_s = MOST_ROWS * self._period_s
        if not 0 <= trigger.before_s < trigger.length_s <= longest_s:
            raise InputError(
                f"bench: capture: expected before_s from 0 to below length_s, and length_s of at most"
                f" {longest_s:g} s, received {trigger.before_s:g} and {trigger.length_s:g} s"
            )
