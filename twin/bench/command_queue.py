"""What a command of a bench is: its arguments, who may give it, what it needs, and what it does."""

from __future__ import annotations

import json
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from spheretwin.models.base.errors import InputError
from spheretwin.scenario.fields import explain
from spheretwin.scenario.reading import as_plain, foreign

_CONFIG = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

Text = Annotated[str, Field(min_length=1, max_length=4096)]
Place = Annotated[int, Field(ge=0)]


class By(Enum):
    """Who may give a command."""

    OPERATOR = 1
    ANYONE = 2
    CLIENT = 3
    """Whoever says who it is: this is of the clients themselves, and done at once."""


class Command(NamedTuple):
    """One command."""

    name: str
    action: Callable[..., None]
    """Takes the works, what was prepared, and the arguments by name; of a client's, operators and client."""
    arguments: type[BaseModel]
    replace_equal: tuple[str, ...] | None
    """Where only the last one that waits matters: arguments that must be the same for it to be the same."""
    by: By
    prepare: Callable[..., Callable[[], Any] | None] | None
    """Takes the works and the arguments by name; gives what must be done beside the loop before, if any."""
    urgent: bool
    """Whether it waits for no other."""
    cancelled_by_stop: bool
    """Whether one that goes before all others takes it back where it was said earlier."""


def command(
    name: str,
    action: Callable[..., None],
    /,
    replace_equal: tuple[str, ...] | None = None,
    by: By = By.OPERATOR,
    prepare: Callable[..., Callable[[], Any] | None] | None = None,
    urgent: bool = False,
    cancelled_by_stop: bool = False,
    arguments: Mapping[str, Any] | None = None,
) -> Command:
    """Row of a command; each argument is a type and its default, or ``...`` where it must be given."""
    model = create_model("Arguments", __config__=_CONFIG, **(arguments or {}))
    return Command(name, action, model, replace_equal, by, prepare, urgent, cancelled_by_stop)


def check_arguments(command: Command, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of a command, as it takes them.

    Raises
    ------
    InputError
        An argument is missing, unknown, of the wrong type or out of range.
    """
    name, kind = command.name, command.arguments
    if unknown := [field for field in arguments if field not in kind.model_fields]:
        known = ", ".join(kind.model_fields) or "no arguments"
        raise InputError(f"bench: {name}: expected {known}, received {unknown[0]}")
    try:
        values = kind.model_validate_json(json.dumps(arguments, default=as_plain))
    except ValidationError as error:
        raise InputError(f"bench: {name}: {explain(error, kind)}") from None
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(
            f"bench: {name}: expected arguments as JSON has them, received {foreign(error)}"
        ) from None
    return {field: getattr(values, field) for field in kind.model_fields}


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
        self.created_s = self.settled_s = time.monotonic()
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


def settled_ticket() -> Ticket:
    """Ticket of what was done at once."""
    ticket = Ticket()
    ticket.settle()
    return ticket


class QueuedCommand:
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
        self._waiting: OrderedDict[object, QueuedCommand] = OrderedDict()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, waiting: QueuedCommand) -> None:
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

    def next(self) -> QueuedCommand | None:
        """The command whose turn it is, if one waits; it waits no more."""
        with self._lock:
            return self._waiting.popitem(last=False)[1] if self._waiting else None


def _key(waiting: QueuedCommand) -> object:
    """Equal for two commands of which only the last one matters."""
    replace_equal = waiting.command.replace_equal
    if replace_equal is None:
        return waiting
    return waiting.command.name, *(waiting.arguments[name] for name in replace_equal)
