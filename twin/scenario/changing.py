"""What may change of a scenario while it runs, and how: by hand, or by an event that it plans itself."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel
from pydantic_core import to_jsonable_python

from spheretwin.control.laws.registry import LAWS
from spheretwin.models.base.errors import InputError
from spheretwin.twin.scenario.fields import Kind, kind_of, section_kind
from spheretwin.twin.scenario.own_law import scenario_with
from spheretwin.twin.scenario.reading import beside, override, validated
from spheretwin.twin.scenario.sections import OwnController, OwnPath, Scenario

# What a run is begun with cannot be changed on its way.
FIXED = (
    "name",
    "description",
    "duration",
    "seed",
    "event",
    "controller.period_s",
    "plant.step_s",
    "plant.engine",
    "plant.mjcf",
    "plant.initial_rad",
    "plant.initial_rad_s",
)

FROM_FILES = ("trajectory", "disturbance")
"""Sections whose files are read when they are made."""


def changed(scenario: Scenario, dotted: str, value: Any) -> Scenario:
    """Scenario with another value of one field, checked as a whole; paths are taken as `load` takes them.

    Another member of a family, as another law, keeps the fields that it has too; its own have their defaults.
    What files of trajectories and disturbances held stays, unless it is they that are changed.

    Raises
    ------
    InputError
        A field that is unknown, of the wrong type or out of range.
    """
    fields = scenario.model_dump(mode="json")
    if isinstance(scenario.controller, OwnController):
        fields["controller"] = {"law": next(iter(LAWS)), "period_s": scenario.controller.period_s}
    # A user's law stays the one that was read, whatever has become of its file.
    kind = scenario_with(value) if dotted in ("controller", "controller.law") else type(scenario)
    if isinstance(scenario.trajectory, OwnPath):
        fields["trajectory"] = {"shape": "hold"}
    _keep_common(fields, dotted, value, kind)
    override(fields, dotted, value)
    made = validated(beside("", fields), scenario.name, None if dotted == "controller" else kind)
    update = {name: _kept(getattr(scenario, name), getattr(made, name)) for name in FROM_FILES}
    return made.model_copy(update=update)


def is_fixed(dotted: str) -> bool:
    """Whether a name is that of a fixed field, or of a section that holds one."""
    return any(f"{field}.".startswith(f"{dotted}.") for field in FIXED)


def check_events(scenario: Scenario, source: str) -> Scenario:
    """Find out before a run what an event would only be refused for on its way.

    Raises
    ------
    InputError
        An event sets what cannot be set, or to what it cannot be.
    """
    planned = sorted(enumerate(scenario.event), key=lambda event: event[1].t_s)
    after = scenario
    for place, event in planned:
        if is_fixed(event.set):
            raise InputError(
                f"scenario {source}: event.{place}.set: expected a field that may change during a run,"
                f" received {event.set}"
            )
        try:
            after = changed(after, event.set, event.value)
        except InputError as error:
            raise InputError(f"{error}, as event.{place} sets it") from None
    return scenario


def _kept(before: Any, after: Any) -> Any:
    """What comes after, with all that says the same as before left as it is: read when the run began."""
    if to_jsonable_python(before) == to_jsonable_python(after):
        return before
    if isinstance(after, BaseModel) and type(before) is type(after):
        names = type(after).model_fields
        return after.model_copy(
            update={name: _kept(getattr(before, name), getattr(after, name)) for name in names}
        )
    if isinstance(before, tuple) and isinstance(after, tuple):
        return tuple(map(_kept, before, after)) + after[len(before) :]
    return after


def _keep_common(fields: dict[str, Any], dotted: str, value: Any, scenario: type[Scenario]) -> None:
    """Where a family's member is exchanged, drop what the new one does not have."""
    *sections, name = dotted.split(".") if isinstance(dotted, str) else [""]
    kind: Kind | None = section_kind(scenario)
    inside: Any = fields
    for section in sections:
        if kind is None or not isinstance(inside, dict) or section not in inside:
            return
        member = kind.chosen(inside)[0]
        inside = inside[section]
        kind = kind_of(member.model_fields[section]) if section in member.model_fields else None
    if kind and kind.told_apart_by == name and isinstance(value, str) and value in kind.members:
        for field in [each for each in inside if each not in kind.members[value].model_fields]:
            del inside[field]
