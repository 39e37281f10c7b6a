"""Variants of an episode: plant, reference and disturbance of each, drawn once."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.config.plant_model import parameters
from spheretwin.electronics.coil import CurrentLag, fill_lag
from spheretwin.envs.settings import Settings
from spheretwin.loop.inputs import InputGenerator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.record import Rows
from spheretwin.plant.plant_step import Parameters
from spheretwin.scenario.sections import Scenario

# What an environment does not have; other values would be dropped.
_IDEAL = ("sensors", "drive", "fault", "event", "detector", "watchdog", "manual")


class Variants(NamedTuple):
    """All variants of an environment."""

    scenarios: tuple[Scenario, ...]
    parameters: tuple[Parameters, ...]
    q_rad: Array  # (v, 3) at the start
    qdot_rad_s: Array  # (v, 3) at the start
    reference: Array  # (v, ticks + 1, 3, 3) angle, rate, acceleration as rows
    disturbance: Array  # (v, ticks, 3) N·m
    hinge_range: Array  # (3, 2) rad
    period_s: float
    lag: Rows  # of CurrentLag


def build_variants(settings: Settings) -> Variants:
    """Return the variants of some settings.

    Raises
    ------
    InputError
        The scenario cannot be loaded, or has something that an environment does not have: sensors, a drive,
        faults, events, or hinges that are tilted or apart.
    """
    generator = np.random.default_rng(settings.variants_seed)
    first = _load(settings, {})
    count = settings.variants
    values = {axis.field: axis.quantile(generator.uniform(2**-53, 1, count)) for axis in settings.axes}
    seeds = generator.integers(0, 2**31, count)
    every = []
    for number in range(count):
        drawn: dict[str, Any] = {field: float(column[number]) for field, column in values.items()}
        if "seed" not in settings.changes:
            drawn["seed"] = int(seeds[number])
        every.append(_load(settings, drawn))
    configs = [initial_config(scenario, None, None) for scenario in every]
    plants = [config.scenario.plant for config in configs]
    drive, ticks = configs[0].scenario.drive, first.ticks
    inputs = [_inputs(scenario) for scenario in every]
    return Variants(
        scenarios=tuple(every),
        parameters=tuple(_ideal_joint(parameters(scenario)) for scenario in every),
        q_rad=np.array([plant.initial_rad for plant in plants]),
        qdot_rad_s=np.array([plant.initial_rad_s for plant in plants]),
        reference=np.array([reference for reference, _ in inputs]),
        disturbance=np.array([disturbance[:ticks] for _, disturbance in inputs]),
        hinge_range=np.array(configs[0].files.actuator.hinge_range_rad),
        period_s=first.controller.period_s,
        lag=CurrentLag.filled(
            fill_lag,
            drive.lag_s,
            settings.step_s,
            drive.current_limit_A,
            groups=len(plants[0].group_gain),
        ),
    )


def _load(settings: Settings, drawn: dict[str, Any]) -> Scenario:
    # The physics step of a scenario makes whole control periods; that of the environment is checked there.
    fixed = {"duration": settings.episode_s, "plant.engine": "lagrangian", "plant.step_s": settings.step_s}
    scenario = scenarios.load(settings.scenario, {**settings.changes, **fixed, **drawn})
    for section in _IDEAL:
        if getattr(scenario, section) != getattr(_ideal(), section):
            raise InputError(
                f"environment: expected ideal sensors and amplifiers, and no faults or events, received"
                f" another {section} in scenario {scenario.name}"
            )
    return scenario


@cache
def _ideal() -> Scenario:
    return scenarios.load("hold")


def _ideal_joint(one: Parameters) -> Parameters:
    if one.joint["on"][0]:
        raise InputError("environment: expected an ideal joint, received hinges or masses of plant.mass")
    return one


def _inputs(scenario: Scenario) -> tuple[Array, Array]:
    """Return reference (ticks + 1, 3, 3) and disturbance (ticks + 1, 3) of a scenario."""
    inputs, ticks = InputGenerator(scenario), scenario.ticks + 1
    rows: list[Any] = []
    while (done := sum(len(row.t) for row in rows)) < ticks:
        rows.append(inputs.rows(done, ticks - done))
    reference = np.concatenate([row.reference for row in rows])
    return reference, np.concatenate([row.disturbance for row in rows])
