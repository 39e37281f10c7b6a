"""Fields of a scenario by dotted name: sections, lists of sections, families selected by one field."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from types import NoneType, UnionType
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from spheretwin.models.base.errors import InputError, did_you_mean, shown
from spheretwin.models.base.user_code import is_reference

INDEX = "#"
"""In a dotted name: any index of a list."""

SHIPPED = "shipped"
"""Name of the shipped file in a field that contains this name or a path; mark of such a field."""


@dataclass(frozen=True)
class FieldKind:
    """Kind of a field that contains fields: section, family or list of them."""

    members: Mapping[str, type[BaseModel]]
    """Members by tag; a plain section is the only member, under the empty tag."""
    discriminator: str | None
    """Field that contains the tag."""
    is_list: bool = False

    def chosen(self, fields: Mapping[str, Any]) -> list[type[BaseModel]]:
        """Return the members that given fields can belong to: all if the fields have no valid tag."""
        tag = fields.get(self.discriminator) if self.discriminator else ""
        named = self.members.get(tag) if isinstance(tag, str) else None
        return [named] if named else list(self.members.values())


class FieldLocation(NamedTuple):
    """Location that a path of names, tags and indices leads to."""

    dotted: str
    kind: FieldKind | None
    """Kind of the field; None if it has no fields."""


class NamedFile(NamedTuple):
    """File that a field names."""

    fields: dict[str, Any]
    name: str
    dotted: str


def kind_of(field: FieldInfo) -> FieldKind | None:
    """Return the kind of a field that contains fields; None for a plain value."""
    return _kind(field.annotation, field.discriminator)


def section_kind(section: type[BaseModel]) -> FieldKind:
    """Return the kind of one plain section."""
    return FieldKind({"": section}, None)


def fields_of(section: BaseModel, prefix: str = "") -> Iterator[tuple[str, Any, FieldInfo]]:
    """Yield dotted name, value and description of every field of a section and of its sections."""
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            yield from fields_of(value, f"{prefix}{name}.")
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for i, entry in enumerate(value):
                yield from fields_of(entry, f"{prefix}{name}.{i}.")
        else:
            yield prefix + name, value, field


def every_field(section: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Yield dotted name and description of every field that a section can have, for all members."""
    for name, field in section.model_fields.items():
        yield prefix + name, field
        if kind := kind_of(field):
            below = f"{prefix}{name}.{INDEX}." if kind.is_list else f"{prefix}{name}."
            for member in kind.members.values():
                yield from every_field(member, below)


@lru_cache(maxsize=32)
def families(section: type[BaseModel]) -> dict[str, tuple[str, ...]]:
    """Return the names of the members of every family by the dotted name of the field that selects one."""
    return {
        f"{name}.{kind.discriminator}": tuple(kind.members)
        for name, field in every_field(section)
        if (kind := kind_of(field)) and kind.discriminator
    }


def flat(fields: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the values by dotted name; a list is one value."""
    values: dict[str, Any] = {}
    for name, value in fields.items():
        values |= flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else {prefix + name: value}
    return values


def without_indices(dotted: str) -> str:
    """Return the name of a field with every list index replaced by `INDEX`."""
    return re.sub(r"\.\d+(?=\.|$)", f".{INDEX}", dotted)


def place_of(scenario: type[BaseModel], path: tuple[str | int, ...]) -> FieldLocation:
    """Follow a path of pydantic, which contains the tag of each family."""
    dotted: list[str] = []
    kind: FieldKind | None = section_kind(scenario)
    entered: type[BaseModel] | None = scenario
    has_keys = True
    for part in path:
        if kind is None:
            if isinstance(part, int) or has_keys:  # otherwise it is the type of a member of a union
                dotted.append(str(part))
        elif kind.is_list:
            dotted.append(str(part))
            kind = replace(kind, is_list=False)
            entered = None if kind.discriminator else kind.members[""]
        elif entered is None and part in kind.members:
            entered = kind.members[str(part)]
            kind = section_kind(entered)
        else:
            dotted.append(str(part))
            field = entered.model_fields.get(str(part)) if entered else None
            kind = kind_of(field) if field else None
            has_keys = field is None or _holds(field.annotation, Mapping)
            entered = kind.members[""] if kind and not kind.discriminator and not kind.is_list else None
    return FieldLocation(".".join(dotted), kind)


def files_in(fields: dict[str, Any], kind: FieldKind, prefix: str = "") -> Iterator[NamedFile]:
    """Yield every file that given fields name, also in sections and lists of sections."""
    members = [_candidates(member) for member in kind.chosen(fields)]
    for name, value in fields.items():
        mark, inside = next((member[name] for member in members if name in member), (None, None))
        if _names_file(mark, value):
            yield NamedFile(fields, name, prefix + name)
        elif inside:
            is_list = isinstance(value, list) and inside.is_list
            for i, entry in enumerate(value if is_list else [value]):
                if isinstance(entry, dict):
                    below = f"{prefix}{name}.{i}." if is_list else f"{prefix}{name}."
                    yield from files_in(entry, inside, below)


def _holds(annotation: Any, kind: type) -> bool:
    """True if an annotation, or a part of it, is of a kind."""
    origin = get_origin(annotation) or annotation
    is_kind = isinstance(origin, type) and issubclass(origin, kind)
    return is_kind or any(_holds(part, kind) for part in get_args(annotation))


@cache
def _candidates(section: type[BaseModel]) -> dict[str, tuple[Any, FieldKind | None]]:
    """Return mark and kind of each field of a section that can name a file or contain fields."""
    extras = {name: field.json_schema_extra for name, field in section.model_fields.items()}
    marks = {name: extra.get("path") if isinstance(extra, dict) else None for name, extra in extras.items()}
    kinds = {name: kind_of(field) for name, field in section.model_fields.items()}
    return {name: (marks[name], kinds[name]) for name in marks if marks[name] or kinds[name]}


def _names_file(mark: Any, value: Any) -> bool:
    """True if the value of a field with this mark names a file."""
    if mark == "code":
        return is_reference(value)
    is_name = mark == SHIPPED and value == SHIPPED
    return bool(mark and isinstance(value, str) and value and not is_name)


def _kind(annotation: Any, discriminator: Any) -> FieldKind | None:
    origin, inside = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        tags = [info.discriminator for info in inside[1:] if isinstance(info, FieldInfo)]
        return _kind(inside[0], next(filter(None, tags), discriminator))
    if origin is tuple and inside[-1] is Ellipsis:
        kind = _kind(inside[0], None)
        return kind and replace(kind, is_list=True)
    if origin in (Union, UnionType):
        return _of_union([member for member in inside if member is not NoneType], discriminator)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return _of_union([annotation], discriminator) if discriminator else section_kind(annotation)
    return None


def _of_union(members: list[Any], discriminator: Any) -> FieldKind | None:
    if isinstance(discriminator, str):
        return FieldKind(
            {member.model_fields[discriminator].default: member for member in members}, discriminator
        )
    return _kind(members[0], None) if len(members) == 1 else None


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
"""Expected value by the type of a pydantic error, with the values of its context."""

OTHERWISE = "a valid value"
"""Expected value of a type that only a section of the user has."""


class SettingsModel(BaseModel):
    """Settings of a function: a value that they cannot have is an `InputError`, as in a scenario."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise InputError(f"settings: {explain(error, type(self))}") from None


def explain(error: ValidationError, scenario: type[BaseModel]) -> str:
    """Return the first error of a validation on one line: field, expected value, received value."""
    first = _first_error(error.errors(include_url=False))
    path = first["loc"]
    place, received = place_of(scenario, path), shown(first["input"])
    here = f"{place.dotted}: " if place.dotted else ""
    if numbers := _numbers_of(first["type"], place.dotted, scenario):
        name, _, index = place.dotted.rpartition(".")
        named = name if index.isdecimal() else place.dotted
        return f"{named}: expected {numbers}, received {received}"
    match first["type"]:
        case "value_error":
            message = str(first["ctx"]["error"])
            return here + message
        case "json_invalid":
            return "expected sections and values as in TOML, with fewer levels of nesting or fewer digits"
        case "extra_forbidden":
            return _unknown(path, scenario)
        case "missing":
            return f"{here}expected a value, received none"
        case "union_tag_not_found" | "union_tag_invalid" if place.kind:
            return f"{place.dotted}.{_unknown_member(place.kind, first['input'])}"
        case "literal_error":
            valid = re.findall("'([^']*)'", first["ctx"]["expected"])
            received += did_you_mean(str(first["input"]), valid)
    return f"{here}expected {_expected(first)}, received {received}"


def _first_error(errors: list[Any]) -> Any:
    """Return the first error; of a list where one number or a list is expected, the error of the list."""
    first = errors[0]
    if not (isinstance(first["input"], list) and str(first["loc"][-1]).endswith("float")):
        return first
    return next((error for error in errors if error["loc"][: len(first["loc"])] != first["loc"]), first)


NUMBERS = {2: "two numbers", 3: "three numbers", 4: "four numbers", 6: "six numbers"}


def _numbers_of(kind: str, dotted: str, scenario: type[BaseModel]) -> str:
    """Return how many numbers a list must have, if an error says that it has another number or is no list."""
    if kind not in ("missing", "tuple_type", "too_long"):
        return ""
    name, _, index = dotted.rpartition(".")
    listed = without_indices(name if kind == "missing" and index.isdecimal() else dotted)
    field = next((field for known, field in every_field(scenario) if known == listed), None)
    return NUMBERS.get(_length(field.annotation), "") if field else ""


def _length(annotation: Any) -> int:
    """Return the length of the list of numbers that an annotation contains; 0 if there is none."""
    inside = get_args(annotation)
    if get_origin(annotation) is tuple:
        return 0 if Ellipsis in inside or any(get_origin(part) is tuple for part in inside) else len(inside)
    return max(map(_length, inside), default=0)


def _expected(error: Mapping[str, Any]) -> str:
    """Return the expected value of a field, without terms of Python and pydantic."""
    context = error.get("ctx", {})
    try:
        text = EXPECTED.get(error["type"], OTHERWISE).format(**context)
    except (KeyError, ValueError):  # a bound that is not a number
        text = OTHERWISE
    return text.replace(" 1 characters", " 1 character").replace(" 1 entries", " 1 entry")


def _unknown_member(kind: FieldKind, table: Any) -> str:
    """Return the message for a member that its family does not have."""
    tag = table.get(kind.discriminator) if isinstance(table, dict) else None  # the error's own tag is text
    near = did_you_mean(str(tag), kind.members)
    received = "none" if tag is None else shown(tag)
    more = " or FILE.py:NAME" if _allows_user_code(kind) else ""
    return f"{kind.discriminator}: expected one of {', '.join(kind.members)}{more}, received {received}{near}"


def _allows_user_code(kind: FieldKind) -> bool:
    member = next(iter(kind.members.values()))
    extra = member.model_fields[kind.discriminator or ""].json_schema_extra
    return isinstance(extra, dict) and extra.get("path") == "code"


def _unknown(path: tuple[str | int, ...], scenario: type[BaseModel]) -> str:
    """Return the message for a name that its section does not have."""
    *above, name = path
    place = place_of(scenario, tuple(above))
    members = place.kind.members.values() if place.kind else ()
    fields = {field: info for member in members for field, info in member.model_fields.items()}
    here = f"{place.dotted}." if place.dotted else ""
    everywhere = (
        dotted
        for dotted, _ in every_field(scenario)
        if INDEX not in dotted and not (here and dotted.startswith(here))
    )
    elsewhere = next((f"; did you mean {d}?" for d in everywhere if d.endswith(f".{name}")), "")
    other = new_name(str(name), fields) or _field_of_another(path, scenario)
    return (
        f"expected one of {', '.join(fields)} in {place.dotted or 'the scenario'},"
        f" received {name}{other or did_you_mean(str(name), fields) or elsewhere}"
    )


def new_name(former: str, fields: Mapping[str, FieldInfo]) -> str:
    """Return a hint if a name is the former name of a field, which the mark `former` of the field states."""
    for dotted, field in fields.items():
        above, dot, _ = dotted.rpartition(".")
        extra = field.json_schema_extra
        if isinstance(extra, dict) and former == f"{above}{dot}{extra.get('former')}":
            return f", the former name of {dotted.replace(INDEX, '0')}"
    return ""


def _field_of_another(path: tuple[str | int, ...], scenario: type[BaseModel]) -> str:
    """Return a hint if a field belongs to another member of its family, which a flag may have selected."""
    if len(path) < 3:
        return ""
    *above, tag, name = path
    family = place_of(scenario, tuple(above)).kind
    if family is None or family.is_list or tag not in family.members:
        return ""
    owners = [other for other, member in family.members.items() if name in member.model_fields]
    return f", a field of {family.discriminator} {' and '.join(owners)}, not of {tag}" if owners else ""


# Ends of names, the longest first.
UNITS = {
    "_rad_s3": "rad/s³", "_rad_s2": "rad/s²", "_Nm_rad": "N·m/rad", "_kg_m2": "kg·m²", "_rad_s": "rad/s",
    "_Nm_s": "N·m·s", "_m_s2": "m/s²", "_per_K": "1/K", "_degC": "°C", "_ohm": "Ω", "_mrad": "mrad",
    "_rad": "rad",
    "_A_V": "A/V", "_A_s": "A/s", "_J_K": "J/K", "_K_W": "K/W", "_lsb": "LSB", "_Nm": "N·m", "_kg": "kg",
    "_Hz": "Hz", "_m": "m", "_s": "s", "_A": "A", "_V": "V", "_H": "H", "_J": "J", "duration": "s",
}  # fmt: skip


def unit_of(dotted: str) -> str:
    """Return the unit at the end of the name of a field; empty for a number without unit, and for a text."""
    return next((unit for end, unit in UNITS.items() if dotted.endswith(end)), "")


def quantity_text(dotted: str) -> str:
    """Return the name of a field or a metric in words, with its unit: ``drive delay, s``."""
    name = re.sub(r"(\.\d+)+$", "", dotted)
    end = next((end for end in UNITS if end.startswith("_") and name.endswith(end)), "")
    words = f"{name.removesuffix(end)}{dotted[len(name) :]}".replace("max_abs_", "largest ")
    return ", ".join(filter(None, (re.sub("[._]", " ", words), unit_of(name))))
