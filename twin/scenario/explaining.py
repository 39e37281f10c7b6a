"""What is wrong with a scenario, told on one line."""

from __future__ import annotations

import re
from typing import Any

from pydantic import BaseModel, ValidationError

from spheretwin.models.base.wording import did_you_mean, shown
from spheretwin.twin.scenario.fields import INDEX, Kind, every_field, place_of


def explain(error: ValidationError, scenario: type[BaseModel]) -> str:
    """First complaint of a validation on one line: field, what was expected, what was received."""
    first = error.errors(include_url=False)[0]
    path = first["loc"]
    place, received = place_of(scenario, path), shown(first["input"])
    match first["type"]:
        case "value_error":
            complaint = str(first["ctx"]["error"])
            return f"{place.dotted}: {complaint}" if path else complaint
        case "json_invalid":
            return f"expected sections and values as TOML has them, received {first['ctx']['error']}"
        case "extra_forbidden":
            return _unknown(path, scenario)
        case "missing":
            return f"{place.dotted}: expected a value, received none"
        case "union_tag_not_found" | "union_tag_invalid" if place.kind:
            return f"{place.dotted}.{_untold(place.kind, first['ctx'].get('tag'))}"
        case "literal_error":
            valid = re.findall("'([^']*)'", first["ctx"]["expected"])
            near = did_you_mean(str(first["input"]), valid)
            return f"{place.dotted}: expected {first['ctx']['expected']}, received {received}{near}"
    expected = first["msg"].removeprefix("Input should be ")
    return f"{place.dotted}: expected {expected}, received {received}"


def _untold(kind: Kind, tag: Any) -> str:
    """Complaint about a member that its family does not have."""
    near = did_you_mean(str(tag), kind.members)
    received = "none" if tag is None else shown(tag)
    own = " or FILE.py:NAME" if _may_be_own(kind) else ""
    return f"{kind.told_apart_by}: expected one of {', '.join(kind.members)}{own}, received {received}{near}"


def _may_be_own(kind: Kind) -> bool:
    member = next(iter(kind.members.values()))
    extra = member.model_fields[kind.told_apart_by or ""].json_schema_extra
    return isinstance(extra, dict) and extra.get("path") == "code"


def _unknown(path: tuple[str | int, ...], scenario: type[BaseModel]) -> str:
    """Complaint about a name that its section does not have."""
    *above, name = path
    place = place_of(scenario, tuple(above))
    members = place.kind.members.values() if place.kind else ()
    valid = list(dict.fromkeys(field for member in members for field in member.model_fields))
    here = f"{place.dotted}." if place.dotted else ""
    everywhere = (
        dotted
        for dotted, _ in every_field(scenario)
        if INDEX not in dotted and not (here and dotted.startswith(here))
    )
    elsewhere = next((f"; did you mean {d}?" for d in everywhere if d.endswith(f".{name}")), "")
    other = _field_of_another(path, scenario)
    return (
        f"expected one of {', '.join(valid)} in {place.dotted or 'the scenario'},"
        f" received {name}{other or did_you_mean(str(name), valid) or elsewhere}"
    )


def _field_of_another(path: tuple[str | int, ...], scenario: type[BaseModel]) -> str:
    """What is amiss where a field is that of another member of its family: a flag may have chosen this."""
    if len(path) < 3:
        return ""
    *above, tag, name = path
    family = place_of(scenario, tuple(above)).kind
    if family is None or family.is_list or tag not in family.members:
        return ""
    owners = [each for each, member in family.members.items() if name in member.model_fields]
    return f", a field of {family.told_apart_by} {' and '.join(owners)}, not of {tag}" if owners else ""
