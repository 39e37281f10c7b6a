"""Gains of every law that the searches found, frozen: `make tune-rivals` writes the files again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

from spheretwin.twin.study.study import Study, load

FOLDER = resources.files("spheretwin.twin.reproduce.rivals")


class TunedGains(NamedTuple):
    """Gains of a law with the least error within a limit on the variation of the currents."""

    law: str
    limit_A_s: float
    gains: Mapping[str, float | None]
    """By name; None of an optional one that is off."""
    fields: Mapping[str, Any]
    """Fields of a scenario that they set."""
    objectives: tuple[float, ...]
    """Error (rad) and variation (A/s) under the seeds of the search."""

    @property
    def label(self) -> str:
        """Law and limit."""
        return f"{self.law}, {self.limit_A_s:g} A/s"


@cache
def study(name: str) -> Study:
    """Study that found the gains."""
    return load(name)


@cache
def tuned_gains(name: str) -> tuple[TunedGains, ...]:
    """Gains that a study found, by limit and law; none of a law that nothing brings within a limit."""
    content = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    every = [
        TunedGains(law, each["limit"], each["gains"], _joined(each["fields"]), tuple(each["values"].values()))
        for law, best in content["laws"].items()
        for each in best
    ]
    return tuple(sorted(every, key=lambda each: each.limit_A_s))


def _joined(fields: Mapping[str, float]) -> dict[str, Any]:
    """Fields with the three entries of a list as one value."""
    joined: dict[str, Any] = {"controller.law": None}
    for name, value in fields.items():
        above, _, last = name.rpartition(".")
        if last.isdecimal():
            joined.setdefault(above, [0.0, 0.0, 0.0])[int(last)] = value
        else:
            joined[name] = value
    del joined["controller.law"]
    return joined
