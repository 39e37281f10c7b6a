"""What is wrong with a scenario, told on one line."""

from __future__ import annotations

import re
from typing import Any

from pydantic import BaseModel, ValidationError

from spheretwin.models.base.wording import did_you_mean, shown
from spheretwin.twin.scenario.fields import fields_of
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.trajectories.shapes import Trajectory


def explain(error: ValidationError) -> str:
    """First complaint of a validation on one line: field, what was expected, what was received."""
    first = error.errors(include_url=False)[0]
    path = [str(part) for part in first["loc"]]
    field, received = _dotted(path), shown(first["input"])
    match first["type"]:
        case "value_error":
            complaint = str(first["ctx"]["error"])
            return f"{field}: {complaint}" if path else complaint
        case "json_invalid":
            return f"expected sections and values as TOML has them, received {first['ctx']['error']}"
        case "extra_forbidden":
            return _unknown(path)
        case "missing":
            return f"{field}: expected a value, received none"
        case "union_tag_not_found" | "union_tag_invalid":
            tag, shapes = first["ctx"].get("tag"), [*_by_shape()]
            near = did_you_mean(str(tag), shapes)
            received = "none" if tag is None else shown(tag)
            return f"{field}.shape: expected one of {', '.join(shapes)}, received {received}{near}"
        case "literal_error":
            valid = re.findall("'([^']*)'", first["ctx"]["expected"])
            near = did_you_mean(str(first["input"]), valid)
            return f"{field}: expected {first['ctx']['expected']}, received {received}{near}"
    expected = first["msg"].removeprefix("Input should be ")
    return f"{field}: expected {expected}, received {received}"


def _unknown(path: list[str]) -> str:
    """Complaint about a name that its section does not have."""
    *section, name = path
    valid = _names_at(section)
    elsewhere = next((f"; did you mean {d}?" for d in fields_of(Scenario) if d.endswith(f".{name}")), "")
    return (
        f"expected one of {', '.join(valid)} in {_dotted(section) or 'the scenario'},"
        f" received {name}{did_you_mean(name, valid) or elsewhere}"
    )


def _names_at(path: list[str]) -> list[str]:
    """Valid names of the section at `path`, whose union tags pydantic puts into the path."""
    section: Any = Scenario
    for part in path:
        if part == "trajectory":
            section = _by_shape()
        elif isinstance(section, dict):
            section = section[part]
        else:
            section = section.model_fields[part].annotation
    return list(section.model_fields)


def _by_shape() -> dict[str, type[BaseModel]]:
    union, *_ = Trajectory.__args__
    return {kind.model_fields["shape"].default: kind for kind in union.__args__}


def _dotted(path: list[str]) -> str:
    tags = _by_shape()
    return ".".join(part for i, part in enumerate(path) if not (i == 1 and part in tags))
