"""State of one bench: the twin, its clock, its commands, its recordings and what is shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from spheretwin.analysis import recorded_run as reviewed
from spheretwin.bench.command_queue import Queue
from spheretwin.bench.driver import Driver, compiled_session, with_end_stops
from spheretwin.bench.folder import Folder
from spheretwin.bench.history import Capture, History, Trigger
from spheretwin.bench.operators import Operators
from spheretwin.bench.pace import Pace
from spheretwin.bench.recording import Recording
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.run_record import RunRecord
from spheretwin.models.telemetry.signals import common_signals
from spheretwin.models.telemetry.table import Sink, Table
from spheretwin.scenario.sections import Scenario
from spheretwin.session import Session

# Rows before the one that is sought that the plots show: more of them would keep STOP waiting.
SEEK_s = 10.0


class Player:
    """Player of one recorded run.

    Parameters
    ----------
    path : Path
        Telemetry or recording.

    Attributes
    ----------
    scenario, law, shape, allocation : str
        As the file of the run states.
    table : Table
    period_s : float
    place : int
        Rows that have been shown.
    range_s : (float, float), s
        Times of the first and the last row.
    history : History

    Raises
    ------
    InputError
        The file is not one of a run, or holds no rows.
    """

    def __init__(self, path: Path) -> None:
        run = reviewed.read(path)
        self.path, self.table = path, run.table
        self._groups = groups = run.table["current_A"].shape[1] if len(run.table) else 0
        if not {signal.name for signal in common_signals(max(groups, 1))} <= set(run.table):
            raise InputError(
                f"bench: expected rows of a complete run in {path}, received {len(run.table)} rows"
            )
        scenario = run.record.scenario
        self.period_s = run.period_s
        self.scenario, self.law = str(scenario["name"]), str(scenario["controller"]["law"])
        self.shape, self.allocation = str(scenario["trajectory"]["shape"]), str(scenario["allocation"])
        self.current_limit_A = float(scenario["nominal"]["current_limit_A"])
        self.range_s = float(self.table["t_s"].flat[0]), float(self.table["t_s"].flat[-1])
        self.seek(self.range_s[0])

    @property
    def ended(self) -> bool:
        """True if the last row is shown."""
        return self.place >= len(self.table)

    @property
    def row(self) -> Table:
        """The row that is shown."""
        return self.table.rows(self.place - 1, self.place)

    def seek(self, t_s: float) -> None:
        """Show the last row until a time, or the first one, with the rows of some seconds before it."""
        self.place = max(1, int(np.searchsorted(self.table["t_s"].reshape(-1), t_s + self.period_s / 2)))
        first = max(0, self.place - round(SEEK_s / self.period_s))
        self.history = History(self._groups, self.period_s)
        self.history.write(first, self.table.rows(first, self.place))

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
    folder : Folder, optional
        Folder of the files that commands name; default: the working folder, and files may be anywhere.
    machine : Session, optional
        Session whose plant is a machine, instead of one of the scenario.
    sinks : sequence of Sink
        Receive the rows of all runs.

    Attributes
    ----------
    is_machine : bool
    driver : Driver
    operators : Operators
    folder : Folder
    pace : Pace
    queue : Queue
    recording : Recording
    history : History
        History of the twin; a player has its own.
    capture : Capture
        Triggered capture of the twin.
    player : Player or None
        Run that is shown instead of the twin.
    running : bool
        Whether time runs.
    steps : int
        Ticks to be run while it does not.
    note, refused : str or None
        Last event without a command; last command that was refused, and the reason.
    stop_mode : str
        ``off`` or ``hold``: currents off at a STOP, or hold and then off.
    tried : set
        Fields and values that were tried outside the loop.
    """

    def __init__(
        self,
        scenario: Scenario,
        operators: Operators,
        folder: Folder | None = None,
        machine: Session | None = None,
        sinks: Sequence[Sink] = (),
    ) -> None:
        self.sinks, self.is_machine = sinks, machine is not None
        scenario = machine.initial_scenario if machine else with_end_stops(scenario)
        self.folder = folder or Folder(None, scenario)
        self.driver, self.operators = Driver(scenario, machine or compiled_session(scenario)), operators
        self.stop_mode = "off"
        self.pace, self.queue, self.recording = Pace(), Queue(), Recording(self.set_note)
        self.player: Player | None = None
        self.running, self.steps = False, 0
        self.note: str | None = None
        self.refused: str | None = None
        self.tried: set[tuple[str, object]] = set()
        self.history = self._new_history()
        self.arm(Trigger())

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

    def begin(self, settings: Scenario, session: Session, record: RunRecord) -> None:
        """Restart with a session at tick 0, paused."""
        same_groups = len(session.actuator.groups) == len(self.driver.session.actuator.groups)
        self.driver.begin(settings, session, record)
        self.player = None
        self.pause()
        self.history = self._new_history()
        self.arm(self.capture.trigger if same_groups else Trigger())
        self.recording.reset()
        self.pace.clear()

    def resume_after_restore(self, end: Callable[..., None] | None) -> None:
        """Continue from the restored session; `end` completes what was recorded."""
        session = self.driver.session
        self.recording.end(session, "the recording has ended: time went back", end)
        self.recording.resume_from(session)
        self.player, self.history = None, self._new_history()
        self.capture.clear()

    def arm(self, trigger: Trigger) -> None:
        """Capture the rows around the next event of a kind.

        Raises
        ------
        InputError
            The trigger has a signal that does not exist, or a time out of range.
        """
        session = self.driver.session
        period_s = session.scenario.controller.period_s
        self.capture = Capture(trigger, len(session.actuator.groups), period_s)

    def _new_history(self) -> History:
        session = self.driver.session
        return History(len(session.actuator.groups), session.scenario.controller.period_s)
