"""Scale of the prescribed motions: those of the shipped actuator, made to fit another one.

Torques are in proportion to the inertia, so that accelerations are the same; currents besides in inverse
proportion to the torque per ampere, within the current limit; angles, rates and accelerations shrink
together where a hinge has less range than the motions take up. Times are the same. Each factor of the shipped
actuator is 1.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spheretwin.linear import Magnetics, hinge_matrix
from spheretwin.models import actuator as actuators
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array

EXCURSION_rad = np.array([0.6, 0.6, 2.3])
"""Angle of each hinge from the middle of its range that the motions take up at most."""

NUTATION_rad = np.array([1.39, 1.39, 10 * np.pi + 0.5])
"""Largest angles of the hinges in the nutation in closed loop, with the error under the load."""
LEAST_HEIGHT_m = 1e-2


class Scale(NamedTuple):
    """Factors of the motions of a machine over those of the shipped actuator."""

    middle_rad: Array
    """(3,) pose about which the machine moves: the middle of each range."""
    half_rad: Array
    """(3,) half of each range."""
    angle: float
    """Angles and rates."""
    inertia: float
    """Inertia, and what is in proportion to it."""
    torque: float
    current: float
    payload: float
    """Mass of the payload: its weight is in proportion to the inertia."""
    tilt: float
    """Angles of α and β in the nutation, within the range and what the currents accelerate."""
    spin: float
    """Rate of γ in the nutation."""
    load: float
    """Torque of the load in the nutation."""

    def pose_rad(self, offset_rad: tuple[float, ...]) -> tuple[float, ...]:
        """Return the pose with an offset from the middle, as of the shipped actuator."""
        return tuple((self.middle_rad + self.angle * np.array(offset_rad)).tolist())

    def rates_rad_s(self, rates_rad_s: tuple[float, ...]) -> tuple[float, ...]:
        """Return rates."""
        return tuple((self.angle * np.array(rates_rad_s)).tolist())

    def torques_Nm(self, torques_Nm: tuple[float, ...]) -> tuple[float, ...]:
        """Return torques."""
        return tuple((self.torque * np.array(torques_Nm)).tolist())

    def field(self, name: str, value: Any) -> Any:
        """Return the value of a field of the scenario, given that of the shipped actuator."""
        if name == "plant.coulomb_Nm":
            return self.torques_Nm(value)
        if name in ("plant.mass.product_error_kg_m2", "plant.mass.ring_inertia_kg_m2"):
            return _times(self.inertia, value)
        return value


def _times(factor: float, value: Any) -> Any:
    return tuple(_times(factor, each) for each in value) if isinstance(value, tuple) else factor * value


def scale_of(actuator: Actuator) -> Scale:
    """Return the scale of the motions of an actuator."""
    shipped = actuators.load()
    middle, half = _ranges_rad(actuator)
    angle = min(1.0, float((half / EXCURSION_rad).min()))
    inertia = float(actuator.inertia.min()) / float(shipped.inertia.min())
    strength = _strength_Nm_A(actuator, middle) / _strength_Nm_A(shipped, np.zeros(3))
    limit = np.min(actuator.group.current_limit_A) / np.min(shipped.group.current_limit_A)
    ability = strength * float(limit) / inertia
    tilt = min(1.0, ability, float((half / NUTATION_rad)[:2].min()))
    return Scale(
        middle_rad=middle,
        half_rad=half,
        angle=angle,
        inertia=inertia,
        torque=angle * inertia,
        current=min(angle * inertia / strength, float(limit)),
        payload=inertia * _height_m(shipped) / max(_height_m(actuator), LEAST_HEIGHT_m),
        tilt=tilt,
        spin=min(1.0, ability, float(half[2] / NUTATION_rad[2])),
        load=tilt * inertia,
    )


def _height_m(actuator: Actuator) -> float:
    """Return the distance of the payload mount from the joint centre."""
    return float(np.linalg.norm(actuator.payload_mount_m))


def _ranges_rad(actuator: Actuator) -> tuple[Array, Array]:
    """Return the middle (3,) and the half (3,) of the ranges."""
    low, high = actuator.hinge_range_rad.T
    bounded = np.isfinite(high - low)
    middle = np.where(bounded, 0.5 * (np.where(bounded, low, 0.0) + np.where(bounded, high, 0.0)), 0.0)
    return middle, np.minimum(high - middle, middle - low)


def _strength_Nm_A(actuator: Actuator, q: Array) -> float:
    """Return the largest torque of currents of norm 1 at a pose."""
    magnetics = Magnetics(actuator, np.ones(len(actuator.groups)))
    return float(np.linalg.norm(hinge_matrix(q, magnetics), 2))


LOAD = 2.0
"""Of the scenario nutation."""


def nutation_fields(mjcf: Path, scale: Scale, overrides: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of the nutation of a machine, given those of the shipped actuator."""
    load, torques = overrides.get("disturbance.load", LOAD), scale.load * np.array([2e-3, 1e-3, 1e-3])
    return {
        "plant.modelling_torque_Nm": torques.tolist(),
        "disturbance.random_bound_Nm": 0.05 * scale.load,
        "trajectory.alpha_amplitude_rad": 0.2 * scale.tilt,
        "trajectory.beta_growth_rad_s": 0.2 * scale.tilt,
        "trajectory.spin_rate_rad_s": 2 * np.pi * scale.spin,
        **{name: scale.field(name, value) for name, value in overrides.items()},
        "disturbance.load": load * scale.load,
        "plant.mjcf": str(mjcf),
    }
