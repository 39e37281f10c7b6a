"""Dotted flags: every field of a scenario can be set from the command line."""

import json
import math
import re
from collections.abc import Sequence
from typing import Any, get_args

from pydantic import BaseModel

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.user_code import is_reference
from spheretwin.twin.scenario.fields import INDEX, every_field, fields_of, kind_of
from spheretwin.twin.scenario.own_law import scenario_with
from spheretwin.twin.scenario.sections import Scenario


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
        f"{name}.{kind.told_apart_by}": f": {', '.join(kind.members)}"
        for name, field in every_field(type(scenario))
        if (kind := kind_of(field)) and kind.told_apart_by
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
