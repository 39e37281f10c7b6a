"""One chunk of a bench: ticks are run, or rows of a recorded run shown, and handed on."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

from spheretwin.bench.bench_state import Player, Works
from spheretwin.bench.command_queue import Command, Ticket, Waiting
from spheretwin.bench.status import State, picture
from spheretwin.models.base.errors import InputError, SpheretwinError, exception_text, one_line
from spheretwin.outputs import import_writers


def run(works: Works, ticks: int) -> int:
    """Run some ticks, no more than are asked for while paused; returns how many were run."""
    if not works.running:
        ticks = min(ticks, works.steps)
    if ticks < 1:
        return 0
    began = time.monotonic()
    done = _play(works, works.player, ticks) if works.player else _simulate(works, ticks)
    works.steps -= min(done, works.steps)
    works.pace.ran(done, works.period_s, works.t_s, time.monotonic() - began)
    return done


def _play(works: Works, player: Player, ticks: int) -> int:
    done = player.advance(ticks)
    if player.over:
        works.pause()
    return done


def _simulate(works: Works, ticks: int) -> int:
    desk, recording, done = works.desk, works.recording, 0
    recording.note_changes(desk.session)
    while done < ticks and desk.reason is None:
        first = desk.session.tick
        rows = desk.advance(ticks - done)
        if rows is not None and len(rows):
            done += len(rows)
            works.history.write(first, rows)
            recording.write(rows)
        recording.note_changes(desk.session)
    if desk.reason is not None:
        works.pause()
        recording.end(desk.session, "the recording has ended: so has the run")
    return done


class Taking:
    """Commands of one bench on their way from those who give them to what they act on.

    Parameters
    ----------
    works : Works

    Attributes
    ----------
    wake : threading.Event
        Set where one came that waits for no other.
    outcomes : list of (Ticket, str or None)
        Commands that were acted on, and why those that were refused were.
    """

    def __init__(self, works: Works) -> None:
        self._works = works
        self.wake = threading.Event()
        self.outcomes: list[tuple[Ticket, str | None]] = []
        self._first: list[Waiting] = []
        self._first_s = -math.inf
        self._preparing: tuple[Waiting, Future[Any]] | None = None
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="bench")
        self.open = True

    def ask(self, command: Command, arguments: dict[str, Any]) -> Ticket:
        """Let a command wait for its turn, from any thread; arguments are those that were checked.

        Raises
        ------
        InputError
            Too many do.
        """
        waiting = Waiting(command, arguments)
        if command.before_all:
            self._first_s = waiting.ticket.begun_s
            self._first.append(waiting)
            self.wake.set()
        else:
            self._works.queue.put(waiting)
        return waiting.ticket

    def take(self, waits: bool) -> None:
        """Act on what waits, in its order; what is prepared beside the loop keeps the others waiting.

        Parameters
        ----------
        waits : bool
            Whether to wait for what is prepared.
        """
        self._take_first()
        while self.open:
            if self._preparing:
                waiting, future = self._preparing
                if not (waits or future.done()):
                    return
                self._preparing = None
                self._act(waiting, future.result)
                continue
            following = self._works.queue.next()
            if following is None:
                return
            self._begin(following)

    def close(self) -> None:
        """Take no more; wait for what is being prepared."""
        self._worker.shutdown()

    def _take_first(self) -> None:
        while self._first:
            waiting = self._first[0]  # it stays until it is done: whatever goes wrong, it is tried again
            waiting.command.does(self._works, None, **waiting.arguments)
            self.outcomes.append((self._first.pop(0).ticket, None))

    def _begin(self, waiting: Waiting) -> None:
        """Act on a command, or let what it needs be prepared."""
        prepares = waiting.command.prepares
        work = prepares(self._works, **waiting.arguments) if prepares else None
        if work is None:
            self._act(waiting, lambda: None)
        else:
            self._preparing = waiting, self._worker.submit(work)

    def _act(self, waiting: Waiting, prepared: Callable[[], Any]) -> None:
        """Do what is commanded, or say why not."""
        command, refused = waiting.command, None
        try:
            if command.undone and waiting.ticket.begun_s <= self._first_s:
                raise InputError(f"bench: expected {command.name} after STOP, received it before")
            command.does(self._works, prepared(), **waiting.arguments)
        except Exception as error:  # files and laws of the user's may raise whatever they will
            refused = f"{error}" if isinstance(error, SpheretwinError) else told(error)
            self._works.refused = refused
        self.outcomes.append((waiting.ticket, refused))


def told(error: Exception) -> str:
    """What kind of error it is, and why, in one line."""
    return one_line(exception_text(error))


class Turning:
    """Turns of one bench.

    Parameters
    ----------
    works : Works
    taking : Taking
        Of its commands.

    Attributes
    ----------
    state : State
        The latest picture.
    """

    def __init__(self, works: Works, taking: Taking) -> None:
        self._works, self._taking = works, taking
        self.state: State = picture(works)

    def turn(self, ticks: int, waits: bool) -> int:
        """Take what waits, then run some ticks; returns how many were run.

        Whatever goes wrong is the run's end, not the bench's.

        Parameters
        ----------
        ticks : int
        waits : bool
            Whether to wait for what commands need.
        """
        done = 0
        try:
            self._taking.take(waits)
            self._settle()
            done = run(self._works, ticks)
            self._look_around()
        except Exception as error:  # of whatever kind, else the thread would end and STOP with it
            self._works.desk.fail(error)
            self._works.pause()
        self._settle()
        self._show()
        return done

    def _show(self) -> None:
        """Make the next picture; where it cannot be made, the last one says so."""
        try:
            self.state = picture(self._works)
        except Exception as error:  # a page must never show an old state as the present one
            self.state = replace(self.state, mode="fault", reason=told(error))

    def _settle(self) -> None:
        """Say what became of the commands, once it can be seen."""
        taking = self._taking
        if not taking.outcomes:
            return
        self._show()
        outcomes, taking.outcomes = taking.outcomes, []
        for ticket, refused in outcomes:
            ticket.settle(refused)

    def _look_around(self) -> None:
        """Hold the rotor where its operator is gone."""
        works = self._works
        if not works.operators.look():
            return
        works.note = "the operator is gone"
        if works.player is None and works.desk.moves:
            works.desk.hold()
            works.note = "the operator is gone: the twin holds"


# How long a thread may keep the interpreter from the loop's: of Python's own 5 ms, three make a chunk late.
SWITCH_s = 1e-3

# How often a bench at rest looks for clients that are gone.
REST_s = 0.02


class Thread:
    """Thread of one bench, which begins once.

    Parameters
    ----------
    works : Works
    taking : Taking
    turning : Turning
    """

    def __init__(self, works: Works, taking: Taking, turning: Turning) -> None:
        self._works, self._taking, self._turning = works, taking, turning
        self._thread: threading.Thread | None = None

    @property
    def begun(self) -> bool:
        """Whether it is at work, or was."""
        return self._thread is not None

    def begin(self) -> None:
        """Be at work from now on; until `end`, the interpreter goes from thread to thread more often."""
        import_writers()  # here, as during the loop it would delay the first chunks
        self._switch_s = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_s)
        self._thread = threading.Thread(target=self._loop, name="bench", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Wait until the last turn is done, as no more commands are taken."""
        self._taking.wake.set()
        if self._thread and self._thread.is_alive():
            self._thread.join()
            sys.setswitchinterval(self._switch_s)

    def _loop(self) -> None:
        """Chunk by chunk, each at its time; woken by STOP."""
        works, pace, wake = self._works, self._works.pace, self._taking.wake
        while self._taking.open:
            moves = works.moves
            wait_s = pace.wait_s() if moves else REST_s
            if wait_s > 0 and wake.wait(wait_s):
                wake.clear()
                self._turning.turn(0, waits=False)
                continue
            if not moves:
                pace.rest()
            self._turning.turn(pace.ticks(works.period_s) if moves else 0, waits=False)
