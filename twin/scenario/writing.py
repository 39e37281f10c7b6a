"""Text of a scenario, as a TOML file or a command line; read again, both give the same scenario."""

from __future__ import annotations

import copy
import json
import shlex
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from spheretwin.scenario.changes import fields_with
from spheretwin.scenario.fields import flat
from spheretwin.scenario.reading import fill_hardware, override, read, shipped, validated
from spheretwin.scenario.sections import Scenario, UserController, UserPath

# A shipped scenario with few fields: other scenarios are written as differences from it.
PLAIN = "tilt"

_HEADINGS = ("name", "description")

# Families and the fields that select their members.
FAMILIES = (("trajectory", "shape"), ("controller", "law"), ("estimator", "kind"))


def as_toml(scenario: Scenario) -> str:
    """Return the TOML text of a scenario: all fields that differ from their defaults."""
    fields = scenario.model_dump(mode="json")
    chosen = _chosen(scenario, fields)
    if any(value is None for value in _differences(fields, chosen).values()):
        # TOML cannot state that a field has no value: then the text does not use the defaults of the set.
        fields["hardware"] = chosen["hardware"] = "ideal"
    written: dict[str, Any] = {"name": scenario.name}
    for dotted, value in {**chosen, **_differences(fields, chosen)}.items():
        if value is not None:
            override(written, dotted, value)
    return "\n".join(_table(written, "")).strip() + "\n"


def as_command(scenario: Scenario) -> str:
    """Return the command line that runs a scenario."""
    fields = scenario.model_dump(mode="json")
    chosen = _chosen(scenario, fields)
    name = scenario.name if scenario.name in shipped() else PLAIN
    if read(name)["trajectory"]["shape"] != chosen["trajectory.shape"]:
        name = PLAIN
    base = flat(_completed(read(name)))
    flags = {dotted: value for dotted, value in chosen.items() if base.get(dotted) != value}
    defaults = flat(_completed(fields_with(name, flags)))
    flags |= {
        dotted: value for dotted, value in flat(fields).items() if defaults.get(dotted, defaults) != value
    }
    return shlex.join(command_words(name, flags))


def command_words(scenario: str, fields: Mapping[str, Any]) -> list[str]:
    """Return the words of the command line that runs a scenario with some fields."""
    tokens = [token for dotted, value in fields.items() for token in _flag(dotted, value)]
    return ["spheretwin", "simulate", scenario, *tokens]


def changed_fields(scenario: Scenario) -> dict[str, Any]:
    """Return the fields by dotted name that were chosen, or that differ from a constant default.

    Defaults that follow from files, trajectory or hardware are filled in a resolved scenario: it does not
    show whether such a value was given.
    """
    fields = scenario.model_dump(mode="json")
    chosen = _chosen(scenario, fields)
    defaults = _defaults(_without_objects(scenario, chosen))
    changed = {
        dotted: value for dotted, value in flat(fields).items() if defaults.get(dotted) not in (None, value)
    }
    return {dotted: value for dotted, value in {**chosen, **changed}.items() if dotted not in _HEADINGS}


def _without_objects(scenario: Scenario, chosen: dict[str, Any]) -> dict[str, Any]:
    """Return the chosen fields, with shipped members in place of a law or trajectory given as an object."""
    if isinstance(scenario.controller, UserController):
        chosen = _with_section(chosen, "controller", {"law": "afsm"})
    if isinstance(scenario.trajectory, UserPath):
        chosen = _with_section(chosen, "trajectory", read(PLAIN)["trajectory"])
    return chosen


def _with_section(chosen: Mapping[str, Any], section: str, fields: Mapping[str, Any]) -> dict[str, Any]:
    others = {dotted: value for dotted, value in chosen.items() if not dotted.startswith(f"{section}.")}
    return {**others, **{f"{section}.{name}": value for name, value in fields.items()}}


def _chosen(scenario: Scenario, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields that must be written: hardware set, members of families, fields without default."""
    chosen: dict[str, Any] = {"hardware": fields["hardware"]}
    if scenario.nominal.equals_truth:
        chosen["nominal.equals_truth"] = True
    for section, tag in FAMILIES:
        chosen[f"{section}.{tag}"] = fields[section][tag]
        member: BaseModel = getattr(scenario, section)
        for name, field in type(member).model_fields.items():
            if field.is_required():
                chosen[f"{section}.{name}"] = fields[section][name]
    return chosen


def _differences(fields: Mapping[str, Any], chosen: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields by dotted name that differ from those of a scenario with only the chosen fields."""
    defaults = _defaults(chosen)
    return {
        dotted: value for dotted, value in flat(fields).items() if defaults.get(dotted, defaults) != value
    }


def _defaults(chosen: Mapping[str, Any]) -> dict[str, Any]:
    """Return all fields by dotted name of a scenario with only the chosen ones."""
    base: dict[str, Any] = {}
    for dotted, value in chosen.items():
        override(base, dotted, value)
    return flat(_completed(base))


def _completed(fields: dict[str, Any]) -> dict[str, Any]:
    """Return all fields: the given ones and the defaults of the others."""
    fields = copy.deepcopy(fields)
    fill_hardware(fields)
    return validated(fields, "to be written").model_dump(mode="json")


def _flag(dotted: str, value: Any) -> list[str]:
    is_list = isinstance(value, list | tuple) and len(value) > 1 and not _has_tables(value)
    entries = value if is_list and not any(isinstance(entry, list | tuple) for entry in value) else [value]
    tokens = [entry if isinstance(entry, str) else json.dumps(entry, ensure_ascii=False) for entry in entries]
    return ["--" + dotted.replace("_", "-"), *tokens]


def _table(fields: Mapping[str, Any], path: str) -> Iterator[str]:
    """Yield the lines of a table: first its values, as TOML requires, then the tables in it."""
    for name, value in fields.items():
        if value is not None and not _has_tables(value):
            yield f"{name} = {_value(value)}"
    for name, value in fields.items():
        for table in value if isinstance(value, list) and _has_tables(value) else []:
            yield from ("", f"[[{path}{name}]]", *_table(table, f"{path}{name}."))
        if isinstance(value, dict):
            yield from ("", f"[{path}{name}]", *_table(value, f"{path}{name}."))


def _has_tables(value: Any) -> bool:
    entries = value if isinstance(value, list) else [value]
    return any(isinstance(entry, dict) for entry in entries)


def _value(value: Any) -> str:
    """Return the text of a value on one line; texts, numbers and booleans of JSON are valid TOML."""
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, dict):
        inside = (
            f"{json.dumps(name)} = {_value(entry)}" for name, entry in value.items() if entry is not None
        )
        return f"{{{', '.join(inside)}}}"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
