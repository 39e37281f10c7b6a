"""How runs are named beside each other: by their files, their laws, and what else differs between them."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from spheretwin.models.base.wording import shortened
from spheretwin.twin.review.run import Reviewed

# What a reader of the paper looks for first, and as it writes it.
FIRST = {
    "plant.modelling_error": "m",
    "disturbance.load": "L",
    "hardware": "hardware",
    "fault": "fault",
    "name": "scenario",
    "seed": "seed",
}
MOST, LEGEND = 6, 48
"""Differences that are told, and characters of a legend's line."""
LONGEST, LONGEST_STEM = 24, 40
"""Of a value that is told, and of a file's name."""

# Fields that go with another one: where that differs, so do these, and say nothing more.
GOES_WITH = {
    "name": ("description", "duration", "trajectory."),
    "controller.law": ("controller.",),
    "plant.modelling_error": ("plant.modelling_torque_Nm",),
    "hardware": ("sensors.", "estimator.", "drive.", "watchdog.", "plant.", "nominal."),
}


def labels(runs: Sequence[Reviewed], longest: int = 10**6) -> list[str]:
    """What is said of each run: its number, file and law, and in what they differ, as far as there is room.

    A file that has the name of its law is told once.

    Parameters
    ----------
    runs : sequence of Reviewed
    longest : int
        Characters of a label, but for number, file and law, which are always told.
    """
    told = differing([run.record.scenario for run in runs])
    found = []
    for place, (run, parts) in enumerate(zip(runs, told, strict=True), start=1):
        stem, law = shortened(run.path.stem, LONGEST), _law(run)
        label = f"{place} {stem}" if stem == law else f"{place} {stem}: {law}"
        for part in parts:
            if len(label) + len(part) + 2 > longest:
                label += ", …"
                break
            label += f", {part}"
        found.append(label)
    return found


def names(runs: Sequence[Reviewed]) -> list[str]:
    """A word for each run that no other has, without a sign that means something in a path."""
    stems = [shortened(re.sub(r"[^\w-]+", "_", run.path.stem), LONGEST_STEM) for run in runs]
    return [f"run_{place}_{stem.replace('…', '_')}" for place, stem in enumerate(stems, start=1)]


def differing(scenarios: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Fields that are not the same in all scenarios, with their values in each, at most six."""
    flat = [dict(_fields(scenario)) for scenario in scenarios]
    of_any = list(dict.fromkeys([*FIRST, *(name for each in flat for name in each)]))
    different = [name for name in of_any if len({each.get(name, "none") for each in flat}) > 1]
    beside = [part for name, parts in GOES_WITH.items() if name in different for part in parts]
    told = [name for name in different if name in FIRST or not any(map(name.startswith, beside))]
    return [[f"{FIRST.get(name, name)} {each.get(name, 'none')}" for name in told[:MOST]] for each in flat]


def _law(run: Reviewed) -> str:
    return str(run.record.scenario["controller"]["law"])


def _fields(value: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    """Dotted names and values, each as a text."""
    for name, inside in value.items():
        if isinstance(inside, Mapping):
            yield from _fields(inside, f"{before}{name}.")
        else:
            yield before + name, shortened(_text(inside), LONGEST)


def _text(value: Any) -> str:
    """As a person writes it: a whole number without a point, of entries of a list what they name."""
    if isinstance(value, str):
        return value
    if isinstance(value, list) and all(isinstance(each, Mapping) for each in value):
        words = [" ".join(word for word in each.values() if isinstance(word, str)) for each in value]
        return " + ".join(words) or "none"
    return f"{value:g}" if isinstance(value, float) and value == float(f"{value:g}") else json.dumps(value)
