"""What a command of a bench is: its arguments, who may give it, what it needs, and what it does."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from spheretwin.models.base.errors import InputError
from spheretwin.twin.scenario.explaining import explain
from spheretwin.twin.scenario.reading import as_plain, foreign

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
    does: Callable[..., None]
    """Takes the works, what was prepared, and the arguments by name; of a client's, operators and client."""
    arguments: type[BaseModel]
    only_last: tuple[str, ...] | None
    """Where only the last one that waits matters: arguments that must be the same for it to be the same."""
    by: By
    prepares: Callable[..., Callable[[], Any] | None] | None
    """Takes the works and the arguments by name; gives what must be done beside the loop before, if any."""
    before_all: bool
    """Whether it waits for no other."""
    undone: bool
    """Whether one that goes before all others takes it back where it was said earlier."""


def command(
    name: str,
    does: Callable[..., None],
    /,
    only_last: tuple[str, ...] | None = None,
    by: By = By.OPERATOR,
    prepares: Callable[..., Callable[[], Any] | None] | None = None,
    before_all: bool = False,
    undone: bool = False,
    arguments: Mapping[str, Any] | None = None,
) -> Command:
    """Row of a command; each argument is a type and its default, or ``...`` where it must be given."""
    taken = create_model("Arguments", __config__=_CONFIG, **(arguments or {}))
    return Command(name, does, taken, only_last, by, prepares, before_all, undone)


def checked(command: Command, arguments: Mapping[str, Any]) -> dict[str, Any]:
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
        found = kind.model_validate_json(json.dumps(arguments, default=as_plain))
    except ValidationError as error:
        raise InputError(f"bench: {name}: {explain(error, kind)}") from None
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(
            f"bench: {name}: expected arguments as JSON has them, received {foreign(error)}"
        ) from None
    return {field: getattr(found, field) for field in kind.model_fields}
