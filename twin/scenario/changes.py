"""What may change of a scenario while it runs, and how: by hand, or by an event that it plans itself."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from math import ceil
from typing import Any

from pydantic import BaseModel
from pydantic_core import to_jsonable_python

from spheretwin.control.laws import LAWS
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.telemetry.run_record import Change
from spheretwin.scenario.fields import Kind, every_field, kind_of, section_kind
from spheretwin.scenario.reading import beside, is_dotted, override, read, shipped, validated
from spheretwin.scenario.sections import Scenario, UserController, kind_of_scenario, scenario_with

# What a run is begun with cannot be changed on its way.
FIXED = (
    "name",
    "description",
    "duration",
    "seed",
    "hardware",
    "event",
    "controller.period_s",
    "controller.preset",
    "plant.step_s",
    "plant.engine",
    "plant.mjcf",
    "plant.initial_rad",
    "plant.initial_rad_s",
)


FAULT = "fault"

TAGS = frozenset(
    kind.discriminator
    for _, field in every_field(Scenario)
    if (kind := kind_of(field)) and kind.discriminator
)
"""Names of the fields that choose a member of a family, as ``shape`` and ``law``."""


def fields_with(source: str, overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a scenario with some of them overridden.

    A shipped scenario is not the user's text. If an override chooses another member of a family, such as
    ``trajectory.shape``, what the shipped file says of the old member alone is dropped, so that the new one
    starts from its own defaults. Nothing that a user wrote is dropped: a field of another member in a user's
    file, or among the overrides, is refused when the scenario is checked.

    Parameters
    ----------
    source : str
        A shipped name, or the path of a TOML file.
    overrides : mapping
        Values by dotted name.

    Raises
    ------
    InputError
        The scenario cannot be read, or a name is not that of a field.
    """
    fields = read(source)
    members = {dotted: value for dotted, value in overrides.items() if is_tag(dotted)}
    if members and source in shipped():
        base = validated(fields, source)
        for dotted, value in members.items():
            kind = scenario_with(value) if dotted == "controller.law" else Scenario
            _keep_common(fields, dotted, value, kind, base)
    for dotted, value in overrides.items():
        override(fields, dotted, value)
    return fields


def is_tag(dotted: object) -> bool:
    """True if a name may be that of a field that chooses a member of a family."""
    return isinstance(dotted, str) and dotted.rpartition(".")[2] in TAGS


def is_one_fault(dotted: str, value: Any) -> bool:
    """Whether a change adds a fault to those that are planned."""
    return dotted == FAULT and isinstance(value, Mapping)


def from_now_on(dotted: str, value: Any, t_s: float) -> Any:
    """Value of a change at a time: a fault that does not say when it starts does so then."""
    return {"start_s": t_s, **value} if is_one_fault(dotted, value) else value


def changed(scenario: Scenario, dotted: str, value: Any, source: str | None = None) -> Scenario:
    """Scenario with another value of one field, checked as a whole; paths are taken as `load` takes them.

    Another member of a family, as another law, keeps the fields that it has too; its own have their defaults.
    A nominal model that is set to equal the truth keeps no value of its own.
    One table for the list of faults is one more of them. What files of trajectories and disturbances held
    stays, unless it is they that are changed.

    Parameters
    ----------
    scenario : Scenario
    dotted : str
        Name of the field.
    value : any
        As JSON has it.
    source : str, optional
        Where the scenario comes from, for complaints; its name unless given.

    Raises
    ------
    InputError
        A field that is unknown, of the wrong type or out of range.
    """
    if not is_dotted(dotted):
        raise InputError(f"scenario: expected a field such as controller.law, received {shown(dotted)}")
    value = copy.deepcopy(value)
    fields = scenario.model_dump(mode="json")
    if isinstance(scenario.controller, UserController):
        del fields["controller"]["parameters"]
        fields["controller"]["law"] = next(iter(LAWS))
    untouched = _set_aside(fields, dotted)
    # A user's law stays the one that was read, whatever has become of its file.
    kind = scenario_with(value) if dotted in ("controller", "controller.law") else kind_of_scenario(scenario)
    _keep_common(fields, dotted, value, kind, scenario)
    if dotted == "nominal.equals_truth" and value is True:
        fields["nominal"] = {}
    override(fields, dotted, [*fields[FAULT], value] if is_one_fault(dotted, value) else value)
    chosen = None if dotted == "controller" else kind
    made = validated(beside("", fields), source or scenario.name, chosen)
    if "trajectory" in untouched:
        made = made.model_copy(update={"trajectory": scenario.trajectory})
    else:
        kept = _kept(scenario.trajectory, made.trajectory, "trajectory", dotted)
        made = made.model_copy(update={"trajectory": kept})
    if "terms" in untouched:
        terms = scenario.disturbance.terms
    else:
        terms = _kept(scenario.disturbance.terms, made.disturbance.terms, "disturbance.terms", dotted)
    return made.model_copy(update={"disturbance": made.disturbance.model_copy(update={"terms": terms})})


def _set_aside(fields: dict[str, Any], dotted: str) -> set[str]:
    """Take out of the fields what holds files and is not changed: it is not to be read again."""
    untouched = set()
    if not _leads_into(dotted, "trajectory"):
        fields["trajectory"] = {"shape": "hold"}
        untouched.add("trajectory")
    if not _leads_into(dotted, "disturbance.terms"):
        fields["disturbance"]["terms"] = []
        untouched.add("terms")
    return untouched


def _leads_into(dotted: str, section: str) -> bool:
    """Whether one of two names is that of a part of the other."""
    return f"{dotted}.".startswith(f"{section}.") or f"{section}.".startswith(f"{dotted}.")


def is_fixed(dotted: str) -> bool:
    """Whether a name is that of a fixed field, of a part of one, or of a section that holds one."""
    return any(_leads_into(dotted, field) for field in FIXED)


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
            after = changed(after, event.set, event.value, source)
        except InputError as error:
            raise InputError(f"{error}, as event.{place} sets it") from None
    return scenario


def _kept(before: Any, after: Any, path: str, dotted: str) -> Any:
    """What comes after, with all that says the same as before left as it is: read when the run began."""
    if f"{path}.".startswith(f"{dotted}."):
        return after  # it is this that is set, if to what it says already
    within = dotted.startswith(f"{path}.")
    if not within and to_jsonable_python(before) == to_jsonable_python(after):
        return before
    if isinstance(before, tuple) and isinstance(after, tuple):
        pairs = enumerate(zip(before, after, strict=False))
        return tuple(_kept(*pair, f"{path}.{i}", dotted) for i, pair in pairs) + after[len(before) :]
    return after


def _keep_common(
    fields: dict[str, Any], dotted: str, value: Any, kind_after: type[Scenario], before: Scenario
) -> None:
    """Where a family's member is exchanged, drop what the new one does not have, or has of another kind."""
    *sections, name = dotted.split(".")
    kind: Kind | None = section_kind(kind_after)
    inside: Any = fields
    present: Any = before
    for section in sections:
        if kind is None:
            return
        if isinstance(inside, list):
            if not section.isdecimal() or int(section) >= len(inside):
                return
            inside, present, kind = inside[int(section)], present[int(section)], replace(kind, is_list=False)
            continue
        field = type(present).model_fields.get(section) if isinstance(present, BaseModel) else None
        if field is None or section not in inside:
            return
        owner = kind.chosen(inside)[0].model_fields.get(section, field)
        inside, present, kind = inside[section], getattr(present, section), kind_of(owner)
    if kind and kind.discriminator == name and isinstance(value, str) and value in kind.members:
        old, new = type(present).model_fields, kind.members[value].model_fields
        for each in list(inside):
            same = each in new and each in old and new[each].annotation == old[each].annotation
            if each != name and not same:
                del inside[each]


# Times and periods are decimal fractions: a tick that falls on an event does so to rounding only.
ROUNDING = 1e-6


def planned(scenario: Scenario) -> tuple[Change, ...]:
    """Changes that the events of a scenario make, in the order of their times, then of the file."""
    return tuple(
        Change(
            first_tick(event.t_s / scenario.controller.period_s),
            event.set,
            from_now_on(event.set, copy.deepcopy(event.value), event.t_s),
        )
        for event in sorted(scenario.event, key=lambda event: event.t_s)
    )


def first_tick(periods: float) -> int:
    """Tick that a time, in control periods, has come at."""
    nearest = round(periods)
    return nearest if abs(periods - nearest) <= ROUNDING else ceil(periods)
