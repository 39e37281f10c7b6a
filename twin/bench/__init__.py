"""The machine of a bench: a twin that runs at the pace of the clock, and does what it is commanded."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.files import whole_file
from spheretwin.models.base.wording import one_line, without_breaks
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.bench.commands import COMMANDS, checked
from spheretwin.twin.bench.desk import Desk
from spheretwin.twin.bench.history import History
from spheretwin.twin.bench.keeping import Files, Keeping, warm
from spheretwin.twin.bench.modes import Limits
from spheretwin.twin.bench.operators import Operators
from spheretwin.twin.bench.pace import Pace
from spheretwin.twin.bench.player import Player
from spheretwin.twin.bench.queue import Queue, Ticket, Waiting
from spheretwin.twin.bench.settings import with_field
from spheretwin.twin.bench.state import Shown, State, pictured
from spheretwin.twin.faults.fault import Fault
from spheretwin.twin.faults.told import FaultLines
from spheretwin.twin.scenario.changing import is_fixed
from spheretwin.twin.scenario.fields import fields_of
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.scenario.writing import as_command, as_toml
from spheretwin.twin.session import Session
from spheretwin.twin.simulation import change_told

# What lets time go on, or STOP go: not where STOP came after it.
UNDONE_BY_STOP = ("reset", "load", "start", "step")

CLIENTS = ("hello", "beat", "ask", "leave", "grant")

# How long a thread may keep the interpreter from the loop's: of Python's own 5 ms, three make a chunk late.
SWITCH_s = 1e-3

# How often a bench at rest looks for clients that are gone.
REST_s = 0.02


class Bench:
    """A twin that does what it is commanded, at the pace of the clock.

    ``with Bench(scenario) as bench: bench.begin()`` runs it in a thread of its own; without `begin`, time
    goes on by `advance` alone. It begins paused, in the mode of its scenario. The clock decides at which tick
    a command acts, and nothing else: the same commands at the same ticks give the same bytes.

    Parameters
    ----------
    scenario : Scenario
        From `scenario.load`.
    operators : Operators, optional
        Who may command.

    Notes
    -----
    Commands, with their arguments:

    ==================================  ================================================================
    ``start``, ``pause``                let time go on, or not
    ``step``, ticks=1                   while paused: so many control ticks
    ``speed``, factor                   0.1 to as fast as possible (1e6); 1 is the clock's pace
    ``stop``                            STOP: currents to zero, latched until ``reset``
    ``reset``                           tick 0 of the present settings, with those that are pending; paused
    ``load``, source, overrides={}      tick 0 of another scenario, by name or file; paused
    ``snapshot``, ``restore``, name     keep all that the twin goes on from; back to it
    ``off``                             no currents; the rotor is free
    ``hold``                            come to rest here
    ``point``, pose_rad                 go there, within ``limits``
    ``trajectory``, fields=None         follow ``{"shape": "sinusoid", ...}``; the last one unless given
    ``jog``, rates_rad_s                turn at these rates, up to the edge of the workspace
    ``manual``, currents_A=None, group=None, current_A=1.0
                                        these currents, or one group alone at a current
    ``replay``, file                    show the rows of a recorded run; the twin stands still meanwhile, and
                                        any mode, ``hold`` say, goes back to it
    ``limits``, rate_rad_s=None, acceleration_rad_s2=None
                                        of the way to a pose or a shape
    ``set``, name, value                any field of the scenario, dotted; fixed ones wait for ``reset``
    ``add_fault``, fault                ``{"target": "coil.07", "mode": "open"}``, from now unless it says
    ``clear_faults``, place=None        all of them, or one by its place
    ``record``, recording=None, telemetry=None
                                        write .rrd and .parquet from now on
    ``keep``                            end that, and complete the files
    ``save``, file                      write the present settings as a scenario (TOML)
    ``hello``, ``beat``, ``leave``      a client is there, still there, or goes (client=...)
    ``ask``; ``grant``, to              a watching client asks to operate; the operator gives it over
    ==================================  ================================================================
    """

    def __init__(self, scenario: Scenario, operators: Operators | None = None) -> None:
        self._desk = Desk(scenario, Session(scenario))
        self._operators = operators or Operators()
        self._pace, self._queue = Pace(), Queue()
        self._player: Player | None = None
        self._keeping: Keeping | None = None
        self._keepings: list[Keeping] = []
        self._kept: tuple[str, ...] = ()
        self._note: str | None = None
        self._refused: str | None = None
        self._running, self._steps, self._noted = False, 0, (0, 0)
        self._warm: set[tuple[str, object]] = set()
        self._stops: list[Ticket] = []
        self._stopped_s = -math.inf
        self._outcomes: list[tuple[Ticket, str | None]] = []
        self._preparing: tuple[Waiting, Future[Any]] | None = None
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="bench")
        self._thread: threading.Thread | None = None
        self._open, self._wake, self._turning = True, threading.Event(), threading.Lock()
        self._told = FaultLines()
        self._history = self._new_history()
        self._state = self._picture()

    @property
    def actuator(self) -> Actuator:
        """Of the present run."""
        return self._desk.session.actuator

    def command(self, name: str, /, *, client: str | None = None, **arguments: Any) -> Ticket:
        """Tell it something; never waits, whatever is asked.

        Parameters
        ----------
        name : str
            Of a command.
        client : str, optional
            Who says it: refused where another one operates. Whoever has the bench in hand need not say.
        **arguments
            Of the command, as JSON has them.

        Returns
        -------
        Ticket
            Refused at once where the command is none, or not this client's to give; otherwise settled
            between two chunks.
        """
        try:
            found = checked(name, arguments)
            if name in CLIENTS:
                self._operators.say(name, client, **found)
                return _settled()
            if not COMMANDS[name].anyone:
                self._operators.check(client)
            if name == "stop":
                return self._stop_asked()
            command = Waiting(name, found)
            self._queue.put(command)
        except InputError as error:
            self._refused = f"{error}"
            return Ticket(str(error))
        return command.ticket

    def state(self) -> State:
        """The latest picture; does not wait for the loop."""
        return self._state

    def history(self) -> dict[str, NDArray[np.float64]]:
        """Rows of the last 10 s at 50 Hz, by signal: (n,) or (n, size) arrays, oldest first; a copy.

        ``t_s``, ``q_rad``, ``q_ref_rad``, ``error_rad``, ``torque_command_Nm``, ``torque_Nm``,
        ``disturbance_Nm``, ``current_command_A``, ``current_A``, ``allocation_scale``, and the rates.
        """
        return (self._player.history if self._player else self._history).read()

    def scenario_toml(self) -> str:
        """The present settings as a scenario file."""
        return as_toml(self._desk.settings)

    def command_line(self) -> str:
        """The present settings as a command line."""
        return as_command(self._desk.settings)

    def fields(self) -> list[tuple[str, Any, str]]:
        """Every field of the scenario in force: dotted name, value, meaning.

        The trajectory is the one that is set, whatever the mode makes of it meanwhile.
        """
        in_force, own = self._desk.session.scenario, self._desk.settings.trajectory
        found = fields_of(in_force.model_copy(update={"trajectory": own}))
        return [(name, value, field.description or "") for name, value, field in found]

    def advance(self, ticks: int) -> int:
        """Take the commands that wait, then run control ticks, at once; returns how many were run.

        What the thread does chunk by chunk. Refused while it is at work.

        Raises
        ------
        SpheretwinError
            The bench runs in a thread of its own, or is closed.
        """
        if self._thread or not self._open:
            raise SpheretwinError("bench: expected one that waits for advance, received one at work")
        return self._turn(ticks)

    def begin(self) -> None:
        """Run in a thread of its own from now on.

        Until `close`, the interpreter goes from thread to thread every millisecond.
        """
        if self._thread is None and self._open:
            self._switch_s = sys.getswitchinterval()
            sys.setswitchinterval(SWITCH_s)
            self._worker.submit(warm)
            self._thread = threading.Thread(target=self._loop, name="bench", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the thread, and complete what is being recorded."""
        self._open = False
        self._wake.set()
        if self._thread and self._thread.is_alive():
            self._thread.join()
            sys.setswitchinterval(self._switch_s)
        self._worker.shutdown()
        self._end_keeping(None)
        for keeping in list(self._keepings):
            keeping.join()
        self._state = self._picture()  # what was kept is known
        self._desk.session.close()

    def __enter__(self) -> Bench:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _stop_asked(self) -> Ticket:
        """STOP waits for nothing but the chunk that is at work."""
        ticket = Ticket()
        self._stopped_s = ticket.begun_s
        self._stops.append(ticket)
        self._wake.set()
        return ticket

    def _loop(self) -> None:
        """Chunk by chunk, each at its time; woken by STOP."""
        while self._open:
            moving = self._moves
            wait_s = self._pace.wait_s() if moving else REST_s
            if wait_s > 0 and self._wake.wait(wait_s):
                self._wake.clear()
                self._turn(0)
                continue
            if not moving:
                self._pace.rest()
            self._turn(self._pace.ticks(self._period_s) if moving else 0)

    @property
    def _moves(self) -> bool:
        return self._running or self._steps > 0

    @property
    def _period_s(self) -> float:
        return self._player.period_s if self._player else self._desk.session.scenario.controller.period_s

    def _turn(self, ticks: int) -> int:
        """One turn of the loop; whatever goes wrong in it is the run's end, not the bench's."""
        done = 0
        try:
            self._take_commands()
            self._settle()
            done = self._run(ticks)
            self._look_around()
        except Exception as error:
            self._desk.fail(error)
            self._running, self._steps = False, 0
        self._settle()
        self._show()
        return done

    def _show(self) -> None:
        """Make the next picture; where it cannot be made, the last one says so."""
        try:
            self._state = self._picture()
        except Exception as error:
            self._state = replace(self._state, mode="fault", reason=_told(error))

    def _settle(self) -> None:
        """Say what became of the commands, once it can be seen."""
        if not self._outcomes:
            return
        self._show()
        outcomes, self._outcomes = self._outcomes, []
        for ticket, refused in outcomes:
            ticket.settle(refused)

    def _take_commands(self) -> None:
        """Act on what waits, in its order; what is prepared beside the loop keeps the others waiting."""
        while self._stops:
            self._player, self._note = None, "STOP: currents are taken away until reset"
            self._desk.stop()
            self._outcomes.append((self._stops.pop(0), None))
        while self._open:
            if self._preparing:
                command, future = self._preparing
                if self._thread and not future.done():
                    return
                self._preparing = None
                self._act(command, future.result)
                continue
            waiting = self._queue.next()
            if waiting is None:
                return
            work = self._to_prepare(waiting)
            if work is None:
                self._act(waiting, lambda: None)
            else:
                self._preparing = waiting, self._worker.submit(work)

    def _act(self, command: Waiting, prepared: Callable[[], Any]) -> None:
        """Do what is commanded, or say why not."""
        try:
            if command.name in UNDONE_BY_STOP and command.ticket.begun_s <= self._stopped_s:
                raise InputError(f"bench: expected {command.name} after STOP, received it before")
            self._do(command.name, command.arguments, prepared())
        except Exception as error:  # files and laws of the user's may raise whatever they will
            told = f"{error}" if isinstance(error, SpheretwinError) else _told(error)
            self._refused = told
            self._outcomes.append((command.ticket, told))
            return
        self._outcomes.append((command.ticket, None))

    def _to_prepare(self, command: Waiting) -> Callable[[], Any] | None:
        """What a command needs that takes longer than a chunk; what it says is refused, is."""
        given, settings = command.arguments, self._desk.settings
        match command.name:
            case "reset":
                return lambda: (settings, Session(settings))
            case "load":
                return lambda: _loaded(given["source"], given["overrides"])
            case "record":
                paths = (given["recording"], given["telemetry"])
                return lambda: Files(self._desk.session, *(Path(path) if path else None for path in paths))
            case "replay":
                return lambda: Player(Path(given["file"]))
            case "save":
                return lambda: _written(Path(given["file"]), settings)
            case "set":
                return self._trial(given["name"], given["value"])
            case "add_fault":
                return self._trial("fault", given["fault"])
        return None

    def _trial(self, name: str, value: Any) -> Callable[[], None] | None:
        """A session of the settings to be, the first time that a field is set so: it may be compiled."""
        key, settings = (name, value if isinstance(value, str | bool) else type(value)), self._desk.settings
        cheap = name.split(".")[0] in ("trajectory", "disturbance") or key in self._warm
        if cheap and not is_fixed(name):
            return None

        def try_out() -> None:
            Session(with_field(settings, name, value)).close()
            self._warm.add(key)

        return try_out

    def _do(self, name: str, given: dict[str, Any], ready: Any) -> None:
        """Do one command; what it needs is ready."""
        desk = self._desk
        match name:
            case "start":
                self._check_going(name)
                self._running = True
            case "pause":
                self._running, self._steps = False, 0
            case "step":
                self._check_going(name)
                if self._running:
                    raise InputError("bench: expected step while paused, received it while time goes on")
                self._steps += given["ticks"]
            case "speed":
                self._pace.speed = given["factor"]
                self._pace.rest()
            case "reset" | "load":
                recorded = self._keeping is not None
                self._end_keeping(None)
                desk.session.close()
                desk.begin(*ready)
                self._begun_anew()
                self._note = "the recording has ended: the run was begun anew" if recorded else None
            case "snapshot":
                desk.snapshot(**given)
            case "restore":
                end = self._keeping.ending(desk.session) if self._keeping else None
                desk.restore(**given)
                self._end_keeping("the recording has ended: time went back", end)
                self._player, self._history = None, self._new_history()
                self._noted = len(desk.session.journal), len(desk.session.events)
            case "off" | "hold" | "point" | "trajectory" | "jog" | "manual":
                getattr(desk, name)(**given)
                self._player = None
            case "replay":
                self._player = ready
            case "limits":
                desk.limits = Limits(*(given[field] or own for field, own in desk.limits._asdict().items()))
            case "set":
                desk.set(**given)
            case "add_fault":
                desk.set("fault", given["fault"])
            case "clear_faults":
                desk.clear_faults(**given)
            case "record":
                self._record(ready)
            case "keep":
                if self._keeping is None:
                    raise InputError("bench: expected a recording to keep, received none")
                self._end_keeping(None)

    def _check_going(self, name: str) -> None:
        if self._player is None and self._desk.reason is not None:
            raise InputError(f"bench: expected reset, as the run has ended, received {name}")

    def _begun_anew(self) -> None:
        self._player, self._running, self._steps, self._note = None, False, 0, None
        self._told, self._history = FaultLines(), self._new_history()
        self._noted = (0, 0)
        self._pace.clear()

    def _new_history(self) -> History:
        session = self._desk.session
        return History(len(session.actuator.groups), session.scenario.controller.period_s)

    def _run(self, ticks: int) -> int:
        """Run a chunk, and hand its rows on."""
        if not self._running:
            ticks = min(ticks, self._steps)
        if ticks < 1:
            return 0
        began = time.monotonic()
        done = self._play(ticks) if self._player else self._simulate(ticks)
        self._steps -= min(done, self._steps)
        self._pace.ran(done, self._period_s, self._t_s, time.monotonic() - began)
        return done

    def _play(self, ticks: int) -> int:
        assert self._player
        done = self._player.advance(ticks)
        if self._player.over:
            self._running, self._steps = False, 0
        return done

    def _simulate(self, ticks: int) -> int:
        desk, done = self._desk, 0
        self._note_changes()
        while done < ticks and desk.reason is None:
            first = desk.session.tick
            rows = desk.advance(ticks - done)
            if rows is not None and len(rows):
                done += len(rows)
                self._history.write(first, rows)
                if self._keeping:
                    self._keeping.write(rows)
                    for t_s, text in self._told.of(rows):
                        self._keeping.note(t_s, text)
            self._note_changes()
        if desk.reason is not None:
            self._running, self._steps = False, 0
            self._end_keeping("the recording has ended: so has the run")
        return done

    def _note_changes(self) -> None:
        """Tell a recording what was changed since it was last told."""
        session, (made, planned) = self._desk.session, self._noted
        if self._keeping:
            period_s = session.scenario.controller.period_s
            for change in (*session.journal[made:], *session.events[planned:]):
                self._keeping.note(change.tick * period_s, change_told(change))
        self._noted = len(session.journal), len(session.events)

    def _look_around(self) -> None:
        """Hold the rotor where its operator is gone."""
        if not self._operators.look():
            return
        desk = self._desk
        self._note = "the operator is gone"
        if self._player is None and desk.moves:
            desk.hold()
            self._note = "the operator is gone: the twin holds"

    def _record(self, files: Files) -> None:
        if self._keeping is not None or self._desk.reason is not None:
            files.discard()
            raise InputError(
                "bench: expected keep before the next recording, received record"
                if self._keeping
                else "bench: expected a run that goes on, received record after its end"
            )
        self._note_changes()
        self._keeping = Keeping(files, self._desk.session, self._desk.begun)
        self._keepings.append(self._keeping)

    def _end_keeping(self, note: str | None, end: Callable[..., None] | None = None) -> None:
        """Complete what is being recorded, beside the loop."""
        if self._keeping is None:
            return
        keeping, self._keeping = self._keeping, None
        self._note = note
        (end or keeping.ending(self._desk.session))(self._told_kept)

    def _told_kept(self, keeping: Keeping) -> None:
        self._kept = tuple(str(path) for path in keeping.paths)
        if keeping.faults:
            self._kept, self._note = (), keeping.faults[0]
        self._keepings.remove(keeping)

    @property
    def _t_s(self) -> float:
        return float(self._player.row["t_s"][0]) if self._player else self._desk.session.t_s

    def _picture(self) -> State:
        """All that is shown, as it is now."""
        desk, player, keeping = self._desk, self._player, self._keeping
        session, operators, pace = desk.session, self._operators, self._pace
        if player:
            shown = Shown(player.row, player.place, player.period_s, player.current_limit_A)
        else:
            limit_A = session.scenario.nominal.current_limit_A or 0.0
            shown = Shown(desk.row, session.tick, self._period_s, limit_A)
        return pictured(
            shown,
            session,
            mode="replay" if player else "fault" if desk.reason is not None else desk.mode,
            running=self._moves,
            stopped=desk.stopped,
            scenario=player.name if player else session.scenario.name,
            law=player.law if player else session.scenario.controller.law,
            shape=player.shape if player else session.scenario.trajectory.shape,
            allocation=player.allocation if player else session.scenario.allocation,
            speed=pace.speed,
            realtime_factor=pace.reached(),
            chunks=pace.chunks,
            missed=pace.missed,
            missed_share=pace.missed_share,
            status=str(session.status),
            reason=desk.reason,
            faults=tuple(_fault_told(fault) for fault in session.scenario.fault),
            pending=desk.pending_told(),
            journal=len(session.journal),
            snapshots=tuple(desk.snapshots),
            recording=tuple(str(path) for path in keeping.paths) if keeping else (),
            kept=self._kept,
            note=self._note,
            operator=operators.operator,
            watching=operators.watching,
            asking=operators.asking,
            refused=self._refused,
            waiting=len(self._queue),
        )


def _settled() -> Ticket:
    ticket = Ticket()
    ticket.settle()
    return ticket


def _told(error: Exception) -> str:
    return one_line(f"{type(error).__name__}: {without_breaks(error) or 'no word of why'}")


def _loaded(source: str, overrides: dict[str, Any]) -> tuple[Scenario, Session]:
    scenario = scenarios.load(source, overrides)
    return scenario, Session(scenario)


def _written(path: Path, settings: Scenario) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(as_toml(settings), encoding="utf-8")


def _fault_told(fault: Fault) -> str:
    until = f" to {fault.end_s:g} s" if fault.end_s is not None else ""
    return f"{fault.target} {fault.mode} from {fault.start_s:g} s{until}"
