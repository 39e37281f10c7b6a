"""Commands on their way: bounded, and of those where only the last one matters, the last one."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from typing import Any

from spheretwin.models.base.errors import InputError
from spheretwin.twin.bench.command import Command

MOST_WAITING = 256


class Ticket:
    """What becomes of a command.

    Attributes
    ----------
    refused : str or None
        Why it was refused, in one line; None while it waits, and where it was done or another like it
        took its place.
    begun_s, settled_s : float
        Clock when it came, and when it was settled (`time.monotonic`).
    """

    def __init__(self, refused: str | None = None) -> None:
        self.refused: str | None = None
        self.begun_s = self.settled_s = time.monotonic()
        self._done = threading.Event()
        if refused is not None:
            self.settle(refused)

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
        self.refused, self.settled_s = refused, time.monotonic()
        self._done.set()


def settled() -> Ticket:
    """Ticket of what was done at once."""
    ticket = Ticket()
    ticket.settle()
    return ticket


class Waiting:
    """A command in the queue.

    Attributes
    ----------
    command : Command
    arguments : dict
        Checked.
    ticket : Ticket
    """

    def __init__(self, command: Command, arguments: dict[str, Any]) -> None:
        self.command, self.arguments, self.ticket = command, arguments, Ticket()


class Queue:
    """Commands of any threads for the one that acts on them, in the order of their coming.

    One that takes the place of another like it goes to the end: what was said last is done last.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: OrderedDict[object, Waiting] = OrderedDict()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, waiting: Waiting) -> None:
        """Let a command wait for its turn.

        Raises
        ------
        InputError
            Too many do.
        """
        key = _key(waiting)
        with self._lock:
            replaced = self._waiting.pop(key, None)
            if len(self._waiting) >= MOST_WAITING:
                name = waiting.command.name
                raise InputError(
                    f"bench: expected at most {MOST_WAITING} commands at a time, received {name} too"
                )
            self._waiting[key] = waiting
        if replaced:
            replaced.ticket.settle()

    def next(self) -> Waiting | None:
        """The command whose turn it is, if one waits; it waits no more."""
        with self._lock:
            return self._waiting.popitem(last=False)[1] if self._waiting else None


def _key(waiting: Waiting) -> object:
    """Equal for two commands of which only the last one matters."""
    only_last = waiting.command.only_last
    if only_last is None:
        return waiting
    return waiting.command.name, *(waiting.arguments[name] for name in only_last)
