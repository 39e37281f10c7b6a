"""Cycle of a bench: commands are executed, then a chunk of ticks is run or of recorded rows is shown."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from spheretwin.bench.bench_state import BenchState, Player
from spheretwin.bench.command_queue import Command, QueuedCommand, Ticket, settled_ticket
from spheretwin.bench.preparation import Preparation
from spheretwin.bench.recording import import_writers
from spheretwin.bench.status import BenchStatus, bench_status
from spheretwin.bench.supervisor import COMMAND_s, Supervisor, TICKS_s
from spheretwin.models.base.errors import InputError, SpheretwinError, exception_text, one_line
from spheretwin.models.base.user_code import only_loaded
from spheretwin.viz.bench.protocols import NO_REFERENCE

# Longest time that a thread may keep the interpreter from the loop: three of Python's 5 ms make a chunk late.
SWITCH_s = 1e-3

# Period at which an idle bench looks for silent clients.
REST_s = 0.02

# Time between two chunks beyond which this process was too busy to hear its clients: a compilation.
BUSY_s = 0.5


class CommandProcessor:
    """Executes the commands of one bench in the loop's thread.

    Parameters
    ----------
    bench_state : BenchState

    Attributes
    ----------
    wake : threading.Event
        Set when an urgent command arrives.
    outcomes : list of (Ticket, str or None)
        Executed commands, each with the reason if it was refused.
    stalled : bool
        Whether the loop has stalled: it executes no command.
    """

    def __init__(self, bench_state: BenchState) -> None:
        self._bench_state = bench_state
        self.wake = threading.Event()
        self.outcomes: list[tuple[Ticket, str | None]] = []
        self._urgent: list[QueuedCommand] = []
        self._urgent_s = -math.inf
        self._preparing: tuple[QueuedCommand, Preparation] | None = None
        self.open, self.stalled = True, False

    def submit(self, command: Command, arguments: dict[str, Any]) -> Ticket:
        """Queue a command, from any thread; its arguments are checked already.

        Raises
        ------
        InputError
            Too many are waiting, or the loop has stalled.
        """
        if self.stalled:
            if command.urgent:  # the currents are off
                return settled_ticket()
            raise InputError(f"bench: expected Ctrl-C, as the loop has stalled, received {command.name}")
        waiting = QueuedCommand(command, arguments)
        if command.urgent:
            self._urgent_s = waiting.ticket.created_s
            for same in self._urgent[:1]:  # one that waits is as good
                return same.ticket
            self._urgent.append(waiting)
            self.wake.set()
        else:
            self._bench_state.queue.put(waiting)
        return waiting.ticket

    def process(self, waits: bool) -> None:
        """Execute the waiting commands in order; one in preparation outside the loop delays the others.

        Parameters
        ----------
        waits : bool
            Whether to wait for the preparation.
        """
        self._process_urgent()
        while self.open:
            if self._preparing:
                waiting, preparation = self._preparing
                if not (waits or preparation.done):
                    return
                self._preparing = None
                self._act(waiting, preparation.result)
                continue
            following = self._bench_state.queue.next()
            if following is None:
                return
            self._act(following, lambda: None)

    def close(self) -> None:
        """Abandon the command that is being prepared."""
        if self._preparing:
            self._preparing[1].abandon()

    def _process_urgent(self) -> None:
        while self._urgent:
            waiting = self._urgent[0]  # it stays until it is executed: after an error it is tried again
            waiting.command.action(self._bench_state, **waiting.arguments)
            self.outcomes.append((self._urgent.pop(0).ticket, None))

    def _act(self, waiting: QueuedCommand, result: Callable[[], Any]) -> None:
        """Execute a command up to work outside the loop, or to its end; refuse it with the reason."""
        command, refused = waiting.command, None
        try:
            if command.cancelled_by_stop and waiting.ticket.created_s <= self._urgent_s:
                raise InputError(f"bench: expected {command.name} after STOP, received it before")
            with only_loaded():
                work = waiting.advance(self._bench_state, result)
            if work:
                self._preparing = waiting, Preparation(command.name, work)
                return
        # A command loads files and laws of the user, which may raise anything: it is refused.
        except Exception as error:
            refused = f"{error}" if isinstance(error, SpheretwinError) else error_text(error)
        self._settle(waiting, refused)

    def _settle(self, waiting: QueuedCommand, refused: str | None) -> None:
        if refused:
            self._bench_state.refused = refused
        self.outcomes.append((waiting.ticket, refused))


def error_text(error: Exception) -> str:
    """Return kind and reason of an error in one line."""
    return one_line(exception_text(error))


class Cycle:
    """Cycle of one bench, which runs in a thread of its own after `begin`.

    Parameters
    ----------
    bench_state : BenchState
    processor : CommandProcessor
        Executes the commands of the bench.

    Attributes
    ----------
    state : BenchStatus
        The latest status.
    supervisor : Supervisor
        Notices a chunk that does not return, as long as its thread runs.
    """

    def __init__(self, bench_state: BenchState, processor: CommandProcessor) -> None:
        self._bench_state, self._processor = bench_state, processor
        self.state: BenchStatus = bench_status(bench_state)
        self.supervisor = Supervisor(self._on_stall, self._on_return)
        self._thread: threading.Thread | None = None

    def run_chunk(self, ticks: int, waits: bool) -> int:
        """Execute the waiting commands, then run some ticks; return how many were run.

        Any error ends the run, but not the bench.

        Parameters
        ----------
        ticks : int
        waits : bool
            Whether to wait for the preparation of commands.
        """
        done = 0
        try:
            with self.supervisor.limited("a command", COMMAND_s):
                self._processor.process(waits)
                self._settle()
            done = self._run(ticks)
            self._hold_without_operator()
        # Any error: if the thread ended, STOP would no longer be executed.
        except Exception as error:
            self._bench_state.driver.fail(error)
            self._bench_state.pause()
        self._settle()
        self.show()
        return done

    def _run(self, ticks: int) -> int:
        """Run some ticks, while paused at most the requested steps; return how many were run."""
        bench_state = self._bench_state
        if not bench_state.running:
            ticks = min(ticks, bench_state.steps)
        if ticks < 1:
            return 0
        began = time.monotonic()
        done = self._play(bench_state.player, ticks) if bench_state.player else self._simulate(ticks)
        bench_state.steps -= min(done, bench_state.steps)
        bench_state.pace.record_chunk(done, bench_state.period_s, bench_state.t_s, time.monotonic() - began)
        return done

    def _play(self, player: Player, ticks: int) -> int:
        done = player.advance(ticks)
        if player.ended:
            self._bench_state.pause()
        return done

    def _simulate(self, ticks: int) -> int:
        bench_state, done = self._bench_state, 0
        driver, recording = bench_state.driver, bench_state.recording
        recording.note_changes(driver.session)
        while done < ticks and driver.reason is None:
            first = driver.session.tick
            with self.supervisor.limited(f"the law {driver.session.scenario.controller.law}", TICKS_s):
                rows = driver.advance(ticks - done)
            if rows is not None and len(rows):
                done += len(rows)
                bench_state.history.write(first, rows, driver.mode not in NO_REFERENCE)
                bench_state.capture.write(rows)
                recording.write(rows)
                for sink in bench_state.sinks:
                    sink.write(rows)
            recording.note_changes(driver.session)
        if driver.reason is not None:
            bench_state.pause()
            recording.end(driver.session, "the recording has ended: so has the run")
        return done

    def _on_stall(self, what: str) -> None:
        """Show and command zero currents, and complete the files; the loop itself cannot be stopped."""
        bench_state, processor = self._bench_state, self._processor
        if not processor.stalled:
            processor.stalled = True
            bench_state.driver.stall(what)
            bench_state.pause()
            bench_state.player = None
            bench_state.recording.end(bench_state.driver.session, "the recording has ended: the loop stalled")
        self.show()

    def _on_return(self) -> None:
        """Accept commands again: the run has ended, and a reset begins another one."""
        self._processor.stalled = False

    def show(self) -> None:
        """Update the status; if that fails, the last one reports the fault."""
        try:
            self.state = bench_status(self._bench_state)
            if self._processor.stalled:
                zero = (0.0,) * len(self.state.current_A)
                self.state = replace(self.state, current_A=zero, current_command_A=zero)
        # Any error of reading the status: pages must show it, not the last status as the present one.
        except Exception as error:
            self.state = replace(self.state, mode="fault", reason=error_text(error))

    def _settle(self) -> None:
        """Settle the tickets of executed commands, after the status shows their effect."""
        processor = self._processor
        if not processor.outcomes:
            return
        self.show()
        outcomes, processor.outcomes = processor.outcomes, []
        for ticket, refused in outcomes:
            ticket.settle(refused)

    def _hold_without_operator(self) -> None:
        """Hold the rotor if its operator is gone."""
        bench_state = self._bench_state
        if not bench_state.operators.check_silence():
            return
        bench_state.note = "the operator is gone"
        if bench_state.player is None and bench_state.driver.may_move_rotor:
            bench_state.driver.hold()
            bench_state.note = "the operator is gone: the twin holds"

    @property
    def started(self) -> bool:
        """True if its thread was started."""
        return self._thread is not None

    def begin(self) -> None:
        """Start the thread; until `end`, the interpreter switches threads more often."""
        import_writers()  # here, during the run it would make the first chunks
        self._switch_s = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_s)
        self._thread = threading.Thread(target=self._loop, name="bench", daemon=True)
        self._thread.start()
        self.supervisor.begin()

    def end(self) -> None:
        """Wait for the last chunk, unless the loop has stalled; no more commands are accepted."""
        self._processor.wake.set()
        if self._thread and self._thread.is_alive():
            while self._thread.is_alive() and not self._processor.stalled:
                self._thread.join(REST_s)
            sys.setswitchinterval(self._switch_s)
        self.supervisor.end()

    def _loop(self) -> None:
        """Run chunk by chunk, each at its time; STOP wakes the thread."""
        bench_state, pace, wake = self._bench_state, self._bench_state.pace, self._processor.wake
        before_s = time.monotonic()
        while self._processor.open:
            now_s = time.monotonic()
            if now_s - before_s > BUSY_s:
                bench_state.operators.excuse(now_s - before_s)
            before_s = now_s
            moves = bench_state.is_active
            wait_s = pace.wait_s() if moves else REST_s
            if wait_s > 0 and wake.wait(wait_s):
                wake.clear()
                self.run_chunk(0, waits=False)
                continue
            if not moves:
                pace.rest()
            self.run_chunk(pace.ticks(bench_state.period_s) if moves else 0, waits=False)
