"""Magnetic field at points of the stator: of the poles in a pose, and of the coils per ampere.

A pole is a body of revolution about its axis, magnetised along it: its field is that of charges ``Br n·u`` on
front and back. With the multipoles c of these charges, a the farthest point of the pole from the joint
centre, and x the cosine of the angle between the axis u of the pole and the direction p of the point,

    B = f(x) p + g(x) (x p - u),   f = Σ (l + 1) c_l (a/r)^(l + 2) P_l(x),   g = Σ c_l (a/r)^(l + 2) P_l'(x),

exact for r > a, without rotation and divergence term by term. All points have one radius r, so that f and g
are functions of x alone: compiled code reads them from a table. Iron is not modelled.
"""

from __future__ import annotations

from math import ceil, log
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.errors import InputError
from spheretwin.models.inductance import MU0_OVER_4PI, filaments
from spheretwin.models.kinematics import frame_of_axis
from spheretwin.models.magnet_and_coil import Magnet
from spheretwin.models.torque_curve import TorqueCurve

INTERVALS = 512
"""Intervals of the table over x from -1 to 1: cubics miss 2e-8 of the peak at 85 mm, 2e-6 at 60 mm."""

CLOSEST = 1.05
"""Least radius of the points over that of the poles: the series converges as the inverse to the degree."""

PRECISION, QUADRATURE = 1e-12, 64


class Values(NamedTuple):
    """Functions of the field of one pole at the cosine x, T, and their slopes."""

    f: float
    f_slope: float
    g: float
    g_slope: float


def pole_table(magnet: Magnet, radius_m: float) -> Array:
    """Return f and g with their slopes times the step, (INTERVALS + 1, 4), T, at even steps of x.

    Raises
    ------
    InputError
        The radius is less than `CLOSEST` times that of the magnets.
    """
    a = magnet.reach_m
    if not radius_m >= CLOSEST * a:
        raise InputError(
            f"hall: expected sensors at a radius of at least {CLOSEST * a:.4g} m, {CLOSEST:g} times that of"
            f" the magnets, received {radius_m:g} m"
        )
    degree = ceil(log(PRECISION) / log(a / radius_m))
    at_r = multipoles_T(magnet, degree) * (a / radius_m) ** (np.arange(degree + 1) + 2)
    f, g = (np.arange(degree + 1) + 1) * at_r, legendre.legder(at_r)
    x, step = np.linspace(-1, 1, INTERVALS + 1), 2 / INTERVALS
    columns = [legendre.legval(x, series) for series in (f, legendre.legder(f), g, legendre.legder(g))]
    return np.stack(columns, axis=1) * [1, step, 1, step]


def multipoles_T(magnet: Magnet, degree: int) -> Array:
    """Return the multipoles c of a north pole, (degree + 1,), T, from the charges on its front and back."""
    nodes, weights = legendre.leggauss(QUADRATURE)
    rho = magnet.radius_m * (nodes + 1) / 2
    area = weights * magnet.radius_m / 2 * rho  # over 2 pi, projected on the plane across the axis
    total = np.zeros(degree + 1)
    front = magnet.front_m - np.array([magnet.sagitta_at_m(r) for r in rho])
    for height, sign in ((front, 1.0), (np.full(QUADRATURE, magnet.back_m), -1.0)):
        s = np.hypot(rho, height)
        powers = (s[:, None] / magnet.reach_m) ** np.arange(degree + 1)
        total += sign * (area @ (powers * legendre.legvander(height / s, degree)))
    return magnet.remanence_T / 2 * total / magnet.reach_m**2


@inlined
def read_table(table: Array, x: float) -> Values:
    """Return the values of a table at a cosine, which may round past 1: cubics between its rows."""
    steps = 0.5 * (table.shape[0] - 1)  # per unit of x
    place = (x + 1.0) * steps
    i = np.uintp(0)
    if place > 0.0:
        i = np.uintp(min(int(place), table.shape[0] - 2))
    t, j = place - i, i + np.uintp(1)
    u, t2 = 1.0 - t, t * t
    second, rise, fall = t2 * (3.0 - 2.0 * t), t * u * u, -t2 * u
    slope, begin, end = 6.0 * t * u, u * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)
    f, f_rise, f_end, f_change = table[i, 0], table[i, 1], table[j, 1], table[j, 0] - table[i, 0]
    g, g_rise, g_end, g_change = table[i, 2], table[i, 3], table[j, 3], table[j, 2] - table[i, 2]
    return Values(
        f + second * f_change + rise * f_rise + fall * f_end,
        steps * (slope * f_change + begin * f_rise + end * f_end),
        g + second * g_change + rise * g_rise + fall * g_end,
        steps * (slope * g_change + begin * g_rise + end * g_end),
    )


def field_of_poles(actuator: Actuator, points_m: Array, R_SR: Array) -> Array:
    """Return the field of all poles at points of the stator, (n, 3), T, from the series itself.

    Parameters
    ----------
    actuator : Actuator
        With round poles, which a torque curve describes.
    points_m : (n, 3) array, m
        Stator frame; their radii may differ.
    R_SR : (3, 3) array
        Pose.

    Raises
    ------
    InputError
        A point is too close to the magnets, or the poles are of another shape.
    """
    check_round_poles(actuator)
    magnet, radius = actuator.magnet, np.linalg.norm(points_m, axis=1)
    if not np.all(radius >= CLOSEST * magnet.reach_m):
        raise InputError(
            f"points: expected radii of at least {CLOSEST * magnet.reach_m:.4g} m,"
            f" received {radius.min():g} m"
        )
    degree = ceil(log(PRECISION) / log(magnet.reach_m / radius.min()))
    p, u = points_m / radius[:, None], actuator.pole_axes @ R_SR.T
    x = p @ u.T  # (n, poles)
    P = legendre.legvander(x, degree)
    slope = legendre.legval(x, legendre.legder(np.eye(degree + 1)))  # (degree + 1, n, poles)
    order = np.arange(degree + 1)
    at_r = multipoles_T(magnet, degree) * (magnet.reach_m / radius[:, None]) ** (order + 2)
    f = np.einsum("npl,nl->np", P, at_r * (order + 1)) * actuator.pole_polarity
    g = np.einsum("lnp,nl->np", slope, at_r) * actuator.pole_polarity
    return np.asarray(((f + x * g).sum(axis=1))[:, None] * p - g @ u)


def field_of_groups(actuator: Actuator, points_m: Array) -> Array:
    """Return the field of one ampere in each group at points of the stator, (groups, n, 3), T/A.

    The law of Biot and Savart over the filaments of the windings: points within a winding have no accurate
    field.
    """
    place, element = filaments(actuator.coil)  # (3, m)
    of_coils = np.empty((len(actuator.coil_axes), len(points_m), 3))
    for field, axis in zip(of_coils, actuator.coil_axes, strict=True):
        frame = frame_of_axis(axis)
        reach = (points_m @ frame)[:, :, None] - place  # (n, 3, m), frame of the coil
        weights = np.linalg.norm(reach, axis=1, keepdims=True) ** -3
        cross = np.cross(element, reach * weights, axisa=0, axisb=1)  # (n, m, 3)
        field[:] = MU0_OVER_4PI * actuator.coil.turns * cross.sum(axis=1) @ frame.T
    signed = actuator.coil_direction[:, None, None] * of_coils
    return np.asarray(signed[actuator.groups].sum(axis=1))


def check_round_poles(actuator: Actuator) -> None:
    """Check that the poles are cylinders on radial axes.

    Raises
    ------
    InputError
        The actuator has a torque field, whose magnets may have any shape.
    """
    if not isinstance(actuator.torque_data, TorqueCurve):
        raise InputError(
            "hall: expected a model with a torque curve, whose poles are round magnets on radial axes,"
            f" received a {actuator.torque_data.name}"
        )
