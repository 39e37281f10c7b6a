"""Event handlers of a page: each event becomes one command; a refusal is shown next to its control."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from html import escape
from typing import Any, NamedTuple

import viser

from spheretwin.models.base.errors import InputError
from spheretwin.viz.bench.protocols import BenchProtocol, TicketProtocol

# Time that a refusal without a field is shown.
SHOWN_S = 8.0

# Commands that wait longer are shown: the first time, a law or a fault may have to be compiled.
LONG_S = 0.5

# A way to a pose takes the loop a fifth of a chunk to make: a slider that slides makes ten a second.
LATEST_INTERVAL_S = 0.1

# Pending commands that are followed; of a flood, earlier ones are dropped.
MOST_TICKETS = 200

Event = Any
"""Event of viser: it has the number of the page that it comes from."""


class Note:
    """Line under a field with the reason why its value was refused; empty otherwise.

    Parameters
    ----------
    gui : viser.GuiApi
        In the container of the field.
    order : float, optional
        Order in the container; default: after what it has.
    """

    def __init__(self, gui: viser.GuiApi, order: float | None = None) -> None:
        self._html = gui.add_html("", order=order, visible=False)
        self._lock, self._removed = threading.Lock(), False

    def say(self, text: str | None) -> None:
        """Show a text, or hide the line; do nothing if the line was removed while its command was pending."""
        with self._lock:
            if self._removed:
                return
            if text:
                self._html.content = f'<div style="{_REFUSED}">{escape(text)}</div>'
            self._html.visible = bool(text)

    def remove(self) -> None:
        """Remove the line."""
        with self._lock:
            self._removed = True
            self._html.remove()


_REFUSED = "color:var(--bad);font-size:0.8em;line-height:1.25;padding:0 0.7em 0.3em;overflow-wrap:anywhere"


class PendingCommand(NamedTuple):
    """Command without an outcome."""

    name: str
    ticket: TicketProtocol
    note: Note | None
    since_s: float


class EventHandlers:
    """Sends the commands of events to the bench and shows their outcomes.

    Parameters
    ----------
    bench : BenchProtocol
        Bench that receives the commands.
    """

    def __init__(self, bench: BenchProtocol) -> None:
        self._bench = bench
        self._lock = threading.Lock()
        self._open: list[PendingCommand] = []
        self._refused, self._until_s = "", 0.0
        self._warned_s: dict[int, float] = {}
        self._latest: dict[str, tuple[Event, Note | None, dict[str, Any]]] = {}
        self._latest_sent_s: dict[str, float] = {}

    @property
    def refused(self) -> str:
        """Last refusal without a field; empty after a while."""
        return self._refused if time.monotonic() < self._until_s else ""

    @property
    def waiting_command(self) -> str:
        """Name of the command that has waited longest, if it has waited long enough to show; else empty."""
        since_s = time.monotonic() - LONG_S
        return next((pending.name for pending in self._open if pending.since_s < since_s), "")

    def send(self, event: Event, name: str, /, note: Note | None = None, **arguments: Any) -> bool:
        """Send a command in the name of an event's page; return False if the page may not command."""
        if name not in ANYONES and not self.accepts(event):
            return False
        self.flush(0.0)  # earlier values of sliders come first
        self._submit(event, name, note, arguments)
        return True

    def send_latest(self, event: Event, name: str, /, note: Note | None = None, **arguments: Any) -> bool:
        """Send the latest of a fast sequence of commands, at a limited rate."""
        if not self.accepts(event):
            return False
        with self._lock:
            self._latest[name] = (event, note, arguments)
        return True

    def flush(self, apart_s: float = LATEST_INTERVAL_S) -> None:
        """Send the latest value of each slider, if the last one is long enough ago."""
        now = time.monotonic()
        with self._lock:
            due = [name for name in self._latest if now - self._latest_sent_s.get(name, 0.0) >= apart_s]
            latest = {name: self._latest.pop(name) for name in due}
            self._latest_sent_s |= dict.fromkeys(due, now)
        for name, (event, note, arguments) in latest.items():
            self._submit(event, name, note, arguments)

    def _submit(self, event: Event, name: str, note: Note | None, arguments: dict[str, Any]) -> None:
        ticket = self._bench.command(name, client=client_name(event.client_id), **arguments)
        with self._lock:
            self._open = [*self._open[-MOST_TICKETS:], PendingCommand(name, ticket, note, time.monotonic())]

    def show_refusal(self, text: str, note: Note | None = None) -> None:
        """Show a refusal at its field, or in the status panel."""
        if note:
            note.say(text)
        else:
            self._refused, self._until_s = text, time.monotonic() + SHOWN_S

    def settle(self) -> None:
        """Show the outcomes of commands since the last call."""
        with self._lock:
            settled = [pending for pending in self._open if pending.ticket.done]
            self._open = [pending for pending in self._open if not pending.ticket.done]
        for pending in settled:
            if pending.ticket.refused:
                self.show_refusal(pending.ticket.refused, pending.note)
            elif pending.note:
                pending.note.say(None)

    def button(
        self,
        gui: viser.GuiApi,
        label: str,
        name: str,
        arguments: Callable[[], dict[str, Any]] | None = None,
        **more: Any,
    ) -> None:
        """Add a button for a command, and under it a line for its refusal if it has arguments.

        Parameters
        ----------
        gui : viser.GuiApi
            In the container.
        label : str
            Label of the button.
        name : str
            Name of the command.
        arguments : callable, optional
            Returns the arguments; an `InputError` is shown as a refusal.
        **more
            Settings of the button.
        """
        button = gui.add_button(label, **more)
        note = Note(gui) if arguments else None

        def press(event: Event) -> None:
            try:
                given = arguments() if arguments else {}
            except InputError as error:
                self.show_refusal(str(error), note)
            else:
                self.send(event, name, note, **given)

        on_press(button, press)

    def follow(self, line: Any, name: str, note: Note, arguments: Callable[[], dict[str, Any]]) -> None:
        """Send a command at each change of a slider, with the latest arguments."""
        on_change(line, lambda event: self.send_latest(event, name, note, **arguments()))

    def accepts(self, event: Event) -> bool:
        """Return True if a page operates; notify it otherwise."""
        operates = self._bench.may_command(client_name(event.client_id))
        if not operates:
            self._warn(event)
        return operates

    def _warn(self, event: Event) -> None:
        """Notify a watching page, and no other, why nothing happens; not at every key."""
        now = time.monotonic()
        if now - self._warned_s.get(event.client_id, -SHOWN_S) >= SHOWN_S:
            self._warned_s[event.client_id] = now
            message = "No client operates: press “Take over” above."
            if self._bench.state().operator is not None:
                message = "Another client operates: press “Ask to operate” above."
            event.client.add_notification("This page is read-only", message, auto_close_seconds=SHOWN_S)


ANYONES = ("stop", "ask", "hello", "leave", "beat")
"""Commands that the bench also accepts from watching pages."""


def on_change(line: Any, act: Callable[[Event], object]) -> None:
    """Call a function at each change; `guard_values` has refused those of pages that do not operate.

    Parameters
    ----------
    line : viser's handle
        Handle of a field, a slider or a box, which all pages share.
    act : callable
        Called with the event of each change.
    """

    async def update(event: Event) -> None:
        if event.client_id is not None:
            act(event)

    line.on_update(update)


def on_press(button: Any, act: Callable[[Event], object]) -> None:
    """Call a function at each press of a button, on the server's own thread, in order."""

    async def press(event: Event) -> None:
        if event.client_id is not None:
            act(event)

    button.on_click(press)


def client_name(number: int) -> str:
    """Return the bench's name of a page."""
    return f"page {number}"
