"""Changes of a scenario during a run, by the user or by an event of the scenario."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from math import ceil
from typing import Any

from pydantic import BaseModel, ConfigDict
from pydantic_core import to_jsonable_python

from spheretwin.control.laws import LAWS
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.telemetry.run_record import Change
from spheretwin.scenario.fields import FieldKind, families, kind_of, section_kind
from spheretwin.scenario.reading import (
    fill_hardware,
    is_dotted,
    override,
    read,
    resolve_paths,
    shipped,
    validated,
)
from spheretwin.scenario.sections import Scenario, UserController, kind_of_scenario, scenario_with
from spheretwin.trajectories.rounding import Triple

# Fields that cannot change during a run.
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
    "sensors.hall",
)


FAULT = "fault"

STATE = "state"
"""Name of a change of the state of the plant in a journal; not a field."""

EXTERNAL = "external"
"""Name of the journal entry of a controller or plant outside of the process; not a field."""


class StateChange(BaseModel):
    """New pose, rates and currents of the plant."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    q_rad: Triple | None = None
    qdot_rad_s: Triple | None = None
    current_A: tuple[float, ...] | None = None


TAGS = frozenset(name.rpartition(".")[2] for name in families(Scenario))
"""Names of the fields that select a member of a family, such as ``shape`` and ``law``."""


def complete_fields(source: str, overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a scenario as `fields_with`, with those of its hardware and with resolved paths.

    Raises
    ------
    InputError
        As `fields_with`, or the fields are nested too deeply.
    """
    fields = fields_with(source, overrides)
    fill_hardware(fields)
    try:
        return resolve_paths("", fields)
    except RecursionError:
        raise InputError(f"scenario {source}: expected values with fewer levels of nesting") from None


def fields_with(source: str, overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a scenario with some of them overridden.

    A shipped scenario is not the text of the user. If an override selects another member of a family, such
    as ``trajectory.shape``, fields of the shipped file that only the old member has are dropped, so that the
    new one starts from its own defaults. Nothing that a user wrote is dropped: a field of another member in
    a user file, or among the overrides, is refused when the scenario is checked.

    Parameters
    ----------
    source : str
        A shipped name, or the path of a TOML file.
    overrides : mapping
        Values by dotted name.

    Raises
    ------
    InputError
        The scenario cannot be read, or a name is not the name of a field.
    """
    fields = read(source)
    members = {dotted: value for dotted, value in overrides.items() if is_tag(dotted)}
    if members and source in shipped():
        base = validated(fields, source)
        for dotted, value in members.items():
            kind = scenario_with(value) if dotted == "controller.law" else Scenario
            _drop_foreign_fields(fields, dotted, value, kind, base)
    for dotted, value in overrides.items():
        override(fields, dotted, value)
    return fields


def is_tag(dotted: object) -> bool:
    """True if a name may be the name of a field that selects a member of a family."""
    return isinstance(dotted, str) and dotted.rpartition(".")[2] in TAGS


def is_one_fault(dotted: str, value: Any) -> bool:
    """True if a change adds a fault to the scheduled faults."""
    return dotted == FAULT and isinstance(value, Mapping)


def from_now_on(dotted: str, value: Any, t_s: float) -> Any:
    """Return the value of a change at a time: a fault without a start time starts at this time."""
    return {"start_s": t_s, **value} if is_one_fault(dotted, value) else value


def with_change(scenario: Scenario, dotted: str, value: Any, source: str | None = None) -> Scenario:
    """Return a scenario with another value of one field, validated as a whole; paths are as in `load`.

    Another member of a family, such as another law, keeps the fields that both members have; its other fields
    have their defaults. A nominal model that is set to equal the truth keeps none of its values. A single
    table for the list of faults adds a fault. The content of files of trajectories and disturbances stays,
    unless the change concerns them.

    Parameters
    ----------
    scenario : Scenario
    dotted : str
        Name of the field.
    value : any
        As JSON has it.
    source : str, optional
        Origin of the scenario, for messages; its name unless given.

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
    removed = _remove_unchanged(fields, dotted)
    # A user law stays the one that was read, even if its file has changed.
    kind = scenario_with(value) if dotted in ("controller", "controller.law") else kind_of_scenario(scenario)
    _drop_foreign_fields(fields, dotted, value, kind, scenario)
    if dotted == "nominal.equals_truth" and value is True:
        fields["nominal"] = {}
    override(fields, dotted, [*fields[FAULT], value] if is_one_fault(dotted, value) else value)
    chosen = None if dotted == "controller" else kind
    changed = validated(resolve_paths("", fields), source or scenario.name, chosen)
    if "trajectory" in removed:
        changed = changed.model_copy(update={"trajectory": scenario.trajectory})
    else:
        trajectory = _keep_unchanged(scenario.trajectory, changed.trajectory, "trajectory", dotted)
        changed = changed.model_copy(update={"trajectory": trajectory})
    if "terms" in removed:
        terms = scenario.disturbance.terms
    else:
        terms = _keep_unchanged(
            scenario.disturbance.terms, changed.disturbance.terms, "disturbance.terms", dotted
        )
    return changed.model_copy(update={"disturbance": changed.disturbance.model_copy(update={"terms": terms})})


def _remove_unchanged(fields: dict[str, Any], dotted: str) -> set[str]:
    """Remove the unchanged fields with files, so that the files are not read again; return their names."""
    removed = set()
    if not _overlaps(dotted, "trajectory"):
        fields["trajectory"] = {"shape": "hold"}
        removed.add("trajectory")
    if not _overlaps(dotted, "disturbance.terms"):
        fields["disturbance"]["terms"] = []
        removed.add("terms")
    return removed


def _overlaps(dotted: str, section: str) -> bool:
    """True if one of two dotted names is a part of the other."""
    return f"{dotted}.".startswith(f"{section}.") or f"{section}.".startswith(f"{dotted}.")


def is_fixed(dotted: str) -> bool:
    """True if a name is a fixed field, a part of one, or a section that contains one."""
    return any(_overlaps(dotted, field) for field in FIXED)


def check_events(scenario: Scenario, source: str) -> Scenario:
    """Check the events of a scenario before a run.

    Raises
    ------
    InputError
        An event sets a field that cannot be set, or an invalid value.
    """
    ordered_events = sorted(enumerate(scenario.event), key=lambda event: event[1].t_s)
    after = scenario
    for place, event in ordered_events:
        if is_fixed(event.set):
            raise InputError(
                f"scenario {source}: event.{place}.set: expected a field that may change during a run,"
                f" received {event.set}"
            )
        try:
            after = with_change(after, event.set, event.value, source)
        except InputError as error:
            raise InputError(f"{error}, as event.{place} sets it") from None
    return scenario


def _keep_unchanged(before: Any, after: Any, path: str, dotted: str) -> Any:
    """Return the changed value with all unchanged parts as they were read at the start of the run."""
    if f"{path}.".startswith(f"{dotted}."):
        return after  # the field itself is set, even if to the same value
    within = dotted.startswith(f"{path}.")
    if not within and to_jsonable_python(before) == to_jsonable_python(after):
        return before
    if isinstance(before, tuple) and isinstance(after, tuple):
        pairs = enumerate(zip(before, after, strict=False))
        return (
            tuple(_keep_unchanged(*pair, f"{path}.{i}", dotted) for i, pair in pairs) + after[len(before) :]
        )
    return after


def _drop_foreign_fields(
    fields: dict[str, Any], dotted: str, value: Any, kind_after: type[Scenario], before: Scenario
) -> None:
    """If a change selects another member of a family, drop the fields that do not fit the new member."""
    *sections, name = dotted.split(".")
    kind: FieldKind | None = section_kind(kind_after)
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
        for field_name in list(inside):
            in_both = field_name in new and field_name in old
            same = in_both and new[field_name].annotation == old[field_name].annotation
            if field_name != name and not same:
                del inside[field_name]


# Times and periods are decimal fractions: the time of an event equals a tick only up to rounding.
ROUNDING = 1e-6


def scheduled_changes(scenario: Scenario) -> tuple[Change, ...]:
    """Return the changes of the events of a scenario, in the order of their times, then of the file."""
    return tuple(
        Change(
            first_tick(event.t_s / scenario.controller.period_s),
            event.set,
            from_now_on(event.set, copy.deepcopy(event.value), event.t_s),
        )
        for event in sorted(scenario.event, key=lambda event: event.t_s)
    )


def first_tick(periods: float) -> int:
    """Return the first tick at or after a time in control periods."""
    nearest = round(periods)
    return nearest if abs(periods - nearest) <= ROUNDING else ceil(periods)
