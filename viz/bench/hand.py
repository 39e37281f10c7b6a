"""What a person does to a page becomes one command each; a refusal is shown beside what was touched."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from html import escape
from typing import Any

import viser

from spheretwin.viz.bench.machine import Bench, Ticket

# How long a refusal that belongs to no field stays.
SHOWN_S = 8.0

# Somebody who floods the bench sees no more than this of what becomes of it.
MOST_TICKETS = 200

Event = Any
"""Of viser's: it has the number of the page that it comes from."""


class Note:
    """A line under a field that says why its value was refused; nothing unless there is something to say.

    Parameters
    ----------
    gui : viser.GuiApi
        In the container of the field.
    order : float
        Of the field.
    """

    def __init__(self, gui: viser.GuiApi, order: float) -> None:
        self._html = gui.add_html("", order=order, visible=False)

    def say(self, text: str | None) -> None:
        """Show a text, or take it away."""
        if text:
            self._html.content = f'<div style="{_REFUSED}">{escape(text)}</div>'
        self._html.visible = bool(text)

    def remove(self) -> None:
        """Take its place away."""
        self._html.remove()


_REFUSED = "color:#ff8787;font-size:0.8em;line-height:1.25;padding:0 0.7em 0.3em;overflow-wrap:anywhere"


class Hand:
    """Passes commands on, and follows what becomes of them.

    Parameters
    ----------
    bench : Bench
        Whom it tells.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._lock = threading.Lock()
        self._open: list[tuple[str, Ticket, Note | None]] = []
        self._refused, self._until = "", 0.0

    @property
    def refused(self) -> str:
        """What was refused last and belongs to no field; empty after a while."""
        return self._refused if time.monotonic() < self._until else ""

    def tell(self, event: Event, name: str, /, beside: Note | None = None, **arguments: Any) -> None:
        """Tell the bench one thing in the name of the page that an event comes from."""
        ticket = self._bench.command(name, client=client_name(event.client_id), **arguments)
        with self._lock:
            self._open = [*self._open[-MOST_TICKETS:], (name, ticket, beside)]

    def complain(self, text: str, beside: Note | None = None) -> None:
        """Show why something never became a command."""
        if beside:
            beside.say(text)
        else:
            self._refused, self._until = text, time.monotonic() + SHOWN_S

    def settle(self) -> None:
        """Show what became of commands since."""
        with self._lock:
            settled = [each for each in self._open if each[1].done]
            self._open = [each for each in self._open if not each[1].done]
        for _, ticket, beside in settled:
            if ticket.refused:
                self.complain(ticket.refused, beside)
            elif beside:
                beside.say(None)

    def button(self, gui: viser.GuiApi, label: str, name: str, /, **more: Any) -> viser.GuiButtonHandle:
        """Add a button that is one command without arguments."""
        button = gui.add_button(label, **more)
        on_press(button, lambda event: self.tell(event, name))
        return button


def on_press(button: Any, act: Callable[[Event], None]) -> None:
    """Call a function at each press, or change of a value, on the server's own thread, in order."""

    @button.on_click if hasattr(button, "on_click") else button.on_update
    async def _(event: Event) -> None:
        act(event)


def client_name(number: int) -> str:
    """What the bench calls a page."""
    return f"page {number}"
