"""From TOML and flags to a scenario: files found, paths taken from where they are written, all checked."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import did_you_mean, is_plain, shown
from spheretwin.twin.scenario.explaining import explain
from spheretwin.twin.scenario.fields import fields_of
from spheretwin.twin.scenario.sections import Scenario

PATHS = ("plant.mjcf", "plant.torque_curve", "nominal.torque_curve")
"""Fields that name a file."""

FOLDER = resources.files("spheretwin.twin") / "scenario" / "shipped"


def shipped() -> list[str]:
    """Names of the scenarios that come with the package."""
    return sorted(path.name.removesuffix(".toml") for path in FOLDER.iterdir() if path.name.endswith(".toml"))


def beside(folder: str, fields: dict[str, Any]) -> dict[str, Any]:
    """Take the paths that fields by section name from a folder, in place; a second time changes nothing."""
    for dotted in PATHS:
        section, name = dotted.split(".")
        inside = fields.get(section)
        if isinstance(inside, dict) and isinstance(inside.get(name), str) and inside[name]:
            inside[name] = os.path.join(folder, _from_home(inside[name]))
    return fields


def as_plain(value: Any) -> Any:
    """Arrays and NumPy's numbers as Python has them; anything else, as a date of a TOML file, as text."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def validated(fields: Mapping[str, Any], source: str) -> Scenario:
    """Scenario of fields by section.

    Raises
    ------
    InputError
        A field that is unknown, of the wrong type or out of range.
    """
    try:
        scenario = Scenario.model_validate_json(_as_json(source, fields))
    except ValidationError as error:
        raise InputError(f"scenario {source}: {explain(error)}") from None
    _check_texts(source, scenario)
    return scenario


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
            raise InputError(f"scenario {source}: expected a readable TOML file, {error}") from None
    else:
        raise InputError(
            f"scenario: expected {', '.join(shipped())} or a .toml file,"
            f" received {shown(source)}{did_you_mean(source, shipped())}"
        )
    try:
        fields = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"scenario {source}: expected valid TOML, {error}") from None
    return beside(os.path.dirname(path), fields)


def _from_home(path: str) -> str:
    try:
        return os.path.expanduser(path)
    except ValueError:  # a zero in the name of a user; it is refused where the path is used
        return path


def override(fields: dict[str, Any], dotted: str, value: Any) -> None:
    """Put a value into fields by section, in place.

    Raises
    ------
    InputError
        The name is none of a field.
    """
    if not isinstance(dotted, str) or not all(dotted.split(".")):
        raise InputError(f"scenario: expected a field such as controller.law, received {shown(dotted)}")
    *sections, name = dotted.split(".")
    for section in sections:
        fields = fields.setdefault(section, {})
        if not isinstance(fields, dict):
            raise InputError(f"scenario: expected a section before the dot, received {dotted}")
    fields[name] = value


def _as_json(source: str, fields: Mapping[str, Any]) -> bytes:
    """Fields as JSON, so that arrays become tuples while numbers stay strictly typed."""
    try:
        return json.dumps(fields, default=as_plain, ensure_ascii=False).encode()
    except (TypeError, ValueError, RecursionError) as error:  # endless digits, bytes that are no text, depth
        raise InputError(
            f"scenario {source}: expected sections and values as TOML has them, {error}"
        ) from None


def _check_texts(source: str, scenario: Scenario) -> None:
    """Names and paths end up in terminals, in file names and in other programs' files."""
    for dotted in fields_of(scenario):
        text: Any = scenario
        for part in dotted.split("."):
            text = getattr(text, part)
        breaks = "\n\t" if dotted == "description" else ""
        if isinstance(text, str) and not is_plain("".join(each for each in text if each not in breaks)):
            raise InputError(
                f"scenario {source}: {dotted}: expected text without control characters,"
                f" received {shown(text)}"
            )
