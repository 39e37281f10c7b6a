"""Torque matrix by direct summation: the field of the pole magnets on the current of all windings.

It has only the geometry in common with the torque curve: no angle between axes, no curve, no look-up. The
field of each magnet (magpylib) acts on every conductor of every coil, ``I dl x B``, and the rotor turns by
the reaction. A flat magnet's field is exact; one that is ground to a sphere is a stack of cylinders of the
same volume, whose field tends to its own with the square of their number.

What the paper does instead, adding one curve's value for each pair of pole and coil (13), is exact for
magnets and coils of revolution in air: fields add, and the torque of such a pair is normal to its two axes
and depends on their angle alone. So the two must agree but for arithmetic. Neither knows the iron hoop
behind the poles: that is a question to finite elements or to a bench.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.extras import missing
from spheretwin.models.design.workspace import pose
from spheretwin.models.kinematics import frame_of_axis, rotation
from spheretwin.models.magnet_and_coil import CoilGeometry, Magnet
from spheretwin.models.magnetics import fill_torque_matrix, scratch_of, torque_model
from spheretwin.models.scatter import Scatter, no_scatter, scattered_model

# Beyond the angle at which a magnet's rim leaves the winding's edge the integrand is smooth.
RIM_MARGIN = np.radians(2.0)

# Conductor elements evaluated at once: three times as fast as all at once.
BLOCK = 8192


class Rule(NamedTuple):
    """Numbers of quadrature points in one winding, and of the pieces of a magnet."""

    across: int
    """Gauss points from the bore to the outer radius."""
    along: int
    """Gauss points along the axis, crowded towards the face at the air gap."""
    around: int
    """Equal steps around the axis."""
    stacked: int = 8
    """Cylinders that stand for a ground magnet; a flat one is one cylinder."""

    def halved(self) -> Rule:
        """Half the points in each direction, and half the cylinders."""
        return Rule(*(number // 2 for number in self))


class Quadrature(NamedTuple):
    """Rule for a coil that a magnet's rim passes close by, or through, and for all others."""

    near: Rule
    far: Rule

    def halved(self) -> Quadrature:
        """Half the points in each direction."""
        return Quadrature(self.near.halved(), self.far.halved())


# For ground magnets. Of the curve's peak, for one pair: near within 2e-4, all but 1e-5 of it the steps of the
# stack, which fall with the square of their number; far within 3e-5.
STANDARD = Quadrature(near=Rule(8, 8, 32, 24), far=Rule(8, 8, 32, 4))

# A flat magnet's sharp rim may stand within the winding. B has a logarithm at the rim: the sum over points
# converges, but slowly. Near within 3e-4, far within 1e-6.
FLAT = Quadrature(near=Rule(24, 24, 96), far=Rule(8, 8, 32))


class Comparison(NamedTuple):
    """Torque matrices of the same n poses, computed in three ways."""

    tilt_rad: Array  # (n,)
    q: Array  # (n, 3), rad
    model: Array  # (n, 3, groups), N·m/A, by the torque curve
    direct: Array  # (n, 3, groups), by direct summation
    coarse: Array  # (n, 3, groups), by direct summation with half the points in each direction


class Errors(NamedTuple):
    """Differences of the torques of random currents, n poses times m currents."""

    torque_Nm: Array  # (n, m), magnitude by direct summation
    model_Nm: Array  # (n, m), distance from there to the model's torque
    quadrature_Nm: Array  # (n, m), distance to the coarser sum's


def direct_torque_matrix(
    q: Array,
    actuator: Actuator,
    quadrature: Quadrature | None = None,
    scatter: Scatter | None = None,
) -> Array:
    """Return the torque matrix G_t(q) by direct summation over all poles and all conductors.

    Parameters
    ----------
    q : (3,) array, rad
        Pose.
    actuator : Actuator
        Its geometry; its torque curve is not used.
    quadrature : Quadrature
        Points in the windings; the default depends on whether the magnets are flat or ground.
    scatter : Scatter
        None unless given.

    Returns
    -------
    (3, n) array, N·m/A
        Torque on the rotor about the joint centre, stator frame, of one ampere in each of n groups.

    Raises
    ------
    InputError
        magpylib is not installed.
    """
    quadrature = quadrature or _standard(actuator.magnet)
    poles, coils, _ = scatter or no_scatter(actuator)
    near_angle = _rim_reaches_winding(actuator)
    pole_axes = poles.axes(actuator.pole_axes) @ rotation(np.asarray(q, dtype=np.float64)).T  # stator frame
    coil_axes = coils.axes(actuator.coil_axes)
    torque = np.zeros((len(coil_axes), 3))
    for axis, polarity, gain, distance_m in zip(
        pole_axes, actuator.pole_polarity, poles.gain, poles.distance_m, strict=True
    ):
        pole = replace(actuator.magnet, distance_m=actuator.magnet.distance_m + distance_m)
        near = np.arccos(np.clip(coil_axes @ axis, -1.0, 1.0)) < near_angle
        for here, rule in ((near, quadrature.near), (~near, quadrature.far)):
            magnet = pole_magnet(pole, axis, float(polarity * (1 + gain)), rule.stacked)
            on_coils = torque_on_coils(magnet, coil_axes[here], coils.distance_m[here], actuator.coil, rule)
            torque[here] -= (1 + coils.gain[here, None]) * on_coils
    return actuator.of_groups(torque)


def compare(
    actuator: Actuator,
    tilt_rad: Array,
    seed: int = 0,
    quadrature: Quadrature | None = None,
    track: Callable[[range], Iterable[int]] = iter,
    scatter: Scatter | None = None,
) -> Comparison:
    """Compute the torque matrix by the curve and by direct summation, in random poses.

    Parameters
    ----------
    actuator : Actuator
        The actuator.
    tilt_rad : (n,) array, rad
        Tilt of the shaft of each pose; its direction and the spin are random.
    seed : int
        Of the random poses.
    quadrature : Quadrature
        The finer of the two sums.
    track : callable
        Iterates over the numbers of the poses, and may show progress.
    scatter : Scatter
        None unless given.
    """
    quadrature = quadrature or _standard(actuator.magnet)
    azimuth, spin = np.random.default_rng(seed).uniform(-np.pi, np.pi, (2, len(tilt_rad)))
    q = pose(tilt_rad, azimuth, spin)
    model, direct, coarse = np.empty((3, len(q), 3, len(actuator.groups)))
    data = scattered_model(actuator, scatter) if scatter else torque_model(actuator)
    scratch = scratch_of(data)
    for i in track(range(len(q))):
        fill_torque_matrix(q[i], data.arrangement[0], data.tables, model[i], scratch)
        direct[i] = direct_torque_matrix(q[i], actuator, quadrature, scatter)
        coarse[i] = direct_torque_matrix(q[i], actuator, quadrature.halved(), scatter)
    return Comparison(tilt_rad, q, model, direct, coarse)


def errors(compared: Comparison, limit_A: float, currents: int = 200, seed: int = 0) -> Errors:
    """Return the differences of the torques of random currents, evenly distributed within the limit.

    Parameters
    ----------
    compared : Comparison
        Matrices of some poses.
    limit_A : float, A
        Largest magnitude of a current.
    currents : int
        Current vectors for each pose.
    seed : int
        Of the random currents.
    """
    n, _, groups = compared.direct.shape
    current = np.random.default_rng([seed, 1]).uniform(-limit_A, limit_A, (n, groups, currents))

    def magnitude(G: Array) -> Array:
        return np.asarray(np.linalg.norm(G @ current, axis=1))

    return Errors(
        torque_Nm=magnitude(compared.direct),
        model_Nm=magnitude(compared.model - compared.direct),
        quadrature_Nm=magnitude(compared.coarse - compared.direct),
    )


def _standard(magnet: Magnet) -> Quadrature:
    return STANDARD if magnet.front_radius_m else FLAT


def pole_magnet(magnet: Magnet, axis: Array, polarity: float, stacked: int) -> Any:
    """Return a pole as homogeneously magnetised cylinders of magpylib, in the stator frame.

    Parameters
    ----------
    magnet : Magnet
        Geometry and remanence.
    axis : (3,) array
        Unit vector from the joint centre to the pole.
    polarity : float
        1 if it is magnetised outward, -1 if inward.
    stacked : int
        Cylinders that stand for a ground magnet; a flat one is one cylinder.

    Raises
    ------
    InputError
        magpylib is not installed.
    """
    try:
        from magpylib import Collection
        from magpylib.magnet import Cylinder
    except ImportError:
        raise missing("magnetics", "magpylib", "magnetics", "to compute fields") from None
    from scipy.spatial.transform import Rotation

    pieces = [
        Cylinder(
            polarization=(0.0, 0.0, polarity * magnet.remanence_T),
            dimension=(2 * radius, top - bottom),
            position=0.5 * (top + bottom) * axis,
            orientation=Rotation.from_matrix(frame_of_axis(axis)),
        )
        for radius, bottom, top in cylinders(magnet, stacked)
    ]
    return Collection(pieces)


@lru_cache(maxsize=8)
def cylinders(magnet: Magnet, stacked: int) -> list[tuple[float, float, float]]:
    """Return radius, lower and upper end of cylinders that represent a magnet, m from the joint centre.

    A ground front becomes steps: rings of equal width, each at the mean height of the front over it. The
    charge on the front moves slightly up or down, with mean zero, and the volume is unchanged.
    """
    if not magnet.front_radius_m:
        return [(magnet.radius_m, magnet.back_m, magnet.front_m)]
    edges = magnet.radius_m * np.arange(stacked + 1) / stacked
    under = [magnet.volume_within_m3(edge) for edge in edges]
    heights = magnet.back_m + np.diff(under) / (np.pi * np.diff(edges**2))  # (stacked,), falling outward
    lower = [*heights[1:], magnet.back_m]
    return [(float(r), float(b), float(t)) for r, b, t in zip(edges[1:], lower, heights, strict=True)]


def lorentz_force(magnet: Any, position: Array, element: Array) -> Array:
    """Return the force of a magnet on elements of a conductor with one ampere, (n, 3) in N.

    Parameters
    ----------
    magnet : source of magpylib
        Source of the field.
    position : (n, 3) array, m
        Middles of the elements.
    element : (n, 3) array, m
        Their lengths along a positive current.
    """
    return np.asarray(np.cross(element, magnet.getB(position)))


def torque_on_coils(magnet: Any, axes: Array, farther_m: Array, coil: CoilGeometry, rule: Rule) -> Array:
    """Return the torque of a magnet on one ampere in each of k coils, about the joint centre: (k, 3), N·m."""
    turned = np.array([frame_of_axis(axis).T for axis in axes]).reshape(-1, 3, 3)
    position, element = ((vectors @ turned).reshape(-1, 3) for vectors in conductors(coil, rule))
    position += np.repeat(farther_m[:, None] * axes, len(conductors(coil, rule)[0]), axis=0)
    torque = np.empty_like(position)
    for start in range(0, len(position), BLOCK):
        block = slice(start, start + BLOCK)
        force = lorentz_force(magnet, position[block], element[block])
        torque[block] = np.cross(position[block], force)
    return torque.reshape(len(axes), len(conductors(coil, rule)[0]), 3).sum(axis=1)


@lru_cache(maxsize=8)
def conductors(coil: CoilGeometry, rule: Rule) -> tuple[Array, Array]:
    """Return the conductor elements of a coil whose axis is z.

    Parameters
    ----------
    coil : CoilGeometry
        The coil.
    rule : Rule
        Points in its winding.

    Returns
    -------
    (n, 3) array, m
        Positions.
    (n, 3) array, m
        Length of conductor times the turns that it represents, along a positive current.
    """
    u, share_u = np.polynomial.legendre.leggauss(rule.across)
    v, share_v = np.polynomial.legendre.leggauss(rule.along)
    t = 0.5 + 0.5 * v
    radius = coil.inner_radius_m + (coil.outer_radius_m - coil.inner_radius_m) * (0.5 + 0.5 * u)
    height = coil.distance_m + coil.length_m * (t**2 - 0.5)  # t**2: crowded towards the inner face
    psi = (np.arange(rule.around) + 0.5) * 2 * np.pi / rule.around
    rho, z, angle = (grid.ravel() for grid in np.meshgrid(radius, height, psi, indexing="ij"))
    turns = coil.turns * np.outer(0.5 * share_u, share_v * t)
    length = np.repeat(turns.ravel(), rule.around) * 2 * np.pi / rule.around * rho
    cosine, sine, zero = np.cos(angle), np.sin(angle), np.zeros(len(angle))
    position = np.column_stack([rho * cosine, rho * sine, z])
    return position, length[:, None] * np.column_stack([-sine, cosine, zero])


def _rim_reaches_winding(actuator: Actuator) -> float:
    """Return the angle between two axes below which the magnet's rim is next to the coil's edge."""
    magnet, coil = actuator.magnet, actuator.coil
    rim = np.arctan2(magnet.radius_m, magnet.rim_m)
    edge = np.arctan2(coil.outer_radius_m, coil.distance_m - coil.length_m / 2)
    return float(rim + edge + RIM_MARGIN)
