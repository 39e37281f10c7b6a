"""Meshes of the actuator with some 9,000 triangles, from its dimensions: fast in a browser without a GPU."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.viz.scene.solids import (
    Surface,
    bar,
    cylinder,
    merged_surface,
    reversed_,
    revolved_surface,
    tube,
    zone,
)

COIL_SECTIONS = 16
POLE_SECTIONS = 14
RING_SECTIONS = 32
BALL_STEPS = 6

# Dimensions that are only drawn, as shares of the ball's radius: cut and wall of the ball, the joint's rings.
CUT = 0.52
WALL = 0.06
OUTER_RING = (0.43, 0.54, 0.07)
INNER_RING = (0.31, 0.40, 0.06)
SHAFT = 0.055
ARM = 0.05
NECK = 0.06
# Hoops behind the coils, and the base that carries them.
HOOP = 0.04
BASE = 0.08
BASE_GAP = 0.35
LEGS = 6

# Poles are a little outside of the ball: two surfaces at one place flicker.
POLE_PROUD_M = 1e-4


@dataclass(frozen=True)
class ActuatorSolids:
    """Solids in the frames that carry them."""

    stator: Surface
    outer_ring: Surface
    inner_ring: Surface
    rotor: Surface
    shaft: Surface
    pole: Surface
    """One pole, its z along its axis, the middle of its front at the ball's radius."""
    coil: Surface
    """One coil, its z along its axis, its centre at the origin."""

    def triangles(self, actuator: Actuator) -> int:
        """Return the number of triangles that a browser draws, copies counted."""
        once = (self.stator, self.outer_ring, self.inner_ring, self.rotor, self.shaft)
        copies = len(actuator.pole_axes) * len(self.pole.triangles) + len(actuator.coil_axes) * len(
            self.coil.triangles
        )
        return sum(len(solid.triangles) for solid in once) + copies


def actuator_solids(actuator: Actuator) -> ActuatorSolids:
    """Make every solid of an actuator."""
    ball, coil = actuator.magnet.front_m, actuator.coil
    half = coil.length_m / 2
    return ActuatorSolids(
        stator=_stator(actuator),
        outer_ring=_ring(ball, *OUTER_RING),
        inner_ring=_ring(ball, *INNER_RING),
        rotor=_ball(ball),
        shaft=cylinder(SHAFT * ball, 0.0, float(np.linalg.norm(actuator.shaft_tip_m)), POLE_SECTIONS),
        pole=_pole(actuator),
        coil=tube(coil.inner_radius_m, coil.outer_radius_m, -half, half, COIL_SECTIONS),
    )


def quaternions_along(axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations that turn z to each of some unit vectors, (n, 3): (n, 4), scalar first."""
    # Half the way from z to the axis; a half turn about x where the axis is -z.
    quaternions = np.stack([1 + axes[:, 2], -axes[:, 1], axes[:, 0], np.zeros(len(axes))], axis=1)
    quaternions[axes[:, 2] < -1 + 1e-12] = [0.0, 1.0, 0.0, 0.0]
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def _ball(radius: float) -> Surface:
    """Shell, cut flat above and below, and the arms that join it to the shaft."""
    cut, inside = CUT * radius, (1 - WALL) * radius
    rim, rim_inside = np.sqrt(radius**2 - cut**2), np.sqrt(inside**2 - cut**2)
    outer = zone(radius, -cut, cut, BALL_STEPS, RING_SECTIONS)
    inner = reversed_(zone(inside, -cut, cut, BALL_STEPS // 2, RING_SECTIONS))
    above = revolved_surface([(rim, cut), (rim_inside, cut)], RING_SECTIONS)
    below = revolved_surface([(rim_inside, -cut), (rim, -cut)], RING_SECTIONS)
    width = ARM * radius
    arms = [bar(lengths) for lengths in ((2 * rim_inside, width, width), (width, 2 * rim_inside, width))]
    lifted = [arm.placed(np.eye(3), np.array([0.0, 0.0, cut - width])) for arm in arms]
    return merged_surface([outer, inner, above, below, *lifted])


def _pole(actuator: Actuator) -> Surface:
    magnet = actuator.magnet
    rho = np.linspace(magnet.radius_m, 0.0, 4 if magnet.front_radius_m else 2)
    front = [(float(r), magnet.front_m + POLE_PROUD_M - magnet.sagitta_at_m(float(r))) for r in rho]
    return revolved_surface([(magnet.radius_m, magnet.back_m), *front], POLE_SECTIONS)


def _ring(ball: float, inner: float, outer: float, half: float) -> Surface:
    return tube(inner * ball, outer * ball, -half * ball, half * ball, RING_SECTIONS)


def _stator(actuator: Actuator) -> Surface:
    """Return a hoop behind the coils of each latitude, a base, legs, and the neck that carries the joint."""
    ball, coil = actuator.magnet.front_m, actuator.coil
    behind, width = coil.distance_m + coil.length_m / 2, HOOP * actuator.magnet.front_m
    heights = np.unique(np.round(behind * actuator.coil_axes[:, 2], 6)).tolist()
    radii = [float(np.sqrt(max(behind**2 - height**2, width**2))) for height in heights]
    hoops = [
        tube(radius, radius + width, height - width, height + width, RING_SECTIONS)
        for radius, height in zip(radii, heights, strict=True)
    ]
    top = min(heights) - BASE_GAP * ball
    base = cylinder(max(radii) + width, top - BASE * ball, top, RING_SECTIONS)
    neck = cylinder(NECK * ball, top, -OUTER_RING[2] * ball, POLE_SECTIONS)
    leg = cylinder(width / 2, top, max(heights), 6)
    angles = 2 * np.pi * (np.arange(LEGS) + 0.5) / LEGS
    reach = max(radii) + width / 2
    places = np.stack([reach * np.cos(angles), reach * np.sin(angles), np.zeros(LEGS)], axis=1)
    legs = [leg.placed(np.eye(3), place) for place in places]
    return merged_surface([*hoops, base, neck, *legs])
