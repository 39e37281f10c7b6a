"""Permission to command: one client operates, the others watch and may ask to operate."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from spheretwin.bench.command_queue import Text
from spheretwin.models.base.errors import InputError, shown

GONE_s = 2.0
"""Time that the twin may run without its operator before it holds."""

SILENCE_s = 2.0
"""Silence after which a client counts as gone."""

MOST_CLIENTS = 64


class Operators:
    """Clients by their ids, and which of them operates.

    Parameters
    ----------
    gone_s : float, s
        Time after its operator left until the twin holds, unless another client takes over.
    silence_s : float, s
        Silence after which a client counts as gone, as if it had left.
    clock : callable
        Seconds that never go back.

    Notes
    -----
    The first client operates. A client that asks while none operates, operates from then on; else the first
    that asked operates when the operator leaves, is gone, or grants it.
    """

    def __init__(
        self,
        gone_s: float = GONE_s,
        silence_s: float = SILENCE_s,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._gone_s, self._silence_s, self._clock = gone_s, silence_s, clock
        self._lock = threading.RLock()
        self._last_heard_s: dict[str, float] = {}
        self._asking: list[str] = []
        self._left_s: float | None = None
        self.operator: str | None = None

    @property
    def watching(self) -> tuple[str, ...]:
        """Clients that do not operate."""
        with self._lock:
            return tuple(client for client in self._last_heard_s if client != self.operator)

    @property
    def asking(self) -> tuple[str, ...]:
        """Clients that ask to operate, the first one first."""
        with self._lock:
            return tuple(self._asking)

    def register(self, client: str) -> None:
        """Register that a client is present.

        Raises
        ------
        InputError
            There are too many.
        """
        with self._lock:
            self._note(client)

    def ask(self, client: str) -> None:
        """Let a client operate, or wait for it.

        Raises
        ------
        InputError
            There are too many.
        """
        with self._lock:
            self._note(client)
            if self.operator is None:
                self._operate(client)
            elif client != self.operator and client not in self._asking:
                self._asking.append(client)

    def grant(self, client: str, to: Text) -> None:
        """Let another client operate.

        Raises
        ------
        InputError
            A client that does not operate grants, the other client is unknown, or there are too many.
        """
        with self._lock:
            self._note(client)
            self.check(client)
            if to not in self._last_heard_s:
                raise InputError(
                    f"bench: expected one of {', '.join(self._last_heard_s)}, received {shown(to)}"
                )
            self._operate(to)
            self._asking = [asking for asking in self._asking if asking != to]

    def leave(self, client: str) -> None:
        """Remove a client that leaves."""
        with self._lock:
            self._drop(client)

    def may_command(self, client: str) -> bool:
        """True if a client operates."""
        return client == self.operator

    def check(self, client: str | None) -> None:
        """Check that a client may command; callers in the same process give no name and always may.

        Raises
        ------
        InputError
            Another client operates, or none does.
        """
        if client is not None and not self.may_command(client):
            raise InputError(
                f"bench: expected a command of {self.operator or 'a client that operates'},"
                f" received one of {shown(client)}"
            )

    def excuse(self, pause_s: float) -> None:
        """Do not count a time in which this process was too busy to hear its clients."""
        with self._lock:
            self._last_heard_s = {client: s + pause_s for client, s in self._last_heard_s.items()}

    def check_silence(self) -> bool:
        """Remove silent clients; return True, once, if the twin is without an operator from now on."""
        now = self._clock()
        with self._lock:
            gone = [
                client for client, heard_s in self._last_heard_s.items() if now - heard_s > self._silence_s
            ]
            fell_silent = self.operator in gone
            for client in gone:
                self._drop(client)
            waited = self._left_s is not None and now - self._left_s > self._gone_s
            if not fell_silent and not waited:
                return False
            self._left_s = None
            return True

    def _note(self, client: str) -> None:
        if client not in self._last_heard_s and len(self._last_heard_s) >= MOST_CLIENTS:
            raise InputError(f"bench: expected at most {MOST_CLIENTS} clients, received one more")
        first = not self._last_heard_s
        self._last_heard_s[client] = self._clock()
        if first:
            self._operate(client)

    def _drop(self, client: str) -> None:
        self._last_heard_s.pop(client, None)
        self._asking = [asking for asking in self._asking if asking != client]
        if client == self.operator:
            self.operator, self._left_s = None, self._clock()
            if self._asking:
                self._operate(self._asking.pop(0))

    def _operate(self, client: str) -> None:
        self.operator, self._left_s = client, None
