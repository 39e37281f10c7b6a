"""Reading of scenarios from TOML and flags: locate files, resolve paths, validate all fields."""

from __future__ import annotations

import copy
import json
import math
import os
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any, get_args

import numpy as np
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from spheretwin.models.base.errors import (
    InputError,
    is_plain,
    shown,
    unknown_name,
    without_breaks,
)
from spheretwin.models.base.files import regular_file
from spheretwin.models.base.user_code import file_of, is_reference
from spheretwin.scenario.fields import (
    every_field,
    explain,
    families,
    fields_of,
    files_in,
    section_kind,
    without_indices,
)
from spheretwin.scenario.hardware import hardware_defaults
from spheretwin.scenario.sections import Scenario, scenario_with

FOLDER = resources.files("spheretwin") / "scenario" / "shipped"


def shipped() -> list[str]:
    """Return the names of the scenarios of the package."""
    return toml_names(FOLDER)


def toml_names(folder: Traversable) -> list[str]:
    """Return the names of the TOML files in a folder of the package."""
    return sorted(path.name.removesuffix(".toml") for path in folder.iterdir() if path.name.endswith(".toml"))


def read(source: str) -> dict[str, Any]:
    """Return the fields of a shipped scenario or of a TOML file, by section.

    Raises
    ------
    InputError
        The scenario does not exist, or its file cannot be read.
    """
    fields, folder = read_toml("scenario", source, FOLDER)
    return resolve_paths(str(FOLDER) if source in shipped() else folder, fields)


def read_toml(what: str, source: str, shipped_folder: Traversable) -> tuple[dict[str, Any], str]:
    """Return the contents of a TOML file, and the folder that it is in; none for a shipped one.

    Parameters
    ----------
    what : str
        Kind of the file, for messages.
    source : str
        A shipped name, or the path of a file; ``~`` is the user's home.
    shipped_folder : Traversable
        Folder of the package with the shipped files.

    Raises
    ------
    InputError
        The file does not exist, or cannot be read.
    """
    path, names = _from_home(source), toml_names(shipped_folder)
    if source in names:
        text = (shipped_folder / f"{source}.toml").read_text(encoding="utf-8")
    elif source.endswith(".toml"):
        try:
            text = regular_file(path).read_text(encoding="utf-8-sig")  # some editors write a byte-order mark
        except (OSError, ValueError) as error:  # ValueError: not UTF-8, or a null character in the path
            raise InputError(
                f"{what} {source}: expected a readable TOML file, {without_breaks(error)}"
            ) from None
    else:
        raise unknown_name(what, source, names, "{} or a .toml file")
    try:
        return tomllib.loads(text), os.path.dirname(path)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{what} {source}: expected valid TOML, {without_breaks(error)}") from None


def is_dotted(name: object) -> bool:
    """True if a name can be the dotted name of a field."""
    return isinstance(name, str) and all(name.split(".")) and not name[0].isdecimal()


def override(fields: dict[str, Any], dotted: str, value: Any) -> None:
    """Set a value in fields by section, in place; a number is an index of a list of tables.

    Raises
    ------
    InputError
        The name is not valid, or an index is beyond the end of its list.
    """
    if not is_dotted(dotted):
        raise InputError(f"scenario: expected a field such as controller.law, received {shown(dotted)}")
    *sections, name = dotted.split(".")
    inside: Any = fields
    for section, below in zip(sections, [*sections[1:], name], strict=False):
        inside = _enter(inside, section, [] if below.isdecimal() else {}, dotted)
    if isinstance(inside, list):
        place = _list_index(inside, name, dotted)
        inside[place : place + 1] = [value]
    else:
        inside[name] = value


def fill_hardware(fields: dict[str, Any]) -> None:
    """Fill in the values of the named hardware set for fields that are not set."""
    for dotted, value in hardware_defaults(fields).items():
        override(fields, dotted, value)


def _enter(inside: Any, part: str, empty: Any, dotted: str) -> Any:
    """Return the entry of a section or a list; create it if it does not exist."""
    if isinstance(inside, dict):
        entry = inside.setdefault(part, empty)
    else:
        place = _list_index(inside, part, dotted)
        if place == len(inside):
            inside.append(empty)
        entry = inside[place]
    if not isinstance(entry, dict | list) and entry is not empty:
        raise InputError(f"scenario: expected a section before the dot, received {dotted}")
    return entry


def _list_index(inside: list[Any], part: str, dotted: str) -> int:
    """Return an index of a list, or the one after its end."""
    place = int(part) if part.isdecimal() and len(part) < 6 else len(inside) + 1
    if place > len(inside):
        raise InputError(f"scenario: expected a list index from 0 to {len(inside)}, received {dotted}")
    return place


def resolve_paths(folder: str, fields: dict[str, Any]) -> dict[str, Any]:
    """Resolve the paths in fields by section relative to a folder, in place; idempotent."""
    return replace_files(fields, lambda path, _: os.path.join(folder, _from_home(path)))


def replace_files(fields: dict[str, Any], replace: Callable[[str, str], str]) -> dict[str, Any]:
    """Replace the files that fields by section name, in place.

    Parameters
    ----------
    fields : dict
    replace : callable
        Receives a path, or a reference into a file, and the name of the field; returns the replacement.
    """
    for named in files_in(fields, section_kind(Scenario)):
        named.fields[named.name] = replace(named.fields[named.name], named.dotted)
    for event in _events(fields):
        event["value"] = replace_value_files(event["set"], event["value"], replace)
    return fields


def resolve_value_paths(folder: str, dotted: str, value: Any) -> Any:
    """Return the value of one field with its paths resolved relative to a folder."""
    return replace_value_files(dotted, value, lambda path, _: os.path.join(folder, _from_home(path)))


def replace_value_files(dotted: str, value: Any, replace: Callable[[str, str], str]) -> Any:
    """Return the value of one field with replaced files; `replace` is as in `replace_files`."""
    inside: Any = replace_files(single_field(dotted, copy.deepcopy(value)), replace)
    for part in dotted.split("."):
        inside = inside[0] if isinstance(inside, list) else inside[part]
    return inside


def single_field(dotted: str, value: Any) -> dict[str, Any]:
    """Return fields by section with one value; in a list of tables it is the first entry."""
    fields: dict[str, Any] = {}
    override(fields, ".".join("0" if part.isdecimal() else part for part in dotted.split(".")), value)
    return fields


def named_files(fields: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield path and field name of every file that fields by section and their events name."""
    for named in files_in(fields, section_kind(Scenario)):
        path = named.fields[named.name]
        yield file_of(path) if is_reference(path) else path, named.dotted
    for event in _events(fields):
        yield from named_files(single_field(event["set"], event["value"]))


def _events(fields: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the events that are complete enough to be read; others are refused later."""
    listed = fields.get("event")
    tables = [event for event in listed if isinstance(event, dict)] if isinstance(listed, list) else []
    return [event for event in tables if is_dotted(event.get("set")) and "value" in event]


def as_plain(value: Any) -> Any:
    """Return an array or a NumPy number as Python values, and anything else, such as a date, as text."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def validated(fields: Mapping[str, Any], source: str, kind: type[Scenario] | None = None) -> Scenario:
    """Return the scenario of fields by section.

    Parameters
    ----------
    fields : mapping
        Values as in JSON and TOML.
    source : str
        Origin of the fields, for messages.
    kind : type, optional
        Class of the scenario; default: the class with the law that the fields name.

    Raises
    ------
    InputError
        A field that is unknown, of the wrong type or out of range.
    """
    scenario = from_json(as_json(source, fields), source, kind or scenario_type(fields))
    check_texts(source, scenario)
    return scenario


def scenario_type(fields: Mapping[str, Any]) -> type[Scenario]:
    """Return the class of the scenarios with the law that fields by section name.

    Raises
    ------
    InputError
        The law is in a file and cannot be loaded.
    """
    controller = fields.get("controller")
    return scenario_with(controller.get("law") if isinstance(controller, Mapping) else None)


def from_json(text: str | bytes, source: str, kind: type[Scenario]) -> Scenario:
    """Return the scenario of JSON, validated except for its texts, which `check_texts` checks.

    Raises
    ------
    InputError
        A field that is unknown, of the wrong type or out of range.
    """
    try:
        return kind.model_validate_json(text)
    except ValidationError as error:
        raise InputError(f"scenario {source}: {explain(error, kind)}") from None


def _from_home(path: str) -> str:
    try:
        return os.path.expanduser(path)
    except ValueError:  # a null character in a user name; it is refused when the path is used
        return path


def as_json(source: str, fields: Any) -> bytes:
    """Return fields as JSON, so that arrays become tuples while numbers stay strictly typed.

    Raises
    ------
    InputError
        A value is not possible in TOML.
    """
    try:
        return json.dumps(fields, default=as_plain, ensure_ascii=False).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(
            f"scenario {source}: expected sections and values as in TOML, received {foreign(error)}"
        ) from None


def foreign(error: TypeError | ValueError | RecursionError) -> str:
    """Return a description of the value that JSON cannot write, from the error of its writer."""
    if isinstance(error, UnicodeEncodeError):
        return f"a text with {shown(error.object[error.start])}"
    return "a name that is no text" if isinstance(error, TypeError) else "digits or levels without end"


def check_texts(source: str, scenario: Scenario) -> None:
    """Refuse text that is not safe in terminals, in file names and in files of other programs.

    Raises
    ------
    InputError
        A name or a path has control characters.
    """
    for dotted, text, _ in fields_of(scenario):
        breaks = "\n\t" if dotted == "description" else ""
        if isinstance(text, str) and not is_plain(
            "".join(character for character in text if character not in breaks)
        ):
            raise InputError(
                f"scenario {source}: {dotted}: expected text without control characters,"
                f" received {shown(text)}"
            )


def overrides(tokens: Sequence[str]) -> dict[str, Any]:
    """Read ``--section.field value…`` pairs into values by dotted name.

    Numbers, ``true``, ``false`` and ``null`` are read as such, several values as a list; all else is text.
    An index of a list of tables is a number: ``--event.0.t-s 1``.

    Raises
    ------
    InputError
        A token is not a flag, or a flag has no value.
    """
    values_by_name: dict[str, Any] = {}
    groups = _grouped(tokens)
    law = next((values[0] for flag, values in groups if flag == "controller.law" and values), None)
    texts = _text_fields(scenario_with(law)) if is_reference(law) else _TEXT_FIELDS
    for flag, values in groups:
        if not values:
            raise InputError(f"command line: expected a value after --{flag}, received none")
        name = flag.replace("-", "_")
        read = [text if without_indices(name) in texts else _value(text) for text in values]
        values_by_name[name] = read[0] if len(read) == 1 else read
    return values_by_name


def field_descriptions(scenario: Scenario) -> list[tuple[str, str, str]]:
    """Return flag, present value and meaning of every field of a scenario."""
    members = {name: f": {', '.join(of_family)}" for name, of_family in families(type(scenario)).items()}
    return [
        (
            "--" + dotted.replace("_", "-"),
            value_text(value),
            (field.description or "") + members.get(without_indices(dotted), ""),
        )
        for dotted, value, field in fields_of(scenario)
    ]


def described_fields(scenario: Scenario) -> list[tuple[str, Any, FieldInfo]]:
    """Return dotted name, value and description of every field of a resolved scenario.

    A resolved section repeats no description: it is that of the scenario.
    """
    return [
        (dotted, value, field if field.description else _DESCRIBED.get(dotted, field))
        for dotted, value, field in fields_of(scenario)
    ]


_DESCRIBED = dict(every_field(Scenario))


def value_text(value: Any, *, exact: bool = False) -> str:
    """Return a value as it is written after a flag, with six digits unless it is `exact`; empty for none."""
    if isinstance(value, tuple) and not any(isinstance(entry, tuple | dict) for entry in value):
        return " ".join(value_text(entry, exact=exact) for entry in value)
    if isinstance(value, tuple | dict | list | bool):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, float):
        short = f"{value:g}"
        return repr(value) if exact and float(short) != value else short
    return "" if value is None else str(value)


def _grouped(tokens: Sequence[str]) -> list[tuple[str, list[str]]]:
    groups: list[tuple[str, list[str]]] = []
    for token in tokens:
        if token.startswith("--"):
            flag, equals, value = token[2:].partition("=")
            groups.append((flag, [value] if equals else []))
        elif groups:
            groups[-1][1].append(token)
        else:
            raise InputError(f"command line: expected a flag such as --controller.law, received {token}")
    return groups


def _value(text: str) -> Any:
    for read in (json.loads, float):
        try:
            value = read(text)
        except (ValueError, RecursionError):
            continue
        # Too many digits read as infinity; a message about them must show the given text.
        return text if value in (math.inf, -math.inf) and "inf" not in text.lower() else value
    return text


def _is_text(annotation: Any) -> bool:
    return annotation is str or any(map(_is_text, get_args(annotation)))


def _text_fields(section: type[BaseModel]) -> set[str]:
    return {name for name, field in every_field(section) if _is_text(field.annotation)}


_TEXT_FIELDS = _text_fields(Scenario)
