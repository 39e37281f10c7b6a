"""Dotted flags: every field of a scenario can be set from the command line."""

import json
import math
from collections.abc import Sequence
from typing import Any, get_args

from spheretwin.models.base.errors import InputError
from spheretwin.twin.scenario.fields import fields_of
from spheretwin.twin.scenario.sections import Scenario


def overrides(tokens: Sequence[str]) -> dict[str, Any]:
    """Read ``--section.field value…`` pairs into values by dotted name.

    Numbers, ``true``, ``false`` and ``null`` are read as such, several values as a list; all else is text.

    Raises
    ------
    InputError
        A token is no flag, or a flag has no value.
    """
    found: dict[str, Any] = {}
    for flag, values in _grouped(tokens):
        if not values:
            raise InputError(f"command line: expected a value after --{flag}, received none")
        name = flag.replace("-", "_")
        read = [_value(name, text) for text in values]
        found[name] = read[0] if len(read) == 1 else read
    return found


def described(scenario: Scenario) -> list[tuple[str, str, str]]:
    """Flag, value in force and meaning of every field of a scenario."""
    rows = []
    for dotted, field in fields_of(scenario).items():
        value: Any = scenario
        for part in dotted.split("."):
            value = getattr(value, part)
        shown = " ".join(f"{v:g}" for v in value) if isinstance(value, tuple) else str(value)
        shown = "" if value is None else shown
        rows.append(("--" + dotted.replace("_", "-"), shown, field.description or ""))
    return rows


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


def _value(name: str, text: str) -> Any:
    if name in _TEXT_FIELDS:
        return text
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


_TEXT_FIELDS = {name for name, field in fields_of(Scenario).items() if _is_text(field.annotation)}
