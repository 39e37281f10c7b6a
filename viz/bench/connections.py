"""Sockets of a page: its control channel, and its socket with viser's messages at a limited rate."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

import websockets.asyncio.server as servers

from spheretwin.viz.bench.viser_internals import moved_thing

CONTROL = "spheretwin-bench"
"""Subprotocol of the control channel."""

# A person sends far less. Of more, only the last move of each thing is kept.
MOST_MESSAGES_PER_S = 300.0

# Messages that are no moves and wait; more wait in the socket.
MOST_WAITING = 300

Control = Callable[[str, int | None], object]
"""Takes ``stop`` or ``beat``, and the number of the page if it knows it."""


async def serve_control(connection: servers.ServerConnection, control: Control) -> None:
    """Read the control channel of a page: STOP, and its heartbeat.

    It is a socket of its own, so that nothing else of the page waits before it, and has no limit of a rate.
    """
    async for message in connection:
        word, _, number = message.partition(" ") if isinstance(message, str) else ("", "", "")
        if word in ("stop", "beat"):
            control(word, int(number) if number.isdecimal() and len(number) < 10 else None)
        await asyncio.sleep(0)  # a flood leaves time for the others


class PageConnection(servers.ServerConnection):
    """Socket of a page: it passes only messages of the forms of a page, at a limited rate.

    All that arrives is read at once, so that the socket stays open in a flood, and a button that is pressed
    after ten thousand moves of a slider waits for the last one only.
    """

    _due = 0.0
    _reader: asyncio.Task[None] | None = None

    async def recv(self, decode: bool | None = None) -> Any:
        """Return the next message; the control channel has no limit."""
        if self.subprotocol == CONTROL:
            return await super().recv(decode)
        if self._reader is None:
            self._waiting: OrderedDict[object, bytes] = OrderedDict()
            self._changed = asyncio.Event()
            self._reader = asyncio.create_task(self._read())
        now = asyncio.get_running_loop().time()
        self._due = max(self._due + 1 / MOST_MESSAGES_PER_S, now - 1.0)
        if self._due > now:
            await asyncio.sleep(self._due - now)
        while not self._waiting:
            if self._reader.done():
                self._reader.result()  # raises that the socket is closed
            await self._wait_for_change()
        message = self._waiting.popitem(last=False)[1]
        self._changed.set()
        return message

    async def _read(self) -> None:
        try:
            while True:
                raw = await super().recv()
                if not isinstance(raw, bytes) or (moved := moved_thing(raw)) is None:
                    continue
                self._waiting.pop(moved, None)
                self._waiting[moved] = raw  # at the end: the last move comes last
                self._changed.set()
                while len(self._waiting) >= MOST_WAITING:
                    await self._wait_for_change()
        finally:
            self._changed.set()

    async def _wait_for_change(self) -> None:
        self._changed.clear()
        await self._changed.wait()
