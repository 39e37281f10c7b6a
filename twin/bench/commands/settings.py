"""What is set: limits of the ways, fields of the scenario, and faults."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import Field, JsonValue

from spheretwin.twin.bench.command import Place, Text, command
from spheretwin.twin.bench.modes import Limits
from spheretwin.twin.bench.settings import with_field
from spheretwin.twin.bench.work.works import Works
from spheretwin.twin.scenario.changing import FAULT, is_fixed
from spheretwin.twin.session import Session

PositiveLimit = Annotated[float, Field(ge=1e-3, le=1e6)]

# Sections whose fields no machine is built from.
CHEAP = ("trajectory", "disturbance")


def _limits(works: Works, _: None, **given: float | None) -> None:
    desk = works.desk
    desk.limits = Limits(*(given[field] or own for field, own in desk.limits._asdict().items()))


def _set(works: Works, _: None, name: str, value: Any) -> None:
    works.desk.set(name, value)


def _add_fault(works: Works, _: None, fault: dict[str, Any]) -> None:
    works.desk.set(FAULT, fault)


def _clear_faults(works: Works, _: None, place: int | None) -> None:
    works.desk.clear_faults(place)


def _trial(works: Works, name: str, value: Any) -> Callable[[], None] | None:
    """A session of the settings to be, the first time that a field is set so: it may be compiled."""
    key = (name, value if isinstance(value, str | bool) else type(value))
    settings = works.desk.settings
    cheap = name.split(".")[0] in CHEAP or key in works.tried
    if cheap and not is_fixed(name):
        return None

    def try_out() -> None:
        Session(with_field(settings, name, value)).close()
        works.tried.add(key)

    return try_out


def _trial_of_fault(works: Works, fault: dict[str, Any]) -> Callable[[], None] | None:
    return _trial(works, FAULT, fault)


LIMITS = command(
    "limits",
    _limits,
    only_last=(),
    arguments={
        "rate_rad_s": (PositiveLimit | None, None),
        "acceleration_rad_s2": (PositiveLimit | None, None),
    },
)
SET = command(
    "set",
    _set,
    only_last=("name",),
    prepares=_trial,
    arguments={"name": (Text, ...), "value": (JsonValue, ...)},
)
ADD_FAULT = command(
    "add_fault", _add_fault, prepares=_trial_of_fault, arguments={"fault": (dict[str, JsonValue], ...)}
)
CLEAR_FAULTS = command("clear_faults", _clear_faults, arguments={"place": (Place | None, None)})
