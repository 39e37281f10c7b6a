"""Commands of a bench: their definition, their check, their tickets and their queue."""

from __future__ import annotations

import inspect
import json
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Generator, Mapping
from enum import Enum, StrEnum
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from spheretwin.models.base.errors import InputError
from spheretwin.scenario.fields import explain
from spheretwin.scenario.reading import as_plain, foreign

_CONFIG = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

Text = Annotated[str, Field(min_length=1, max_length=4096)]
Place = Annotated[int, Field(ge=0)]
Current = Annotated[float, Field(ge=-1e3, le=1e3)]


class By(Enum):
    """Permission to give a command."""

    OPERATOR = 1
    ANYONE = 2
    CLIENT = 3
    """Any client that names itself: the command is about the client and is executed at once."""


Work = Callable[[], Any]
"""Work that is done outside the loop."""


class Command(NamedTuple):
    """Definition of a command."""

    name: str
    action: Callable[..., Generator[Work, Any, None] | None]
    """Takes the bench state, or the operators and the client for a client's command, and the arguments by
    name. What it yields is done outside the loop, and then it continues with the result."""
    arguments: type[BaseModel]
    parameters: tuple[str, ...]
    """Arguments with their defaults, as text."""
    text: str
    replace_equal: tuple[str, ...] | None = None
    """Arguments that must be equal for a new command to replace a waiting one; None if none is replaced."""
    by: By = By.OPERATOR
    urgent: bool = False
    """True if it is executed before all others."""
    cancelled_by_stop: bool = False
    """True if an urgent command that was given later cancels it."""
    simulated_only: bool = False
    """True if a real machine cannot follow it, or if it would leave that without frames."""


def command_of(name: str, action: Callable[..., Any], **settings: Any) -> Command:
    """Return the command of a function: its arguments are those after the state, and after the client."""
    parameters = list(inspect.signature(action, eval_str=True).parameters.values())
    parameters = parameters[2 if settings.get("by") is By.CLIENT else 1 :]
    required = inspect.Parameter.empty
    fields: dict[str, Any] = {
        one.name: (one.annotation, ... if one.default is required else one.default) for one in parameters
    }
    texts = (one.name if one.default is required else f"{one.name}={one.default!r}" for one in parameters)
    arguments = create_model("Arguments", __config__=_CONFIG, **fields)
    text = " ".join((inspect.getdoc(action) or "").split("\n\nRaises")[0].split())
    return Command(name, action, arguments, tuple(texts), text, **settings)


def check_arguments(command: Command, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the checked arguments of a command.

    Raises
    ------
    InputError
        An argument is missing, unknown, of the wrong type or out of range.
    """
    name, kind = command.name, command.arguments
    if unknown := [field for field in given if field not in kind.model_fields]:
        known = ", ".join(kind.model_fields) or "no arguments"
        raise InputError(f"bench: {name}: expected {known}, received {unknown[0]}")
    try:
        values = kind.model_validate_json(json.dumps(given, default=as_plain))
    except ValidationError as error:
        raise InputError(f"bench: {name}: {explain(error, kind)}") from None
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(
            f"bench: {name}: expected arguments as JSON has them, received {foreign(error)}"
        ) from None
    return {field: getattr(values, field) for field in kind.model_fields}


MOST_WAITING = 256


class CommandOutcome(StrEnum):
    """Outcome of waiting for a command."""

    DONE = "done"
    REFUSED = "refused"
    TIMED_OUT = "timed out"


class Ticket:
    """Outcome of a command.

    Attributes
    ----------
    refused : str or None
        Reason why it was refused, in one line; None while it waits, and if it was executed or replaced by
        an equal one.
    created_s, settled_s : float
        Clock when it was created and when it was settled (`time.monotonic`).
    """

    def __init__(self) -> None:
        self.refused: str | None = None
        self.created_s = self.settled_s = time.monotonic()
        self._done = threading.Event()

    @property
    def done(self) -> bool:
        """True if it no longer waits."""
        return self._done.is_set()

    def wait(self, timeout_s: float | None = 5.0) -> CommandOutcome:
        """Wait until it is executed or refused, at most for a time; `refused` has the reason of a refusal."""
        if not self._done.wait(timeout_s):
            return CommandOutcome.TIMED_OUT
        return CommandOutcome.DONE if self.refused is None else CommandOutcome.REFUSED

    def settle(self, refused: str | None = None) -> None:
        """Settle the ticket with the outcome."""
        self.refused, self.settled_s = refused, time.monotonic()
        self._done.set()


def settled_ticket(refused: str | None = None) -> Ticket:
    """Return the ticket of a command that was executed or refused at once."""
    ticket = Ticket()
    ticket.settle(refused)
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
        self._steps: Generator[Work, Any, None] | None = None

    def advance(self, bench_state: object, result: Callable[[], Any]) -> Work | None:
        """Begin the command, or continue it with the result of its work; return more work, if any."""
        if self._steps is None:
            self._steps = self.command.action(bench_state, **self.arguments)
            return next(self._steps, None) if self._steps else None
        try:
            return self._steps.send(result())
        except StopIteration:
            return None


class Queue:
    """Queue of commands from any threads to the loop's thread, in the order of arrival.

    A command that replaces an equal one is put at the end: the last one given is executed last.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: OrderedDict[object, QueuedCommand] = OrderedDict()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, waiting: QueuedCommand) -> None:
        """Add a command.

        Raises
        ------
        InputError
            Too many are waiting.
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
        """Remove and return the first command, if there is one."""
        with self._lock:
            return self._waiting.popitem(last=False)[1] if self._waiting else None


def _key(waiting: QueuedCommand) -> object:
    """Return a key that is equal for two commands of which the last one replaces the other."""
    replace_equal = waiting.command.replace_equal
    if replace_equal is None:
        return waiting
    return waiting.command.name, *(waiting.arguments[name] for name in replace_equal)
