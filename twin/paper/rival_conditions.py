"""Tuned gains of every law, frozen by `make tune-rivals`, and the conditions that they run under."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Callable, Mapping
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np

from spheretwin.casadi import nmpc_file
from spheretwin.control.laws.afsm_eso import PRESETS
from spheretwin.models import actuator
from spheretwin.models.telemetry.status import Status
from spheretwin.paper import experiment
from spheretwin.paper.experiment import Case
from spheretwin.study.study import Study, load

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
def study(name: str) -> Study:
    """Study that tuned the gains."""
    return load(name)


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


# A law that loses the rotor under a condition that it was not tuned for is reported, and no failure.
EXPECTED = (Status.COMPLETED, Status.LEFT_WORKSPACE, Status.DIVERGED, Status.FAILSAFE)

GROUP_GAIN = 0.03
"""Largest deviation of the torque of a group from its nominal value."""

COMPLETE = "prototype"
"""Hardware set with every imperfection, and the condition with it."""

SEEDS = 60
"""Runs of a case with sensors, whose noise moves an error by more than most laws differ."""

STAGE = 977  # of the random stream of the group gains


class Condition(NamedTuple):
    """Difference of a run from the others of its hardware."""

    name: str
    fields: Mapping[str, Any]
    seeded_fields: Callable[[int], Mapping[str, Any]] = lambda seed: {}
    """Fields that depend on the seed."""
    perturbed: bool = False
    """Whether the nominal model is wrong: a column of robustness."""


class Hardware(NamedTuple):
    """Hardware and motion for which the laws were tuned."""

    name: str
    title: str
    study: str
    """Name of the study that tuned the gains."""
    hinges: tuple[int, ...]
    """Hinges of which the worst one counts."""
    in_degrees: bool
    conditions: tuple[Condition, ...]
    presets: tuple[str, ...]
    """Of AFSM-ESO, reported as shipped."""

    @property
    def scenario(self) -> str:
        """Name of the scenario."""
        return study(self.study).scenario

    @property
    def fields(self) -> Mapping[str, Any]:
        """Fields of every run."""
        return study(self.study).fields

    @property
    def limits_A_s(self) -> tuple[float, ...]:
        """Limits on the variation of the currents."""
        optimise = study(self.study).optimise
        return optimise.limits if optimise else ()


def group_gains(seed: int) -> dict[str, Any]:
    """Torque of every group over its nominal value, uniform from 0.97 to 1.03."""
    groups = len(actuator.load().groups)
    deviation = np.random.default_rng([seed, STAGE]).uniform(-GROUP_GAIN, GROUP_GAIN, groups)
    return {"plant.group_gain": (1.0 + deviation).tolist()}


def _load(m: float, L: float) -> dict[str, Any]:
    return {"plant.modelling_error": m, "disturbance.load": L}


def _friction(m: float) -> dict[str, Any]:
    return {"plant.coulomb_Nm": [5e-3] * 3, "nominal.coulomb_Nm": [2e-3] * 3, "plant.modelling_error": m}


def _delay(delay_s: float) -> dict[str, Any]:
    return {"drive.delay_s": delay_s + 1e-3, "nominal.delay_s": delay_s}


CONVERTER_ERRORS: dict[str, Any] = {"sensors.adc.offset_V": 1e-3, "sensors.adc.gain_error": 1e-3}

LIGHT = _load(0.2, 1.0)
IDEAL = Hardware(
    "ideal",
    "sinusoid, ideal hardware",
    "rivals_ideal",
    (0, 1, 2),
    False,
    (
        Condition("m 0.2, L 1", LIGHT),
        Condition("m 0.5, L 5", _load(0.5, 5.0)),
        Condition("m 0, L 0", _load(0.0, 0.0)),
        Condition("friction 5 mN·m, nominal 2 mN·m", {**LIGHT, **_friction(0.2)}, perturbed=True),
        Condition("m 0.5", _load(0.5, 1.0), perturbed=True),
        Condition("1 ms of unknown delay", {**LIGHT, **_delay(0.0)}, perturbed=True),
        Condition("group gains ±3 %", LIGHT, group_gains, perturbed=True),
    ),
    ("ideal", "fast"),
)

ELECTRONICS = Hardware(
    "electronics",
    "tilt, prototype's electronics",
    "rivals_electronics",
    # The encoder of γ has steps that no law can resolve.
    (0, 1),
    True,
    (
        Condition("without offset and gain errors", {}),
        Condition("with them", CONVERTER_ERRORS),
        Condition("friction 5 mN·m, nominal 2 mN·m", _friction(0.0), perturbed=True),
        Condition("m 0.5", {"plant.modelling_error": 0.5}, perturbed=True),
        Condition("1 ms of unknown delay", _delay(1e-3), perturbed=True),
        Condition("group gains ±3 %", {}, group_gains, perturbed=True),
        Condition(COMPLETE, {"hardware": COMPLETE, **CONVERTER_ERRORS}, perturbed=True),
    ),
    tuple(preset for preset in PRESETS if preset not in ("ideal", "fast")),
)
HARDWARE = (IDEAL, ELECTRONICS)

# All that the currents give against the error of the rate, from the first tick on: a rate feedback whose
# torque is far beyond the limit.
FULL_CURRENT: dict[str, Any] = {
    "controller.law": "pd",
    "controller.stiffness": 1e-6,
    "controller.damping": 2e4,
    "duration": 0.02,
}
ALLOCATIONS = ("least_norm", "bounded")


# Without its package no case is run, and the page has no section of it.
PREDICTIVE = ELECTRONICS.conditions if importlib.util.find_spec("casadi") else ()


def cases() -> list[Case]:
    """Cases of every tuned law under every condition, then of presets and of the full current."""
    return [
        case
        for hardware in HARDWARE
        for condition in hardware.conditions
        for case in (
            *(tuned_case(hardware, condition, gains) for gains in tuned_gains(hardware.study)),
            *(preset_case(hardware, condition, preset) for preset in hardware.presets),
            *(limit_case(condition, allocation) for allocation in _allocations(hardware, condition)),
        )
    ] + [predictive_case(condition) for condition in PREDICTIVE]


def tuned_case(hardware: Hardware, condition: Condition, gains: TunedGains) -> Case:
    """Case of a law with the gains of one limit under one condition."""
    fields = {"controller.law": gains.law, **gains.fields}
    reported = {"limit_A_s": gains.limit_A_s, "gains": dict(gains.gains)}
    return _case(hardware, condition, gains.label, fields, reported)


def preset_case(hardware: Hardware, condition: Condition, preset: str) -> Case:
    """Case of AFSM-ESO with a preset, as shipped."""
    fields = {"controller.law": "afsm_eso", "controller.preset": preset}
    return _case(hardware, condition, f"preset {preset}", fields, {"preset": preset})


def limit_case(condition: Condition, allocation: str) -> Case:
    """Case with the full current at the start of the sinusoid."""
    fields = {**FULL_CURRENT, "allocation": allocation}
    return _case(IDEAL, condition, f"full current, {allocation}", fields, {"limit": allocation})


def predictive_case(condition: Condition) -> Case:
    """Case of predictive control under a condition of the tilt; one run, as it takes half a minute."""
    case = _case(ELECTRONICS, condition, "predictive control", {"controller.law": nmpc_file()}, {})
    return case._replace(single_run=True, comparable=False)


def _allocations(hardware: Hardware, condition: Condition) -> tuple[str, ...]:
    return ALLOCATIONS if hardware is IDEAL and not condition.perturbed else ()


def _case(
    hardware: Hardware, condition: Condition, name: str, fields: dict[str, Any], reported: dict[str, Any]
) -> Case:
    return Case(
        name=f"{hardware.name}, {condition.name}: {name}",
        scenario=hardware.scenario,
        fields={**hardware.fields, **condition.fields, **fields},
        details={"setting": hardware.name, "condition": condition.name, **reported},
        expected_statuses=EXPECTED,
        # Beyond its nominal model a loop of high gain may hunt, and then amplifies what rounding leaves.
        comparable=not condition.perturbed,
        seeds=SEEDS if hardware is ELECTRONICS else experiment.SEEDS,
        seeded_fields=condition.seeded_fields,
    )
