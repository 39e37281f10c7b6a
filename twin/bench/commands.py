"""What a bench can be told: every command with its arguments, each checked before it waits for its turn."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, JsonValue, ValidationError, create_model

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import did_you_mean, shown
from spheretwin.twin.scenario.explaining import explain
from spheretwin.twin.scenario.reading import as_plain
from spheretwin.twin.trajectories.trajectory import Triple

_CONFIG = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

SLOWEST = 0.1
"""Slow motion, as a share of the clock's pace."""

FASTEST = 1e6
"""No machine reaches it: as fast as possible."""

Text = Annotated[str, Field(min_length=1, max_length=4096)]
Speed = Annotated[float, Field(ge=SLOWEST, le=FASTEST)]
Ticks = Annotated[int, Field(ge=1, le=1_000_000)]
Place = Annotated[int, Field(ge=0)]
PositiveLimit = Annotated[float, Field(ge=1e-3, le=1e6)]
Current = Annotated[float, Field(ge=-1e3, le=1e3)]


class Kind(NamedTuple):
    """One command."""

    arguments: type[BaseModel]
    only_last: tuple[str, ...] | None
    """Where only the last one that waits matters: arguments that must be the same for it to be the same."""
    anyone: bool = False
    """Whether it is taken from clients that do not operate."""


def _kind(only_last: tuple[str, ...] | None = None, anyone: bool = False, **arguments: Any) -> Kind:
    return Kind(create_model("Arguments", __config__=_CONFIG, **arguments), only_last, anyone)


COMMANDS = {
    # Time.
    "start": _kind(()),
    "pause": _kind(()),
    "step": _kind(ticks=(Ticks, 1)),
    "speed": _kind((), factor=(Speed, ...)),
    "stop": _kind((), anyone=True),
    "reset": _kind(()),
    "load": _kind(source=(Text, ...), overrides=(dict[str, JsonValue], {})),
    "snapshot": _kind(name=(Text, "last")),
    "restore": _kind(name=(Text, "last")),
    # Modes.
    "off": _kind(()),
    "hold": _kind(()),
    "point": _kind((), pose_rad=(Triple, ...)),
    "trajectory": _kind((), fields=(dict[str, JsonValue] | None, None)),
    "jog": _kind((), rates_rad_s=(Triple, ...)),
    "manual": _kind(
        (),
        currents_A=(tuple[Current, ...] | None, None),
        group=(Place | None, None),
        current_A=(Current, 1.0),
    ),
    "replay": _kind(file=(Text, ...)),
    "limits": _kind(
        (), rate_rad_s=(PositiveLimit | None, None), acceleration_rad_s2=(PositiveLimit | None, None)
    ),
    # Settings.
    "set": _kind(("name",), name=(Text, ...), value=(JsonValue, ...)),
    "add_fault": _kind(fault=(dict[str, JsonValue], ...)),
    "clear_faults": _kind(place=(Place | None, None)),
    # Files.
    "record": _kind(recording=(Text | None, None), telemetry=(Text | None, None)),
    "keep": _kind(()),
    "save": _kind(file=(Text, ...)),
    # Clients.
    "hello": _kind(("client",), anyone=True),
    "beat": _kind(("client",), anyone=True),
    "ask": _kind(("client",), anyone=True),
    "leave": _kind(("client",), anyone=True),
    "grant": _kind((), to=(Text, ...)),
}
"""By name; see `Bench` for what each does."""


def checked(name: object, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of a command, as it takes them.

    Raises
    ------
    InputError
        There is no such command, or an argument is missing, unknown, of the wrong type or out of range.
    """
    if not isinstance(name, str) or name not in COMMANDS:
        raise InputError(
            f"bench: expected one of {', '.join(COMMANDS)}, received {shown(name)}"
            f"{did_you_mean(str(name), COMMANDS)}"
        )
    kind = COMMANDS[name].arguments
    if unknown := [field for field in arguments if field not in kind.model_fields]:
        known = ", ".join(kind.model_fields) or "no arguments"
        raise InputError(f"bench: {name}: expected {known}, received {unknown[0]}")
    try:
        found = kind.model_validate_json(json.dumps(arguments, default=as_plain))
    except ValidationError as error:
        raise InputError(f"bench: {name}: {explain(error, kind)}") from None
    except (TypeError, ValueError, RecursionError) as error:  # digits or depth without end
        raise InputError(f"bench: {name}: expected arguments as JSON has them, {error}") from None
    return {field: getattr(found, field) for field in kind.model_fields}
