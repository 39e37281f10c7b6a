"""From TOML and flags to a scenario: files found, paths taken from where they are written, all checked."""

from __future__ import annotations

import copy
import json
import math
import os
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, get_args

import numpy as np
from pydantic import BaseModel, ValidationError

from spheretwin.models.base.errors import InputError, did_you_mean, is_plain, shown, without_breaks
from spheretwin.models.base.user_code import file_of, is_reference
from spheretwin.scenario.fields import INDEX, every_field, explain, fields_of, files_in, kind_of, section_kind
from spheretwin.scenario.sections import Scenario, scenario_with

FOLDER = resources.files("spheretwin") / "scenario" / "shipped"


def shipped() -> list[str]:
    """Names of the scenarios that come with the package."""
    return sorted(path.name.removesuffix(".toml") for path in FOLDER.iterdir() if path.name.endswith(".toml"))


def read(source: str) -> dict[str, Any]:
    """Fields of a shipped scenario or of a TOML file, by section.

    Raises
    ------
    InputError
        No such scenario, or a file that cannot be read.
    """
    path = _from_home(source)
    if source in shipped():
        text = (FOLDER / f"{source}.toml").read_text(encoding="utf-8")
    elif source.endswith(".toml"):
        try:
            text = Path(path).read_text(encoding="utf-8-sig")  # some editors write a byte-order mark
        except (OSError, ValueError) as error:  # ValueError: no UTF-8, or a zero in the path
            raise InputError(
                f"scenario {source}: expected a readable TOML file, {without_breaks(error)}"
            ) from None
    else:
        raise InputError(
            f"scenario: expected {', '.join(shipped())} or a .toml file,"
            f" received {shown(source)}{did_you_mean(source, shipped())}"
        )
    try:
        fields = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"scenario {source}: expected valid TOML, {without_breaks(error)}") from None
    return beside(os.path.dirname(path), fields)


def is_dotted(name: object) -> bool:
    """Whether a name can be that of a field."""
    return isinstance(name, str) and all(name.split(".")) and not name[0].isdecimal()


def override(fields: dict[str, Any], dotted: str, value: Any) -> None:
    """Put a value into fields by section, in place; a number is a place in a list of tables.

    Raises
    ------
    InputError
        The name is none of a field, or a place beyond the end of its list.
    """
    if not is_dotted(dotted):
        raise InputError(f"scenario: expected a field such as controller.law, received {shown(dotted)}")
    *sections, name = dotted.split(".")
    inside: Any = fields
    for section, below in zip(sections, [*sections[1:], name], strict=False):
        inside = _entered(inside, section, [] if below.isdecimal() else {}, dotted)
    if isinstance(inside, list):
        place = _place(inside, name, dotted)
        inside[place : place + 1] = [value]
    else:
        inside[name] = value


def _entered(inside: Any, part: str, empty: Any, dotted: str) -> Any:
    """What is in a section or a list under a name or at a place; made where it is not there yet."""
    if isinstance(inside, dict):
        found = inside.setdefault(part, empty)
    else:
        place = _place(inside, part, dotted)
        if place == len(inside):
            inside.append(empty)
        found = inside[place]
    if not isinstance(found, dict | list) and found is not empty:
        raise InputError(f"scenario: expected a section before the dot, received {dotted}")
    return found


def _place(inside: list[Any], part: str, dotted: str) -> int:
    """Place in a list, or the one behind its end."""
    place = int(part) if part.isdecimal() and len(part) < 6 else len(inside) + 1
    if place > len(inside):
        raise InputError(f"scenario: expected a place from 0 to {len(inside)} in a list, received {dotted}")
    return place


def beside(folder: str, fields: dict[str, Any]) -> dict[str, Any]:
    """Take the paths that fields by section name from a folder, in place; a second time changes nothing."""
    return with_files(fields, lambda path, _: os.path.join(folder, _from_home(path)))


def with_files(fields: dict[str, Any], told: Callable[[str, str], str]) -> dict[str, Any]:
    """Say otherwise which files fields by section name, in place.

    Parameters
    ----------
    fields : dict
    told : callable
        Of a path, or a reference into a file, and the field's name; returns what stands there instead.
    """
    for named in files_in(fields, section_kind(Scenario)):
        named.fields[named.name] = told(named.fields[named.name], named.dotted)
    for event in _events(fields):
        event["value"] = value_with_files(event["set"], event["value"], told)
    return fields


def resolve_value_paths(folder: str, dotted: str, value: Any) -> Any:
    """Value of one field, the paths in it taken from a folder."""
    return value_with_files(dotted, value, lambda path, _: os.path.join(folder, _from_home(path)))


def value_with_files(dotted: str, value: Any, told: Callable[[str, str], str]) -> Any:
    """Value of one field with other files; `told` as in `with_files`."""
    inside: Any = with_files(alone(dotted, copy.deepcopy(value)), told)
    for part in dotted.split("."):
        inside = inside[0] if isinstance(inside, list) else inside[part]
    return inside


def alone(dotted: str, value: Any) -> dict[str, Any]:
    """Fields by section that hold one value; a list of tables has it in its first place."""
    fields: dict[str, Any] = {}
    override(fields, ".".join("0" if part.isdecimal() else part for part in dotted.split(".")), value)
    return fields


def named_files(fields: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Every file that fields by section name, now and by their events: its path, and the field's name."""
    for named in files_in(fields, section_kind(Scenario)):
        path = named.fields[named.name]
        yield file_of(path) if is_reference(path) else path, named.dotted
    for event in _events(fields):
        yield from named_files(alone(event["set"], event["value"]))


def _events(fields: dict[str, Any]) -> list[dict[str, Any]]:
    """Events that are whole enough to look into; what else there is will be refused."""
    listed = fields.get("event")
    tables = [each for each in listed if isinstance(each, dict)] if isinstance(listed, list) else []
    return [each for each in tables if is_dotted(each.get("set")) and "value" in each]


def as_plain(value: Any) -> Any:
    """Arrays and NumPy's numbers as Python has them; anything else, as a date of a TOML file, as text."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def validated(fields: Mapping[str, Any], source: str, kind: type[Scenario] | None = None) -> Scenario:
    """Scenario of fields by section.

    Parameters
    ----------
    fields : mapping
        As JSON and TOML have them.
    source : str
        Where they come from, for complaints.
    kind : type, optional
        Class of the scenario; the one that has the law that the fields name unless given.

    Raises
    ------
    InputError
        A field that is unknown, of the wrong type or out of range.
    """
    scenario = from_json(as_json(source, fields), source, kind or scenario_type(fields))
    check_texts(source, scenario)
    return scenario


def scenario_type(fields: Mapping[str, Any]) -> type[Scenario]:
    """Class of the scenarios that have the law that fields by section name.

    Raises
    ------
    InputError
        The law is one in a file, and cannot be had.
    """
    controller = fields.get("controller")
    return scenario_with(controller.get("law") if isinstance(controller, Mapping) else None)


def from_json(text: str | bytes, source: str, kind: type[Scenario]) -> Scenario:
    """Scenario of JSON, checked but for its texts, which are `check_texts`'.

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
    except ValueError:  # a zero in the name of a user; it is refused where the path is used
        return path


def as_json(source: str, fields: Any) -> bytes:
    """Fields as JSON, so that arrays become tuples while numbers stay strictly typed.

    Raises
    ------
    InputError
        They are not as TOML has them.
    """
    try:
        return json.dumps(fields, default=as_plain, ensure_ascii=False).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(
            f"scenario {source}: expected sections and values as TOML has them, received {foreign(error)}"
        ) from None


def foreign(error: TypeError | ValueError | RecursionError) -> str:
    """Return what JSON cannot write, by the error of its writer."""
    if isinstance(error, UnicodeEncodeError):
        return f"a text with {shown(error.object[error.start])}"
    return "a name that is no text" if isinstance(error, TypeError) else "digits or levels without end"


def check_texts(source: str, scenario: Scenario) -> None:
    """Refuse what must not end up in terminals, in file names and in other programs' files.

    Raises
    ------
    InputError
        A name or a path has control characters.
    """
    for dotted, text, _ in fields_of(scenario):
        breaks = "\n\t" if dotted == "description" else ""
        if isinstance(text, str) and not is_plain("".join(each for each in text if each not in breaks)):
            raise InputError(
                f"scenario {source}: {dotted}: expected text without control characters,"
                f" received {shown(text)}"
            )


def overrides(tokens: Sequence[str]) -> dict[str, Any]:
    """Read ``--section.field value…`` pairs into values by dotted name.

    Numbers, ``true``, ``false`` and ``null`` are read as such, several values as a list; all else is text.
    A place in a list of tables is a number: ``--event.0.t-s 1``.

    Raises
    ------
    InputError
        A token is no flag, or a flag has no value.
    """
    found: dict[str, Any] = {}
    groups = _grouped(tokens)
    law = next((values[0] for flag, values in groups if flag == "controller.law" and values), None)
    texts = _text_fields(scenario_with(law)) if is_reference(law) else _TEXT_FIELDS
    for flag, values in groups:
        if not values:
            raise InputError(f"command line: expected a value after --{flag}, received none")
        name = flag.replace("-", "_")
        read = [text if _anywhere(name) in texts else _value(text) for text in values]
        found[name] = read[0] if len(read) == 1 else read
    return found


def described(scenario: Scenario) -> list[tuple[str, str, str]]:
    """Flag, value in force and meaning of every field of a scenario."""
    families = {
        f"{name}.{kind.discriminator}": f": {', '.join(kind.members)}"
        for name, field in every_field(type(scenario))
        if (kind := kind_of(field)) and kind.discriminator
    }
    return [
        (
            "--" + dotted.replace("_", "-"),
            _shown(value),
            (field.description or "") + families.get(_anywhere(dotted), ""),
        )
        for dotted, value, field in fields_of(scenario)
    ]


def _anywhere(dotted: str) -> str:
    """Name of a field, whatever its place in a list."""
    return re.sub(r"\.\d+(?=\.|$)", f".{INDEX}", dotted)


def _shown(value: Any) -> str:
    if isinstance(value, tuple):
        nested = any(isinstance(each, tuple) for each in value)
        return json.dumps(value) if nested else " ".join(map(_shown, value))
    if isinstance(value, dict | list | bool):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, float):
        return f"{value:g}"
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
        # Digits without end read as infinity; a complaint about them shall show what was given.
        return text if value in (math.inf, -math.inf) and "inf" not in text.lower() else value
    return text


def _is_text(annotation: Any) -> bool:
    return annotation is str or any(map(_is_text, get_args(annotation)))


def _text_fields(section: type[BaseModel]) -> set[str]:
    return {name for name, field in every_field(section) if _is_text(field.annotation)}


_TEXT_FIELDS = _text_fields(Scenario)
