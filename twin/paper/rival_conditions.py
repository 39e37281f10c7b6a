"""Cases of the comparison of laws: gains of every law, frozen by `make tune-rivals`, under each condition."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any, NamedTuple, cast

import numpy as np

from spheretwin.casadi import nmpc_file
from spheretwin.control.laws.afsm_eso import PRESETS
from spheretwin.models import actuator
from spheretwin.paper.experiment import Case
from spheretwin.paper.experiment_file import BY_LAW, ExperimentFile
from spheretwin.study.optimise import Optimise
from spheretwin.study.study import load

FOLDER = resources.files("spheretwin.paper")


class TunedGains(NamedTuple):
    """Gains of a law with the least error within a limit on the variation of the currents."""

    law: str
    limit_A_s: float
    gains: Mapping[str, float | None]
    """By name; None for an optional one that is off."""
    fields: Mapping[str, Any]
    """Fields of a scenario that they set."""
    objectives: tuple[float, ...]
    """Error (rad) and variation (A/s) under the seeds of the search."""

    @property
    def label(self) -> str:
        """Law and limit."""
        return f"{self.law}, {self.limit_A_s:g} A/s"


@cache
def tuned_gains(name: str) -> tuple[TunedGains, ...]:
    """Gains that a study tuned, by limit and law; none for a law that no gains bring within a limit."""
    content = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    every = [
        TunedGains(law, best["limit"], best["gains"], _nested(best["fields"]), tuple(best["values"].values()))
        for law, of_law in content["laws"].items()
        for best in of_law
    ]
    return tuple(sorted(every, key=lambda gains: gains.limit_A_s))


def _nested(fields: Mapping[str, float]) -> dict[str, Any]:
    """Fields with the three entries of a list as one value."""
    nested: dict[str, Any] = {}
    for name, value in fields.items():
        above, _, last = name.rpartition(".")
        if last.isdecimal():
            nested.setdefault(above, [0.0, 0.0, 0.0])[int(last)] = value
        else:
            nested[name] = value
    return nested


GROUP_GAIN = 0.03
"""Largest deviation of the torque of a group from its nominal value."""

STAGE = 977  # of the random stream of the group gains


def group_gains(seed: int) -> dict[str, Any]:
    """Torque of every group over its nominal value, uniform from 0.97 to 1.03."""
    groups = len(actuator.load().groups)
    deviation = np.random.default_rng([seed, STAGE]).uniform(-GROUP_GAIN, GROUP_GAIN, groups)
    return {"plant.group_gain": (1.0 + deviation).tolist()}


OUR_LAW = "afsm_eso"


class Hardware:
    """Hardware and motion for which a study tuned the laws.

    Parameters
    ----------
    name, title : str
    hinges : tuple of int
        Hinges of which the worst one counts.
    in_degrees : bool
        Unit of the errors on the page, instead of mrad.
    presets : tuple of str
        Of AFSM-ESO, reported as shipped.
    """

    def __init__(
        self, name: str, title: str, hinges: tuple[int, ...], in_degrees: bool, presets: tuple[str, ...]
    ) -> None:
        self.name, self.title, self.hinges = name, title, hinges
        self.in_degrees, self.presets = in_degrees, presets
        self.study = load(f"rivals_{name}")
        self.search = cast(Optimise, self.study.optimise)
        self.tuned = tuned_gains(self.study.name)

    @property
    def setting(self) -> dict[str, Any]:
        """Columns and fields of all cases."""
        return {"setting": self.name, "scenario": self.study.scenario, "fields": self.study.fields}

    @property
    def candidates(self) -> list[dict[str, Any]]:
        """Tuned laws by limit, then presets as shipped: their columns and fields."""
        tuned = [
            {
                "candidate": gains.label,
                "law": gains.law,
                "row": BY_LAW[gains.law].label,
                "limit_A_s": gains.limit_A_s,
                "tuned": dict(gains.gains),
                "fields": {"controller.law": gains.law, **gains.fields},
            }
            for gains in self.tuned
        ]
        return tuned + [
            {
                "candidate": f"preset {preset}",
                "law": OUR_LAW,
                "row": f"{BY_LAW[OUR_LAW].label}, preset `{preset}`",
                "preset": preset,
                "fields": {"controller.law": OUR_LAW, "controller.preset": preset},
            }
            for preset in self.presets
        ]


IDEAL = Hardware("ideal", "sinusoid, ideal hardware", (0, 1, 2), False, ("ideal", "fast"))
ELECTRONICS = Hardware(
    "electronics",
    "tilt, prototype's electronics",
    # The encoder of γ has steps that no law can resolve.
    (0, 1),
    True,
    tuple(preset for preset in PRESETS if preset not in IDEAL.presets),
)
HARDWARE = (IDEAL, ELECTRONICS)

# Without its package no case is run, and the page has no section of it.
HAS_PREDICTIVE = importlib.util.find_spec("casadi") is not None
PREDICTIVE = {
    "candidate": "predictive control",
    "comparable": False,
    "fields": {"controller.law": nmpc_file()},
}


def _file() -> ExperimentFile:
    file = ExperimentFile("rivals")
    lists = {hardware.name: [hardware.setting] for hardware in HARDWARE}
    lists |= {f"{hardware.name}_candidate": hardware.candidates for hardware in HARDWARE}
    lists["ideal_candidate"] += file["full_current"]
    return ExperimentFile("rivals", "", **lists, predictive=[PREDICTIVE] if HAS_PREDICTIVE else [])


FILE = _file()


def cases() -> list[Case]:
    """Cases of every tuned law under every condition, then of presets and of the full current."""
    return [
        case._replace(seeded_fields=group_gains) if "group_gains" in case.columns else case
        for case in FILE.cases
        if case.comparable or "limit" not in case.columns  # full current needs no nominal model
    ]
