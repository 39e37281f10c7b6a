"""Model of a machine, from a scenario: what its twin knows of the plant, of the drive and of the sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.config.plant_model import parameters_of
from spheretwin.electronics.sensor_chain import SensorsSection
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.record import Rows
from spheretwin.models.coil_group import PerGroup
from spheretwin.plant.learned_torque import LearnedTorqueSection, learned_torque
from spheretwin.plant.plant_step import Parameters
from spheretwin.scenario.sections import ResolvedScenario, Scenario

# Ideal sensors: about the rounding of an angle in degrees with four decimals.
_LEAST_NOISE_rad = 1e-6

EDGE_SHARE = 0.01
"""Least error of the edges of a count, as a share of it; without it a filter trusts a count absolutely."""


class Model(NamedTuple):
    """Model of a machine."""

    scenario: ResolvedScenario
    actuator: Actuator
    parameters: Parameters
    delay_s: float
    """From a command to the amplifier's input."""
    lag_s: PerGroup
    """Time constant of the currents."""
    offset_rad: Array
    """Known error of each angle sensor (3,)."""
    noise_rad: Array
    """Standard deviation of the noise of each angle (3,); of one that counts, before it counts."""
    half_count_rad: Array
    """Half a count of each angle (3,); 0 if it is not counted."""
    learned: Rows
    """Array of one learned torque, which is no part of the parameters."""

    @property
    def groups(self) -> int:
        """Number of coil groups."""
        return len(self.actuator.groups)


def model_of(scenario: Scenario | str, changes: Mapping[str, Any] | None = None) -> Model:
    """Return the model of a machine.

    Parameters
    ----------
    scenario : Scenario or str
        From `scenario.load`, or the name or file of one. Errors of parts that a seed draws are left out.
        Static friction and hysteresis of a cable, which have states of their own, are left to the
        disturbance.
    changes : mapping, optional
        Fields by dotted name and their values, for a name or a file.

    Raises
    ------
    InputError
        The scenario or a field cannot be used, or changes of a built scenario.
    """
    if isinstance(scenario, str):
        scenario = scenarios.load(scenario, changes)
    elif changes:
        raise InputError("machine: expected changes with the name or file of a scenario alone")
    config = initial_config(_without_draws(scenario), None, None)
    resolved = config.scenario
    noise_rad, half_count_rad = _noise(resolved.sensors)
    return Model(
        scenario=resolved,
        actuator=config.files.actuator,
        parameters=parameters_of(_without_learned_torque(resolved), config.files),
        delay_s=resolved.drive.delay_s,
        lag_s=resolved.drive.lag_s,
        offset_rad=np.array(resolved.sensors.angle_offset_rad),
        noise_rad=noise_rad,
        half_count_rad=half_count_rad,
        learned=learned_torque(resolved.plant.learned_torque),
    )


def _without_learned_torque(scenario: ResolvedScenario) -> ResolvedScenario:
    plant = scenario.plant.model_copy(update={"learned_torque": LearnedTorqueSection()})
    return scenario.model_copy(update={"plant": plant})


def _without_draws(scenario: Scenario) -> Scenario:
    """Return a scenario without the errors of parts that its seed draws: another machine has those."""
    plant = scenario.plant
    sections = {}
    for name in ("poles", "coils", "mass", "cable"):
        section = getattr(plant, name)
        bounds = {
            field: tuple(0.0 for _ in value) if isinstance(value, tuple) else 0.0
            for field, value in section
            if "_error" in field
        }
        sections[name] = section.model_copy(update=bounds)
    return scenario.model_copy(update={"plant": plant.model_copy(update=sections)})


def _noise(sensors: SensorsSection) -> tuple[Array, Array]:
    """Return standard deviations and half counts of the angles.

    The step of a converter is small against the noise, and is used as noise; that of the encoder is not.
    """
    noise_rad, step_rad = np.array(sensors.angle_noise_rad), np.array(sensors.angle_resolution_rad)
    half_count_rad = np.where([False, False, True], step_rad / 2, 0.0)
    noise_rad = np.hypot(noise_rad, np.where(half_count_rad > 0, 0.0, step_rad / np.sqrt(12)))
    eccentricity_rad = sensors.encoder.eccentricity_rad / np.sqrt(2)
    noise_rad[2] = max(noise_rad[2], eccentricity_rad)
    return np.maximum(noise_rad, _LEAST_NOISE_rad), half_count_rad
