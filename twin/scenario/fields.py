"""The fields of a scenario by dotted name: sections, lists of them, and families told apart by one field."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import NoneType, UnionType
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from spheretwin.models.base.user_code import is_reference

INDEX = "#"
"""In a dotted name: any place of a list."""

SHIPPED = "shipped"
"""Name of the shipped file in a field that holds this name or a path; its mark in such a field."""


@dataclass(frozen=True)
class Kind:
    """What a field holds that has fields itself."""

    members: Mapping[str, type[BaseModel]]
    """By tag; a plain section is the only one, under no tag."""
    told_apart_by: str | None
    """Field that holds the tag."""
    is_list: bool = False

    def chosen(self, fields: Mapping[str, Any]) -> list[type[BaseModel]]:
        """Members that given fields may be of: all where they do not say."""
        tag = fields.get(self.told_apart_by) if self.told_apart_by else ""
        named = self.members.get(tag) if isinstance(tag, str) else None
        return [named] if named else list(self.members.values())


class Place(NamedTuple):
    """Where a path of names, tags and indices leads."""

    dotted: str
    kind: Kind | None
    """What is there; None where it has no fields."""


class Named(NamedTuple):
    """A file that a field names."""

    fields: dict[str, Any]
    name: str
    dotted: str


def kind_of(field: FieldInfo) -> Kind | None:
    """What a field holds that has fields itself; None for a plain value."""
    return _kind(field.annotation, field.discriminator)


def section_kind(section: type[BaseModel]) -> Kind:
    """Kind of one plain section."""
    return Kind({"": section}, None)


def fields_of(section: BaseModel, prefix: str = "") -> Iterator[tuple[str, Any, FieldInfo]]:
    """Dotted name, value and description of every field of a section, and of the sections in it."""
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            yield from fields_of(value, f"{prefix}{name}.")
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for i, each in enumerate(value):
                yield from fields_of(each, f"{prefix}{name}.{i}.")
        else:
            yield prefix + name, value, field


def every_field(section: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Dotted name and description of every field that a section can have, whichever members are chosen."""
    for name, field in section.model_fields.items():
        yield prefix + name, field
        if kind := kind_of(field):
            below = f"{prefix}{name}.{INDEX}." if kind.is_list else f"{prefix}{name}."
            for member in kind.members.values():
                yield from every_field(member, below)


def place_of(scenario: type[BaseModel], path: tuple[str | int, ...]) -> Place:
    """Follow a path as pydantic gives it, in which tags stand where a family is entered."""
    dotted: list[str] = []
    kind: Kind | None = section_kind(scenario)
    entered: type[BaseModel] | None = scenario
    has_keys = True
    for part in path:
        if kind is None:
            if isinstance(part, int) or has_keys:  # else it is the type of a member of a union
                dotted.append(str(part))
        elif kind.is_list:
            dotted.append(str(part))
            kind = replace(kind, is_list=False)
            entered = None if kind.told_apart_by else kind.members[""]
        elif entered is None and part in kind.members:
            entered = kind.members[str(part)]
            kind = section_kind(entered)
        else:
            dotted.append(str(part))
            field = entered.model_fields.get(str(part)) if entered else None
            kind = kind_of(field) if field else None
            has_keys = field is None or _holds(field.annotation, Mapping)
            entered = kind.members[""] if kind and not kind.told_apart_by and not kind.is_list else None
    return Place(".".join(dotted), kind)


def files_in(fields: dict[str, Any], kind: Kind, prefix: str = "") -> Iterator[Named]:
    """Every file that given fields name, sections and lists of them included."""
    members = kind.chosen(fields)
    for name, value in fields.items():
        field = next((each.model_fields[name] for each in members if name in each.model_fields), None)
        if field is None:
            continue
        if _names_file(field, value):
            yield Named(fields, name, prefix + name)
        elif inside := kind_of(field):
            whole = isinstance(value, list) and inside.is_list
            for i, each in enumerate(value if whole else [value]):
                if isinstance(each, dict):
                    below = f"{prefix}{name}.{i}." if whole else f"{prefix}{name}."
                    yield from files_in(each, inside, below)


def _holds(annotation: Any, kind: type) -> bool:
    """True if an annotation is of a kind, or has a part that is."""
    origin = get_origin(annotation) or annotation
    is_kind = isinstance(origin, type) and issubclass(origin, kind)
    return is_kind or any(_holds(part, kind) for part in get_args(annotation))


def _names_file(field: FieldInfo, value: Any) -> bool:
    extra = field.json_schema_extra
    mark = extra.get("path") if isinstance(extra, dict) else None
    if mark == "code":
        return is_reference(value)
    is_name = mark == SHIPPED and value == SHIPPED
    return bool(mark and isinstance(value, str) and value and not is_name)


def _kind(annotation: Any, told_apart_by: Any) -> Kind | None:
    origin, inside = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        tags = [each.discriminator for each in inside[1:] if isinstance(each, FieldInfo)]
        return _kind(inside[0], next(filter(None, tags), told_apart_by))
    if origin is tuple and inside[-1] is Ellipsis:
        kind = _kind(inside[0], None)
        return kind and replace(kind, is_list=True)
    if origin in (Union, UnionType):
        return _of_union([each for each in inside if each is not NoneType], told_apart_by)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return _of_union([annotation], told_apart_by) if told_apart_by else section_kind(annotation)
    return None


def _of_union(members: list[Any], told_apart_by: Any) -> Kind | None:
    if isinstance(told_apart_by, str):
        return Kind({each.model_fields[told_apart_by].default: each for each in members}, told_apart_by)
    return _kind(members[0], None) if len(members) == 1 else None
