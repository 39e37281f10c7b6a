"""Differences between runs: of their figures, and of the fields of their scenarios."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from spheretwin.models.base.errors import shortened

# Numbers of which no difference is meaningful.
NOT_COMPARED = ("seed",)


def differences(figures: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return, for each run but the first, every number of both reports minus that of the first.

    Entry by entry for lists; None if one of the two has no value.

    Parameters
    ----------
    figures : sequence of mapping
        Report of each run.
    """
    first, *others = figures
    return [
        {
            "path": other["path"],
            **{
                name: _difference(first[name], value)
                for name, value in other.items()
                if name in first and name not in NOT_COMPARED and _are_numbers(first[name], value)
            },
        }
        for other in others
    ]


def _are_numbers(first: Any, value: Any) -> bool:
    """True if both are numbers, lists of numbers of one length, or one of these and None."""
    if isinstance(first, list) and isinstance(value, list):
        return len(first) == len(value) and all(map(_are_numbers, first, value))
    numbers = [item for item in (first, value) if item is not None]
    of_lists = all(isinstance(item, list) and all(_is_number(entry) for entry in item) for item in numbers)
    return bool(numbers) and (all(map(_is_number, numbers)) or (len(numbers) == 1 and of_lists))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _difference(first: Any, value: Any) -> Any:
    if first is None or value is None:
        return None
    if isinstance(first, list):
        return [_difference(*pair) for pair in zip(first, value, strict=True)]
    return value - first


# Fields listed first, in the notation of the paper.
FIRST_FIELDS = {
    "controller.law": "law",
    "plant.modelling_error": "m",
    "disturbance.load": "L",
    "hardware": "hardware",
    "fault": "fault",
    "name": "scenario",
    "seed": "seed",
}
LONGEST_VALUE = 24
"""Characters of a value in a label."""

# Fields that follow from another one: if that one differs, they are not listed.
IMPLIED_FIELDS = {
    "name": ("description", "duration", "trajectory."),
    "controller.law": ("controller.",),
    "plant.modelling_error": ("plant.modelling_torque_Nm",),
    "hardware": ("sensors.", "estimator.", "drive.", "watchdog.", "plant.", "nominal."),
}


def scenario_differences(scenarios: Sequence[Mapping[str, Any]]) -> list[tuple[str, list[str]]]:
    """Return the fields that differ among scenarios, each with its value in every scenario.

    Fields that follow from another one are omitted: those of a law, a trajectory or a hardware that differs.
    """
    flat = [dict(_fields(scenario)) for scenario in scenarios]
    all_names = list(dict.fromkeys([*FIRST_FIELDS, *(name for fields in flat for name in fields)]))
    different = [name for name in all_names if len({fields.get(name, "none") for fields in flat}) > 1]
    implied = tuple(part for name, parts in IMPLIED_FIELDS.items() if name in different for part in parts)
    return [
        (FIRST_FIELDS.get(name, name), [fields.get(name, "none") for fields in flat])
        for name in different
        if name in FIRST_FIELDS or not name.startswith(implied)
    ]


def common_conditions(scenarios: Sequence[Mapping[str, Any]]) -> str:
    """Return scenario, load, modelling error and hardware as text, as far as all scenarios agree."""
    flat = [dict(_fields(scenario)) for scenario in scenarios]
    names = {
        "name": "scenario",
        "disturbance.load": "L",
        "plant.modelling_error": "m",
        "hardware": "hardware",
    }
    values = {name: {fields.get(name) for fields in flat} for name in names}
    return ", ".join(
        f"{names[name]} {shortened(str(*of_runs), LONGEST_VALUE)}"
        for name, of_runs in values.items()
        if len(of_runs) == 1 and of_runs != {None}
    )


def _fields(value: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    """Dotted names and values, each as a text."""
    for name, inside in value.items():
        if isinstance(inside, Mapping):
            yield from _fields(inside, f"{before}{name}.")
        else:
            yield before + name, _text(inside)


def _text(value: Any) -> str:
    """Return a value as text: a whole number without a point, for entries of a list their names."""
    if isinstance(value, str):
        return value
    if isinstance(value, list) and all(isinstance(item, Mapping) for item in value):
        words = [" ".join(word for word in item.values() if isinstance(word, str)) for item in value]
        return " + ".join(words) or "none"
    return f"{value:g}" if isinstance(value, float) and value == float(f"{value:g}") else json.dumps(value)
