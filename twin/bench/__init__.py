"""Interactive bench: a twin that runs at the pace of the clock and executes commands."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any

from pydantic.fields import FieldInfo

from spheretwin.bench.bench_state import BenchState
from spheretwin.bench.command_queue import (
    By,
    Command,
    CommandOutcome,
    Ticket,
    check_arguments,
    settled_ticket,
)
from spheretwin.bench.commands import documentation, find_command
from spheretwin.bench.cycle import CommandProcessor, Cycle
from spheretwin.bench.folder import Folder
from spheretwin.bench.operators import Operators
from spheretwin.bench.status import BenchStatus
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.telemetry.table import Sink
from spheretwin.scenario.reading import described_fields
from spheretwin.scenario.sections import Scenario
from spheretwin.scenario.writing import as_command, as_toml
from spheretwin.session import Session
from spheretwin.trajectories.trajectory import Shape
from spheretwin.viz.bench.protocols import Bins

# Period at which `until` looks at the status.
POLL_s = 0.005


class Bench:
    """Twin that executes commands at the pace of the clock.

    ``with Bench(scenario) as bench: bench.begin()`` runs it in a separate thread. Without `begin`, only
    `advance` and `until` move time. `do` executes a command and raises its refusal, `until` waits for a
    condition of the status, `command` never waits. The bench begins paused, in the mode of its scenario. The
    clock decides only at which tick a command acts: the same commands at the same ticks give the same bytes.

    Parameters
    ----------
    scenario : Scenario
        From `scenario.load`.
    operators : Operators, optional
        Clients and their permission to command.
    folder : Folder, optional
        Folder of the files that commands name, which must be below it; default: the working folder, and files
        may be anywhere.
    machine : Session, optional
        Session of the scenario whose plant is a machine, from `machine.Link.session`. Commands that stop or
        change the time, or that only a simulated plant can follow, are refused.
    sinks : sequence of Sink, optional
        Receive the rows of all runs.

    Notes
    -----
    Commands, with their arguments:

    """

    def __init__(
        self,
        scenario: Scenario,
        operators: Operators | None = None,
        folder: Folder | None = None,
        machine: Session | None = None,
        sinks: Sequence[Sink] = (),
    ) -> None:
        self._bench_state = BenchState(scenario, operators or Operators(), folder, machine, sinks)
        self._processor = CommandProcessor(self._bench_state)
        self._cycle = Cycle(self._bench_state, self._processor)

    @property
    def actuator(self) -> Actuator:
        """Actuator of the present run."""
        return self._bench_state.driver.session.actuator

    @property
    def trajectory(self) -> Shape:
        """Shape that the settings have, whatever the mode."""
        return self._bench_state.driver.settings.trajectory

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
            if self._bench_state.is_machine and command.simulated_only:
                raise InputError(f"bench: expected a command for a real machine, received {name}")
            if command.by is By.CLIENT:
                return self._client_command(command, client, values)
            if command.by is By.OPERATOR:
                self._bench_state.operators.check(client)
            return self._processor.submit(command, values)
        except InputError as error:
            self._bench_state.refused = f"{error}"
            return settled_ticket(str(error))

    def may_command(self, client: str) -> bool:
        """Return True if a client operates now."""
        return self._bench_state.operators.may_command(client)

    @property
    def stalled(self) -> bool:
        """True if the loop does not return."""
        return self._processor.stalled

    def do(self, name: str, /, timeout_s: float = 60.0, **arguments: Any) -> BenchStatus:
        """Execute a command and wait for it; return the status after it.

        Parameters
        ----------
        name : str
            Name of the command.
        timeout_s : float, s
            Time to wait; the first use of a law or of a fault may have to be compiled.
        **arguments
            Arguments of the command, in JSON types.

        Raises
        ------
        InputError
            The command was refused.
        SpheretwinError
            It was not executed in time; it may be executed later.
        """
        ticket = self.command(name, **arguments)
        if not self._cycle.started:
            self.advance(0)
        match ticket.wait(timeout_s):
            case CommandOutcome.REFUSED:
                raise InputError(f"{ticket.refused}")
            case CommandOutcome.TIMED_OUT:
                raise SpheretwinError(
                    f"bench: expected {name} to be executed within {timeout_s:g} s, received no outcome"
                )
        return self.state()

    def until(self, condition: Callable[[BenchStatus], object], timeout_s: float = 60.0) -> BenchStatus:
        """Wait until a condition of the status is true; return that status.

        Parameters
        ----------
        condition : callable
            Takes the status.
        timeout_s : float, s
            Longest time to wait, of the clock; of a bench without `begin`, which is advanced meanwhile, of
            the simulation.

        Raises
        ------
        SpheretwinError
            The condition was not true in time, or the run has ended before.
        """
        status, end_s = self.state(), time.monotonic() + timeout_s
        end_tick = status.tick + round(timeout_s / status.period_s)
        while not condition(status):
            in_time = time.monotonic() < end_s if self._cycle.started else status.tick < end_tick
            if status.mode == "fault" or not in_time:
                reason = status.reason or f"it was not within {timeout_s:g} s"
                raise SpheretwinError(f"bench: expected the condition to become true, received: {reason}")
            if self._cycle.started:
                time.sleep(POLL_s)
            elif not self.advance(1):
                raise SpheretwinError("bench: expected time to run until the condition, received a pause")
            status = self.state()
        return status

    def state(self) -> BenchStatus:
        """Return the latest status; does not wait for the loop."""
        return self._cycle.state

    def bins(self, after: int = -1) -> Bins:
        """Return the rows of the last minute as bins of 20 ms, of a replay or of the twin.

        Parameters
        ----------
        after : int
            Only bins with a larger number.

        Returns
        -------
        Bins
            Number of the run, numbers of the bins, and by signal, as (n, size) arrays, oldest first: the
            first row of each bin, and the least and the greatest values of all its rows. Rows at 50 Hz do
            not show what a current does between them. The signals are ``t_s``, ``q_rad``, ``q_ref_rad``,
            ``error_rad``, ``torque_command_Nm``, ``torque_Nm``, ``disturbance_Nm``, ``current_command_A``,
            ``current_A``, ``allocation_scale``, the rates, and ``coil_temperature_degC``, which is NaN if
            the hardware has no windings with temperatures. References and error are NaN where none applies:
            in the modes ``off`` and ``manual``.
        """
        return (self._bench_state.player or self._bench_state).history.read(after)

    def captured(self) -> dict[str, Array]:
        """Return every row of the completed capture by signal, as `bins`; empty without one."""
        return self._bench_state.capture.read()

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
        active = self._bench_state.driver.session.scenario
        return described_fields(active.model_copy(update={"trajectory": self.trajectory}))

    def advance(self, ticks: int) -> int:
        """Execute the waiting commands, then run control ticks, at once; return how many were run.

        The thread does the same chunk by chunk. Refused while the thread runs.

        Raises
        ------
        SpheretwinError
            The bench runs in its thread, or is closed.
        """
        if self._cycle.started or not self._processor.open:
            raise SpheretwinError("bench: expected one that waits for advance, received one at work")
        return self._cycle.run_chunk(ticks, waits=True)

    def begin(self) -> None:
        """Run in a separate thread from now on.

        Until `close`, the interpreter switches threads every millisecond.
        """
        if not self._cycle.started and self._processor.open:
            self._cycle.begin()

    def close(self) -> None:
        """End the thread and complete the recordings."""
        bench_state = self._bench_state
        self._processor.open = False
        self._cycle.end()
        self._processor.close()
        bench_state.recording.end(bench_state.driver.session, None)
        bench_state.recording.join()
        self._cycle.show()  # with the files that were completed
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


Bench.__doc__ = f"{inspect.cleandoc(Bench.__doc__ or '')}\n\n{documentation()}"
