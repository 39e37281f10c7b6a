"""State of one bench: the twin, its clock, its commands, its recordings and what is shown."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.analysis import recorded_run as reviewed
from spheretwin.bench.command_queue import Queue
from spheretwin.bench.driver import Driver, compiled_session
from spheretwin.bench.operators import Operators
from spheretwin.bench.pace import Pace
from spheretwin.bench.recording import Recording
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import common_signals, width
from spheretwin.models.telemetry.table import Table
from spheretwin.scenario.sections import Scenario
from spheretwin.session import Session

RATE_Hz = 50.0
LENGTH_s = 10.0


class _Bin(NamedTuple):
    """Rows within 1/50 s: the first of them, and the bounds of all."""

    number: int
    row: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


class History:
    """Newest rows of the signals of every run, and bounds of all rows; a reader never delays the writer.

    Parameters
    ----------
    groups : int
        Coil groups.
    period_s : float, s
        Period of the rows that are written.
    """

    def __init__(self, groups: int, period_s: float) -> None:
        self._signals = common_signals(groups)
        self._width = width(self._signals)
        self._stride = max(1, round(1 / (RATE_Hz * period_s)))
        self._bins: deque[_Bin] = deque(maxlen=round(LENGTH_s * RATE_Hz))

    def write(self, first_tick: int, rows: Table) -> None:
        """Add rows, in any chunks."""
        if not len(rows):
            return
        values = rows.values[:, : self._width]
        # A run begins its rows with these signals; a recording may have them in another order.
        if rows.signals[: len(self._signals)] != self._signals:
            parts = [rows[signal.name].reshape(len(rows), -1) for signal in self._signals]
            values = np.concatenate(parts, axis=1)
        numbers = (first_tick + np.arange(len(values))) // self._stride
        starts = np.flatnonzero(np.diff(numbers, prepend=numbers[0] - 1))[-(self._bins.maxlen or 0) :]
        values, starts, numbers = values[starts[0] :], starts - starts[0], numbers[starts]
        low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
        for place, number in enumerate(numbers.tolist()):
            latest = self._bins[-1] if self._bins else None
            new = _Bin(number, values[starts[place]].copy(), low[place], high[place])
            if latest and latest.number == number:
                bounds = np.minimum(latest.low, new.low), np.maximum(latest.high, new.high)
                self._bins[-1] = _Bin(number, latest.row, *bounds)
            else:
                self._bins.append(new)

    def read(self) -> dict[str, NDArray[np.float64]]:
        """Return the first row of each bin by signal, oldest first; a copy."""
        return self._by_signal([of.row for of in list(self._bins)])

    def read_bounds(self) -> tuple[dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]]]:
        """Return the least and the greatest values of all rows in each bin by signal, oldest first."""
        bins = list(self._bins)  # in one step: another thread may write
        return self._by_signal([of.low for of in bins]), self._by_signal([of.high for of in bins])

    def _by_signal(self, rows: list[NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        table = Table(self._signals, np.array(rows).reshape(len(rows), self._width))
        return {signal.name: table[signal.name] for signal in self._signals}


class Player:
    """Player of one recorded run.

    Parameters
    ----------
    path : Path
        Telemetry or recording.

    Attributes
    ----------
    name, law, shape, allocation : str
        As the file of the run states.
    table : Table
    period_s : float
    place : int
        Rows that have been shown.
    history : History

    Raises
    ------
    InputError
        The file is not one of a run, or holds no rows.
    """

    def __init__(self, path: Path) -> None:
        run = reviewed.read(path)
        self.path, self.table = path, run.table
        groups = run.table["current_A"].shape[1] if len(run.table) else 0
        known = {signal.name for signal in run.table.signals}
        if not {signal.name for signal in common_signals(max(groups, 1))} <= known:
            raise InputError(
                f"bench: expected rows of a complete run in {path}, received {len(run.table)} rows"
            )
        scenario = run.record.scenario
        self.period_s = run.period_s
        self.name, self.law = str(scenario["name"]), str(scenario["controller"]["law"])
        self.shape, self.allocation = str(scenario["trajectory"]["shape"]), str(scenario["allocation"])
        self.current_limit_A = float(scenario["nominal"]["current_limit_A"])
        self.place = 1
        self.history = History(groups, self.period_s)
        self.history.write(0, self.row)

    @property
    def ended(self) -> bool:
        """True if the last row is shown."""
        return self.place >= len(self.table)

    @property
    def row(self) -> Table:
        """The row that is shown."""
        return self.table.rows(self.place - 1, self.place)

    def advance(self, ticks: int) -> int:
        """Show some rows more; returns how many there were."""
        first = self.place
        self.place = min(first + ticks, len(self.table))
        self.history.write(first, self.table.rows(first, self.place))
        return self.place - first


class BenchState:
    """State of a bench, which begins paused.

    Parameters
    ----------
    scenario : Scenario
    operators : Operators

    Attributes
    ----------
    driver : Driver
    operators : Operators
    pace : Pace
    queue : Queue
    recording : Recording
    history : History
        History of the twin; a player has its own.
    player : Player or None
        Run that is shown instead of the twin.
    running : bool
        Whether time runs.
    steps : int
        Ticks to be run while it does not.
    note, refused : str or None
        Last event without a command; last command that was refused, and the reason.
    tried : set
        Fields and values that were tried outside the loop.
    """

    def __init__(self, scenario: Scenario, operators: Operators) -> None:
        self.driver, self.operators = Driver(scenario, compiled_session(scenario)), operators
        self.pace, self.queue, self.recording = Pace(), Queue(), Recording(self.set_note)
        self.player: Player | None = None
        self.running, self.steps = False, 0
        self.note: str | None = None
        self.refused: str | None = None
        self.tried: set[tuple[str, object]] = set()
        self.history = self._new_history()

    @property
    def is_active(self) -> bool:
        """True if there are ticks to run."""
        return self.running or self.steps > 0

    @property
    def period_s(self) -> float:
        """Period of the rows that are shown."""
        return self.player.period_s if self.player else self.driver.session.scenario.controller.period_s

    @property
    def t_s(self) -> float:
        """Simulated time of the row that is shown."""
        return float(self.player.row["t_s"][0]) if self.player else self.driver.session.t_s

    def set_note(self, text: str | None) -> None:
        """Set the note: the last event without a command."""
        self.note = text

    def pause(self) -> None:
        """Pause the time."""
        self.running, self.steps = False, 0

    def check_can_run(self, name: str) -> None:
        """Check that the run or replay that is shown can continue.

        Raises
        ------
        InputError
            It cannot continue; the message names the command `name`.
        """
        if self.player is None and self.driver.reason is not None:
            raise InputError(f"bench: expected reset, as the run has ended, received {name}")

    def begin(self, settings: Scenario, session: Session) -> None:
        """Restart with a session at tick 0, paused."""
        self.driver.begin(settings, session)
        self.player = None
        self.pause()
        self.history = self._new_history()
        self.recording.reset()
        self.pace.clear()

    def resume_after_restore(self, end: Callable[..., None] | None) -> None:
        """Continue from the restored session; `end` completes what was recorded."""
        session = self.driver.session
        self.recording.end(session, "the recording has ended: time went back", end)
        self.recording.resume_from(session)
        self.player, self.history = None, self._new_history()

    def _new_history(self) -> History:
        session = self.driver.session
        return History(len(session.actuator.groups), session.scenario.controller.period_s)
