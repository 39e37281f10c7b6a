"""Interactive bench: a twin that runs at the pace of the clock and executes commands."""

from __future__ import annotations

from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic.fields import FieldInfo

from spheretwin.bench.bench_state import BenchState
from spheretwin.bench.command_queue import By, Command, Ticket, check_arguments, settled_ticket
from spheretwin.bench.commands import find_command
from spheretwin.bench.cycle import CommandProcessor, Cycle, Thread
from spheretwin.bench.operators import Operators
from spheretwin.bench.status import BenchStatus, bench_status
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.scenario.reading import described_fields
from spheretwin.scenario.sections import Scenario
from spheretwin.scenario.writing import as_command, as_toml


class Bench:
    """Twin that executes commands at the pace of the clock.

    ``with Bench(scenario) as bench: bench.begin()`` runs it in a separate thread. Without `begin`, only
    `advance` moves time. The bench begins paused, in the mode of its scenario. The clock decides only at
    which tick a command acts: the same commands at the same ticks give the same bytes.

    Parameters
    ----------
    scenario : Scenario
        From `scenario.load`.
    operators : Operators, optional
        Clients and their permission to command.

    Notes
    -----
    Commands, with their arguments:

    ==================================  ================================================================
    ``start``, ``pause``                run or pause the time
    ``step``, ticks=1                   while paused: run this many control ticks
    ``speed``, factor                   0.1 to as fast as possible (1e6); 1 is the clock's pace
    ``stop``                            STOP: currents to zero, latched until ``reset``
    ``reset``                           tick 0 of the present settings and the pending ones; paused
    ``load``, source, overrides={}      tick 0 of another scenario, by name or file; paused
    ``snapshot``, ``restore``, name     save the complete state of the twin; return to it
    ``off``                             no currents; the rotor is free
    ``hold``                            come to rest at the present pose
    ``point``, pose_rad                 go there, within ``limits``
    ``trajectory``, fields=None         follow ``{"shape": "sinusoid", ...}``; default: the last one
    ``jog``, rates_rad_s                turn at these rates, up to the edge of the workspace
    ``manual``, currents_A=None, group=None, current_A=1.0
                                        these currents, or a single group at a current
    ``replay``, file                    show the rows of a recorded run; the twin is paused meanwhile, and
                                        any mode, for example ``hold``, ends the replay
    ``limits``, rate_rad_s=None, acceleration_rad_s2=None
                                        limits of the approach to a pose or a shape
    ``set``, name, value                any field of the scenario, dotted; fixed ones wait for ``reset``
    ``add_fault``, fault                ``{"target": "coil.07", "mode": "open"}``; default start: now
    ``clear_faults``, place=None        all of them, or one by its place
    ``record``, recording=None, telemetry=None
                                        write .rrd and .parquet from now on
    ``keep``                            end that, and complete the files
    ``save``, file                      write the present settings as a scenario (TOML)
    ``hello``, ``beat``, ``leave``      a client connects, is present, or leaves (client=...)
    ``ask``; ``grant``, to              a watching client asks to operate; the operator grants it
    ==================================  ================================================================
    """

    def __init__(self, scenario: Scenario, operators: Operators | None = None) -> None:
        self._bench_state = BenchState(scenario, operators or Operators())
        self._processor = CommandProcessor(self._bench_state)
        self._cycle = Cycle(self._bench_state, self._processor)
        self._thread = Thread(self._bench_state, self._processor, self._cycle)

    @property
    def actuator(self) -> Actuator:
        """Actuator of the present run."""
        return self._bench_state.driver.session.actuator

    def command(self, name: str, /, *, client: str | None = None, **arguments: Any) -> Ticket:
        """Submit a command; never waits.

        Parameters
        ----------
        name : str
            Name of the command.
        client : str, optional
            Client that sends it: refused if another one operates. Callers in the same process can omit it.
        **arguments
            Arguments of the command, in JSON types.

        Returns
        -------
        Ticket
            Refused at once if the command is unknown or not permitted to this client; otherwise settled
            between two chunks.
        """
        try:
            command = find_command(name)
            values = check_arguments(command, arguments)
            if command.by is By.CLIENT:
                return self._client_command(command, client, values)
            if command.by is By.OPERATOR:
                self._bench_state.operators.check(client)
            return self._processor.submit(command, values)
        except InputError as error:
            self._bench_state.refused = f"{error}"
            return settled_ticket(str(error))

    def state(self) -> BenchStatus:
        """Return the latest status; does not wait for the loop."""
        return self._cycle.state

    def history(self) -> dict[str, NDArray[np.float64]]:
        """Return a copy of the rows of the last 10 s at 50 Hz, as (n,) or (n, size) arrays, oldest first.

        ``t_s``, ``q_rad``, ``q_ref_rad``, ``error_rad``, ``torque_command_Nm``, ``torque_Nm``,
        ``disturbance_Nm``, ``current_command_A``, ``current_A``, ``allocation_scale``, and the rates.
        """
        return (self._bench_state.player or self._bench_state).history.read()

    def bounds(self) -> tuple[dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]]]:
        """Return the least and the greatest values of all ticks in each 20 ms of the last 10 s, as `history`.

        Rows at 50 Hz do not show what a current does between them.
        """
        return (self._bench_state.player or self._bench_state).history.read_bounds()

    def scenario_toml(self) -> str:
        """Return the present settings as a scenario file."""
        return as_toml(self._bench_state.driver.settings)

    def command_line(self) -> str:
        """Return the present settings as a command line."""
        return as_command(self._bench_state.driver.settings)

    def fields(self) -> list[tuple[str, Any, FieldInfo]]:
        """Return every field of the active scenario: dotted name, value, description.

        The trajectory is the one that is set, whatever the mode.
        """
        driver = self._bench_state.driver
        active = driver.session.scenario.model_copy(update={"trajectory": driver.settings.trajectory})
        return described_fields(active)

    def advance(self, ticks: int) -> int:
        """Execute the waiting commands, then run control ticks, at once; return how many were run.

        The thread does the same chunk by chunk. Refused while the thread runs.

        Raises
        ------
        SpheretwinError
            The bench runs in its thread, or is closed.
        """
        if self._thread.started or not self._processor.open:
            raise SpheretwinError("bench: expected one that waits for advance, received one at work")
        return self._cycle.run_chunk(ticks, waits=True)

    def begin(self) -> None:
        """Run in a separate thread from now on.

        Until `close`, the interpreter switches threads every millisecond.
        """
        if not self._thread.started and self._processor.open:
            self._thread.begin()

    def close(self) -> None:
        """End the thread and complete the recordings."""
        bench_state = self._bench_state
        self._processor.open = False
        self._thread.end()
        self._processor.close()
        bench_state.recording.end(bench_state.driver.session, None)
        bench_state.recording.join()
        self._cycle.state = bench_status(bench_state)  # with the files that were completed
        bench_state.driver.session.close()

    def __enter__(self) -> Bench:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _client_command(self, command: Command, client: str | None, values: dict[str, Any]) -> Ticket:
        """Execute a client's command about itself at once."""
        if client is None:
            raise InputError(f"bench: expected {command.name} of a client, received none")
        command.action(self._bench_state.operators, client, **values)
        return settled_ticket()
