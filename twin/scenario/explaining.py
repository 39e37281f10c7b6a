"""Messages about invalid sections: pydantic's errors in words of the domain, on one line."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from spheretwin.models.base.wording import did_you_mean, shown
from spheretwin.twin.scenario.fields import INDEX, Kind, every_field, place_of

EXPECTED = {
    "bool_parsing": "true or false",
    "bool_type": "true or false",
    "dict_type": "a table of fields",
    "finite_number": "a finite number",
    "float_parsing": "a number",
    "float_type": "a number",
    "greater_than": "a number greater than {gt:.10g}",
    "greater_than_equal": "a number greater than or equal to {ge:.10g}",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number of fewer digits",
    "int_type": "a whole number",
    "less_than": "a number less than {lt:.10g}",
    "less_than_equal": "a number less than or equal to {le:.10g}",
    "list_type": "a list",
    "literal_error": "{expected}",
    "missing": "a value",
    "model_attributes_type": "a table of fields",
    "model_type": "a table of fields",
    "multiple_of": "a multiple of {multiple_of:.10g}",
    "none_required": "no value",
    "string_pattern_mismatch": "text of the form {pattern}",
    "string_too_long": "text of at most {max_length} characters",
    "string_too_short": "text of at least {min_length} characters",
    "string_type": "text",
    "string_unicode": "text",
    "too_long": "at most {max_length} entries",
    "too_short": "at least {min_length} entries",
    "tuple_type": "a list",
}
"""What a kind of error asks for, with the figures of its context."""

OTHERWISE = "a valid value"
"""What is expected where a user's own section has a type that no shipped one has."""


def explain(error: ValidationError, scenario: type[BaseModel]) -> str:
    """First complaint of a validation on one line: field, what was expected, what was received."""
    first = error.errors(include_url=False)[0]
    path = first["loc"]
    place, received = place_of(scenario, path), shown(first["input"])
    here = f"{place.dotted}: " if place.dotted else ""
    match first["type"]:
        case "value_error":
            complaint = str(first["ctx"]["error"])
            return here + complaint
        case "json_invalid":
            return "expected sections and values as TOML has them, nested less deeply or with fewer digits"
        case "extra_forbidden":
            return _unknown(path, scenario)
        case "missing":
            return f"{here}expected a value, received none"
        case "union_tag_not_found" | "union_tag_invalid" if place.kind:
            return f"{place.dotted}.{_untold(place.kind, first['input'])}"
        case "literal_error":
            valid = re.findall("'([^']*)'", first["ctx"]["expected"])
            received += did_you_mean(str(first["input"]), valid)
    return f"{here}expected {_expected(first)}, received {received}"


def _expected(error: Mapping[str, Any]) -> str:
    """Return what a field asks for, without the words of Python and pydantic."""
    context = error.get("ctx", {})
    try:
        text = EXPECTED.get(error["type"], OTHERWISE).format(**context)
    except (KeyError, ValueError):  # a bound that is no number
        text = OTHERWISE
    return text.replace(" 1 characters", " 1 character").replace(" 1 entries", " 1 entry")


def _untold(kind: Kind, table: Any) -> str:
    """Complaint about a member that its family does not have."""
    tag = table.get(kind.told_apart_by) if isinstance(table, dict) else None  # the error's own tag is text
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
