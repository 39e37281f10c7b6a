"""Commands are taken in their turn; what one of them needs is prepared beside the loop."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.base.wording import exception_text, one_line
from spheretwin.twin.bench.command import Command
from spheretwin.twin.bench.queue import Ticket, Waiting
from spheretwin.twin.bench.work.works import Works


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
