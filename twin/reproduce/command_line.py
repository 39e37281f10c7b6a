"""The command line that runs a row alone."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping
from typing import Any

from spheretwin.twin.reproduce.experiment import Case
from spheretwin.twin.reproduce.planning import PLANT


def command_line(case: Case, plant: str, seed: int = 0) -> str:
    """Command that runs a case alone, under one seed."""
    words = ["spheretwin", "simulate", case.scenario]
    for dotted, value in {**case.fields_of(seed), PLANT: plant, "seed": seed}.items():
        for flag, texts in _flags(dotted, value):
            words += [f"--{flag.replace('_', '-')}", *texts]
    return shlex.join(words)


def _flags(dotted: str, value: Any) -> Iterator[tuple[str, list[str]]]:
    """Flags of a value: a list of tables has one for each field of each."""
    if isinstance(value, Mapping):
        for name, inside in value.items():
            yield from _flags(f"{dotted}.{name}", inside)
    elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
        for place, inside in enumerate(value):
            yield from _flags(f"{dotted}.{place}", inside)
    elif isinstance(value, list | tuple):
        yield dotted, [json.dumps(each) for each in value]
    else:
        yield dotted, [value if isinstance(value, str) else json.dumps(value)]
