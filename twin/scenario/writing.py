"""A scenario written down: as a file, or as a command line; read again, either gives the same scenario."""

from __future__ import annotations

import copy
import json
import shlex
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from spheretwin.scenario.changes import fields_with
from spheretwin.scenario.reading import override, read, shipped, validated
from spheretwin.scenario.sections import Scenario, hardware_defaults

# A shipped scenario that sets little: one that is not shipped is told by how it differs from it.
PLAIN = "tilt"

# Families, and what tells their members apart.
FAMILIES = (("trajectory", "shape"), ("controller", "law"), ("estimator", "kind"))


def as_toml(scenario: Scenario) -> str:
    """File of a scenario: what differs from what it is where a file does not say."""
    fields = scenario.model_dump(mode="json")
    chosen = _chosen(scenario, fields)
    if any(value is None for value in _differences(fields, chosen).values()):
        # No file can say of a field that it has no value: then none of the set's is left out either.
        fields["hardware"] = chosen["hardware"] = "ideal"
    told: dict[str, Any] = {"name": scenario.name}
    for dotted, value in {**chosen, **_differences(fields, chosen)}.items():
        if value is not None:
            override(told, dotted, value)
    return "\n".join(_table(told, "")).strip() + "\n"


def as_command(scenario: Scenario) -> str:
    """Command line that runs a scenario."""
    fields = scenario.model_dump(mode="json")
    chosen = _chosen(scenario, fields)
    name = scenario.name if scenario.name in shipped() else PLAIN
    if read(name)["trajectory"]["shape"] != chosen["trajectory.shape"]:
        name = PLAIN
    base = _flat(_completed(read(name)))
    flags = {dotted: value for dotted, value in chosen.items() if base.get(dotted) != value}
    known = _flat(_completed(fields_with(name, flags)))
    flags |= {dotted: value for dotted, value in _flat(fields).items() if known.get(dotted, known) != value}
    tokens = [token for dotted, value in flags.items() for token in _flag(dotted, value)]
    return shlex.join(["spheretwin", "simulate", name, *tokens])


def _chosen(scenario: Scenario, fields: Mapping[str, Any]) -> dict[str, Any]:
    """What has to be said: the named set, the member of each family, and what a member has no default for."""
    found: dict[str, Any] = {"hardware": fields["hardware"]}
    if scenario.nominal.equals_truth:
        found["nominal.equals_truth"] = True
    for section, tag in FAMILIES:
        found[f"{section}.{tag}"] = fields[section][tag]
        member: BaseModel = getattr(scenario, section)
        for name, field in type(member).model_fields.items():
            if field.is_required():
                found[f"{section}.{name}"] = fields[section][name]
    return found


def _differences(fields: Mapping[str, Any], chosen: Mapping[str, Any]) -> dict[str, Any]:
    """Fields by dotted name that are other than where only what is chosen is said."""
    begun: dict[str, Any] = {}
    for dotted, value in chosen.items():
        override(begun, dotted, value)
    known = _flat(_completed(begun))
    return {dotted: value for dotted, value in _flat(fields).items() if known.get(dotted, known) != value}


def _completed(fields: dict[str, Any]) -> dict[str, Any]:
    """All fields, as they are where a file says only some."""
    fields = copy.deepcopy(fields)
    for dotted, value in hardware_defaults(fields, fields.get("hardware")).items():
        override(fields, dotted, value)
    return validated(fields, "to be written").model_dump(mode="json")


def _flat(fields: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Values by dotted name; a list is one value."""
    found: dict[str, Any] = {}
    for name, value in fields.items():
        found |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {prefix + name: value}
    return found


def _flag(dotted: str, value: Any) -> list[str]:
    several = isinstance(value, list) and len(value) > 1 and not _has_tables(value)
    texts = value if several and not any(isinstance(each, list) for each in value) else [value]
    told = [text if isinstance(text, str) else json.dumps(text, ensure_ascii=False) for text in texts]
    return ["--" + dotted.replace("_", "-"), *told]


def _table(fields: Mapping[str, Any], path: str) -> Iterator[str]:
    """Lines of a table: its values first, as TOML wants them, then the tables in it."""
    for name, value in fields.items():
        if value is not None and not _has_tables(value):
            yield f"{name} = {_value(value)}"
    for name, value in fields.items():
        for each in value if isinstance(value, list) and _has_tables(value) else []:
            yield from ("", f"[[{path}{name}]]", *_table(each, f"{path}{name}."))
        if isinstance(value, dict):
            yield from ("", f"[{path}{name}]", *_table(value, f"{path}{name}."))


def _has_tables(value: Any) -> bool:
    inside = value if isinstance(value, list) else [value]
    return any(isinstance(each, dict) for each in inside)


def _value(value: Any) -> str:
    """A value on one line; JSON's texts, numbers and truths are TOML's too."""
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, dict):
        inside = (f"{json.dumps(name)} = {_value(each)}" for name, each in value.items() if each is not None)
        return f"{{{', '.join(inside)}}}"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
