"""Geometry of the magnets and coils, from which torque curves and fields are computed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot, pi, sqrt
from pathlib import Path

import mujoco
import numpy as np

from spheretwin.models.base.errors import InputError, distinct_texts
from spheretwin.models.mjcf import read
from spheretwin.models.mjcf_reader import LARGEST_LENGTH_M, check_bounded, number, shared, sites

FRONT_RADIUS = "pole_front_radius_m"


@dataclass(frozen=True)
class Magnet:
    """Pole magnet, magnetised along its axis: a cylinder with a front that is flat or ground to a sphere.

    Radius, length and distance are those of the blank, the cylinder before grinding: grinding removes the
    edge of the front and does not move its middle.
    """

    remanence_T: float
    radius_m: float
    length_m: float
    distance_m: float
    """From the joint centre to the middle of the blank."""
    front_radius_m: float = 0.0
    """Radius of the sphere to which the front is ground, its centre on the axis; 0 for a flat front."""

    @property
    def front_m(self) -> float:
        """From the joint centre to the middle of the front, m."""
        return self.distance_m + self.length_m / 2

    @property
    def back_m(self) -> float:
        """From the joint centre to the back, m."""
        return self.distance_m - self.length_m / 2

    @property
    def sagitta_m(self) -> float:
        """Distance of the rim of the front behind its middle, m."""
        return self.sagitta_at_m(self.radius_m)

    @property
    def rim_m(self) -> float:
        """Height of the front's rim along the axis, from the joint centre, m."""
        return self.front_m - self.sagitta_m

    @property
    def reach_m(self) -> float:
        """From the joint centre to the farthest point of the front, m."""
        return max(self.front_m, hypot(self.rim_m, self.radius_m))

    @property
    def volume_m3(self) -> float:
        """Volume of the ground magnet, m³."""
        return self.volume_within_m3(self.radius_m)

    def volume_within_m3(self, rho_m: float) -> float:
        """Return the volume of the ground magnet within a distance from its axis, m³."""
        sagitta = self.sagitta_at_m(rho_m)
        cap = pi / 6 * sagitta * (3 * rho_m**2 + sagitta**2)
        return pi * rho_m**2 * (self.length_m - sagitta) + cap

    def sagitta_at_m(self, rho_m: float) -> float:
        """Return the distance of the front behind its middle at a distance from the axis, m."""
        if not self.front_radius_m:
            return 0.0
        depth = sqrt(max(0.0, self.front_radius_m**2 - rho_m**2))  # rho may round past the sphere
        return rho_m**2 / (self.front_radius_m + depth)


@dataclass(frozen=True)
class CoilGeometry:
    """Air-core coil of rectangular winding section."""

    inner_radius_m: float
    outer_radius_m: float
    length_m: float
    distance_m: float
    """From the joint centre to the coil's centre."""
    turns: float


def read_magnet_and_coil(mjcf: Path) -> tuple[Magnet, CoilGeometry]:
    """Read the geometry of magnet and coil, from which the torque curve is computed.

    Raises
    ------
    InputError
        The file cannot be read, the model lacks poles or coils, or they are no cylinders.
    """
    model = read(mjcf).described
    check_bounded(model)
    poles = sites(model, "pole_")
    check_cylinders(model, poles)
    return read_magnet(model, poles), read_coil(model)


def check_cylinders(model: mujoco.MjModel, parts: list[int]) -> None:
    """Check that the sites of poles or of coils are cylinders, as the magnetic model takes them."""
    for part in parts:
        kind = mujoco.mjtGeom(model.site_type[part])
        if kind != mujoco.mjtGeom.mjGEOM_CYLINDER:
            name, shape = model.site(part).name, kind.name.removeprefix("mjGEOM_").lower()
            advice = "; `spheretwin magnetics field` computes boxes and spheres" * name.startswith("pole_")
            raise InputError(f"model: expected {name} as a cylinder, received the shape {shape}{advice}")


def read_magnet(model: mujoco.MjModel, poles: list[int]) -> Magnet:
    """Return the common magnet; of poles that are no cylinders, the cylinder around them."""
    extents = np.array([_extent(model, pole) for pole in poles])
    blank = Magnet(
        remanence_T=number(model, "magnet_remanence_T"),
        radius_m=shared(extents[:, 0], "radius of the poles"),
        length_m=2 * shared(extents[:, 1], "length of the poles"),
        distance_m=shared(np.linalg.norm(model.site_pos[poles], axis=1), "distance of the poles"),
    )
    return replace(blank, front_radius_m=front_radius(model, blank.radius_m, blank.length_m))


def _extent(model: mujoco.MjModel, part: int) -> tuple[float, float]:
    """Return radius and half length of the cylinder around a site along its z axis, m."""
    x, y, z = model.site_size[part]
    shapes, kind = mujoco.mjtGeom, model.site_type[part]
    if kind == shapes.mjGEOM_BOX:
        return hypot(x, y), z
    if kind == shapes.mjGEOM_SPHERE:
        return x, x
    if kind == shapes.mjGEOM_ELLIPSOID:
        return max(x, y), z
    return x, y + x * (kind == shapes.mjGEOM_CAPSULE)


def front_radius(model: mujoco.MjModel, radius_m: float, length_m: float) -> float:
    """Return the radius of the ground fronts of the poles; 0 (flat) if the model does not give it."""
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, FRONT_RADIUS) < 0:
        return 0.0
    value = float(model.numeric(FRONT_RADIUS).data[0])
    depth = min(radius_m, length_m)  # of the deepest possible cap
    smallest = (radius_m**2 + depth**2) / (2 * depth)
    if value != 0.0 and not smallest <= value <= LARGEST_LENGTH_M:
        low, high, received = distinct_texts(smallest, LARGEST_LENGTH_M, value)
        raise InputError(
            f"model: expected {FRONT_RADIUS} of 0, for a flat face, or from {low} to {high} for poles of this"
            f" radius and length, received {received}"
        )
    return value


def read_coil(model: mujoco.MjModel) -> CoilGeometry:
    """Return the common geometry of the coils of a compiled model, which are cylinders."""
    coils = sites(model, "coil_")
    check_cylinders(model, coils)
    coil = CoilGeometry(
        inner_radius_m=number(model, "coil_inner_radius_m"),
        outer_radius_m=shared(model.site_size[coils, 0], "radius of the coils"),
        length_m=2 * shared(model.site_size[coils, 1], "length of the coils"),
        distance_m=shared(np.linalg.norm(model.site_pos[coils], axis=1), "distance of the coils"),
        turns=number(model, "coil_turns"),
    )
    if coil.inner_radius_m >= coil.outer_radius_m:
        outer, inner = distinct_texts(coil.outer_radius_m, coil.inner_radius_m)
        raise InputError(
            f"model: expected coil_inner_radius_m below the coils' radius of {outer} m, received {inner}"
        )
    return coil
