"""The bench: what its page may do and see."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import common_signals
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.bench.commands import checked
from spheretwin.twin.bench.state import State
from spheretwin.twin.scenario.fields import fields_of
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.session import Session


class Ticket:
    """What becomes of a command.

    Attributes
    ----------
    refused : str or None
        Why it was refused, in one line; None while it waits, and where it was done or another like it
        took its place.
    """

    def __init__(self, refused: str | None = None) -> None:
        self.refused = refused
        self._done = threading.Event()
        if refused:
            self._done.set()

    @property
    def done(self) -> bool:
        """Whether it waits no more."""
        return self._done.is_set()

    def wait(self, timeout_s: float = 5.0) -> str | None:
        """Wait until it is done or refused; returns why it was refused, if it was."""
        self._done.wait(timeout_s)
        return self.refused

    def settle(self, refused: str | None = None) -> None:
        """Say what became of it."""
        self.refused = refused
        self._done.set()


class Bench:
    """A twin that does what it is commanded, at the pace of the clock.

    ``with Bench(scenario) as bench: bench.begin()`` runs it in a thread of its own; without `begin`, time
    goes on by `advance` alone. It begins paused, in the mode of its scenario.

    Parameters
    ----------
    scenario : Scenario
        From `scenario.load`.

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
    ``replay``, file                    show the rows of a recorded run; the twin stands still meanwhile
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

    def __init__(self, scenario: Scenario) -> None:
        self._session = Session(scenario)
        self._lock = threading.Lock()
        self._waiting: list[tuple[str, dict[str, Any], Ticket]] = []
        self._running, self._refused = False, ""
        self._thread: threading.Thread | None = None
        self._open = True
        self._rows: deque[Table] = deque(maxlen=500)
        self._state = self._picture(None)

    @property
    def actuator(self) -> Actuator:
        """Of the present run."""
        return self._session.actuator

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
            Refused at once where the command is none; otherwise settled between two chunks.
        """
        try:
            found = checked(name, arguments)
        except InputError as error:
            return Ticket(str(error))
        ticket = Ticket()
        with self._lock:
            self._waiting.append((name, found, ticket))
        return ticket

    def state(self) -> State:
        """The latest picture; does not wait for the loop."""
        return self._state

    def history(self) -> dict[str, NDArray[np.float64]]:
        """Rows of the last 10 s at 50 Hz, by signal: (n,) or (n, size) arrays, oldest first; a copy.

        ``t_s``, ``q_rad``, ``q_ref_rad``, ``error_rad``, ``torque_command_Nm``, ``torque_Nm``,
        ``disturbance_Nm``, ``current_command_A``, ``current_A``, ``allocation_scale``.
        """
        tables = list(self._rows)
        names = [signal.name for signal in common_signals(len(self._session.actuator.groups))]
        return (
            {name: np.concatenate([table[name][-1:] for table in tables]) for name in names} if tables else {}
        )

    def advance(self, ticks: int) -> int:
        """Take the commands that wait, then run control ticks, at once; returns how many were run.

        What the thread does chunk by chunk. Refused while it is at work.
        """
        with self._lock:
            waiting, self._waiting = self._waiting, []
        for name, arguments, ticket in waiting:
            try:
                self._act(name, arguments)
                ticket.settle()
            except InputError as error:
                self._refused = f"{name}: {error}"
                ticket.settle(str(error))
        rows = self._session.advance(ticks if self._running else 0)
        if len(rows):
            self._rows.append(rows)
        self._state = self._picture(rows.rows(len(rows) - 1, len(rows)) if len(rows) else None)
        return len(rows)

    def begin(self) -> None:
        """Run in a thread of its own from now on."""
        self._thread = threading.Thread(target=self._loop, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread, and complete what is being recorded."""
        self._open = False
        if self._thread:
            self._thread.join()

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def scenario_toml(self) -> str:
        """The present settings as a scenario file."""
        raise NotImplementedError

    def command_line(self) -> str:
        """The present settings as a command line."""
        raise NotImplementedError

    def fields(self) -> list[tuple[str, Any, str]]:
        """Every field of the present settings: dotted name, value, meaning."""
        return [
            (name, value, field.description or "") for name, value, field in fields_of(self._session.scenario)
        ]

    def _loop(self) -> None:
        while self._open:
            self.advance(20)
            time.sleep(0.02)

    def _act(self, name: str, arguments: dict[str, Any]) -> None:
        if name in ("start", "pause"):
            self._running = name == "start"
        elif name == "set":
            self._session.set(**arguments)

    def _picture(self, row: Table | None) -> State:
        session, groups = self._session, len(self._session.actuator.groups)

        def of(name: str, size: int = 3) -> Any:
            return tuple(row[name][0].tolist()) if row else (0.0,) * size

        error = np.array(of("error_rad"))
        return State(
            mode="trajectory",
            running=self._running,
            stopped=False,
            scenario=session.scenario.name,
            law=session.scenario.controller.law,
            shape=session.scenario.trajectory.shape,
            allocation=session.scenario.allocation,
            t_s=session.t_s,
            tick=session.tick,
            period_s=session.scenario.controller.period_s,
            speed=1.0,
            realtime_factor=1.0,
            chunks=0,
            missed=0,
            missed_share=0.0,
            q_rad=tuple(session.q_rad.tolist()),
            qdot_rad_s=of("qdot_rad_s"),
            q_ref_rad=of("q_ref_rad"),
            qdot_ref_rad_s=of("qdot_ref_rad_s"),
            error_rad=of("error_rad"),
            error_mrad=float(1e3 * np.linalg.norm(error)),
            error_deg=float(np.degrees(np.linalg.norm(error))),
            torque_command_Nm=of("torque_command_Nm"),
            torque_Nm=of("torque_Nm"),
            disturbance_Nm=of("disturbance_Nm"),
            current_command_A=of("current_command_A", groups),
            current_A=of("current_A", groups),
            current_limit_A=session.scenario.drive.current_limit_A or 0.0,
            temperature_C=None,
            torque_margin=1.0,
            saturated=False,
            status=str(session.status),
            reason=None,
            faults=(),
            pending=(),
            journal=len(session.journal),
            snapshots=(),
            recording=(),
            kept=(),
            note=None,
            operator=None,
            watching=(),
            asking=(),
            refused=self._refused or None,
            waiting=len(self._waiting),
        )
