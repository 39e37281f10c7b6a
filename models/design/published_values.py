"""Magnetics compared with published numbers and with limits that have a closed form.

The direct sum and the torque curve of a run share their geometry. Here both methods are applied to cases that
others have computed, so that an error which both have in common would be visible.

References
----------
W. Robertson, "Modelling and design of magnetic levitation systems for vibration isolation", PhD thesis,
University of Adelaide 2013: axial force between a cylindrical magnet and a coil, table of precise results.
Its eccentric value is not used: quadrature gives a force that is 1.2 % smaller.
Magpylib, tests of force and torque: finite-element results (Ansys Maxwell) of a rectangular loop close to a
cuboid magnet, with a stated error of 1 %.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import hypot, log2, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.checks import Check
from spheretwin.models.design import direct_summation, pole_torque
from spheretwin.models.design.direct_summation import Rule
from spheretwin.models.magnet_and_coil import CoilGeometry, Magnet

Array = NDArray[np.float64]

MU_0 = 4e-7 * pi  # the value behind the published forces; that of 2019 differs by 1e-10


class PublishedForce(NamedTuple):
    """Axial force between a cylindrical magnet and a coaxial coil."""

    inner_radius_m: float
    outer_radius_m: float
    turns: float
    force_N: float
    bound: float
    """Largest relative difference: the digits that were printed."""


# Magnet of radius 9 mm, length 10 mm, 1 T; coil of length 20 mm, 10 mm from centre to centre, 1 A.
ROBERTSON_MAGNET = Magnet(remanence_T=1.0, radius_m=9e-3, length_m=10e-3, distance_m=0.0)
ROBERTSON_COIL_LENGTH_m, ROBERTSON_OFFSET_m = 20e-3, 10e-3
ROBERTSON = (
    PublishedForce(10e-3, 11e-3, 400.0, 2.4544438300903, 1e-9),
    # Printed 0.4937842; two independent quadratures give 0.4937846.
    PublishedForce(10e-3, 15e-3, 100.0, 0.4937842, 2e-6),
)
FORCE_RULE = Rule(across=48, along=96, around=4)  # by symmetry one point of the circle would be sufficient

# Cuboid of 0.5 x 10 x 0.3 mm, 1 T along x; rectangular loop of 0.45 x 7.95 mm with 50 mA.
LOOP_CORNERS_mm = np.array([[-0.225, -3.975], [0.225, -3.975], [0.225, 3.975], [-0.225, 3.975]])
LOOP_HEIGHT_mm, LOOP_CURRENT_A, LOOP_STEPS_PER_mm = 0.01, 0.05, 40
CUBOID_mm = (0.5, 10.0, 0.3)
# Lower face of the cuboid at x, y, z in mm; force on the loop in µN.
LOOP_FORCES = (
    ((0.2, 0.0, 0.2), (-38.697482833418, 0.0002242350531848, 59.4310879419995)),
    ((0.5, 0.0, 0.2), (31.1552670207915, -0.00142810245237877, 29.8624423913996)),
    ((0.8, 0.0, 0.2), (15.1908535165256, -3.87787107323596e-05, -2.59112312011276)),
    ((0.2, 1.0, 0.2), (-38.2166912173904, 0.74775728098968, 59.1285115576116)),
    ((0.5, 1.0, 0.2), (30.9248391472397, 0.711934423270261, 29.7711197385536)),
    ((0.8, 1.0, 0.2), (14.9818522746782, 0.285580482211302, -2.48002525728516)),
)
LOOP_BOUND = 0.01

AXIS_BOUND = 1e-12
AXIS_DISTANCES = np.geomspace(1.05, 20.0, 40)  # from the magnet's middle, in half lengths

DIPOLE_ANGLES = np.radians([15.0, 60.0, 100.0, 150.0])
DIPOLE_SIZES = (0.25, 0.125, 0.0625)
DIPOLE_ORDER = 2.0
DIPOLE_ORDER_TOLERANCE = 0.05


def checks(actuator: Actuator) -> list[Check]:
    """Return the comparisons with published numbers, and those with limits of the actuator's own parts.

    Parameters
    ----------
    actuator : Actuator
        Its magnet and its coil are scaled down for the dipole limit.

    Raises
    ------
    InputError
        magpylib is not installed.
    """
    tasks: tuple[Callable[[Actuator], list[Check]], ...] = (_robertson, _loop, _axis, _dipole)
    return [check for task in tasks for check in task(actuator)]


def axial_force_N(magnet: Magnet, coil: CoilGeometry) -> float:
    """Return the axial force of a magnet on a coaxial coil with one ampere, by the Lorentz force, N.

    Parameters
    ----------
    magnet : Magnet
        Its distance is that of its middle from the origin.
    coil : CoilGeometry
        On the same axis.
    """
    position, element = direct_summation.conductors(coil, FORCE_RULE)
    field = direct_summation.pole_magnet(magnet, np.array([0.0, 0.0, 1.0]), 1.0, FORCE_RULE.stacked)
    return float(np.sum(direct_summation.lorentz_force(field, position, element), axis=0)[2])


def _robertson(actuator: Actuator) -> list[Check]:
    rows = []
    for case, name in zip(ROBERTSON, ("thin coil", "thick coil"), strict=True):
        coil = CoilGeometry(
            case.inner_radius_m,
            case.outer_radius_m,
            ROBERTSON_COIL_LENGTH_m,
            ROBERTSON_OFFSET_m,
            case.turns,
        )
        force_N = abs(axial_force_N(ROBERTSON_MAGNET, coil))
        rows.append(
            Check(
                name=f"published force, {name}",
                compares="axial force of a magnet on a coil against the published number, relative",
                states=1,
                value=abs(force_N / case.force_N - 1),
                bound=case.bound,
                why="the digits of the published number",
                detail={"force_N": force_N, "published_N": case.force_N},
            )
        )
    return rows


def _loop(actuator: Actuator) -> list[Check]:
    from magpylib.magnet import Cuboid

    position, element = _rectangle()
    errors = []
    for place_mm, published_uN in LOOP_FORCES:
        middle_mm = np.add(place_mm, (0.0, 0.0, 0.5 * CUBOID_mm[2]))
        magnet = Cuboid(
            dimension=1e-3 * np.array(CUBOID_mm), polarization=(1.0, 0.0, 0.0), position=1e-3 * middle_mm
        )
        forces = direct_summation.lorentz_force(magnet, position, element)
        force_uN = 1e6 * LOOP_CURRENT_A * np.sum(forces, axis=0)
        errors.append(np.linalg.norm(force_uN - published_uN) / np.linalg.norm(published_uN))
    return [
        Check(
            name="published force, loop",
            compares="force of a cuboid magnet on a rectangular loop against finite elements, relative",
            states=len(LOOP_FORCES),
            value=float(max(errors)),
            bound=LOOP_BOUND,
            why="the error of the finite-element results",
        )
    ]


def _rectangle() -> tuple[Array, Array]:
    """Return middles and lengths of the elements of the rectangular loop, m."""
    positions, elements = [], []
    for first, last in zip(LOOP_CORNERS_mm, np.roll(LOOP_CORNERS_mm, -1, axis=0), strict=True):
        steps = round(LOOP_STEPS_PER_mm * hypot(*(last - first)))
        share = (np.arange(steps) + 0.5) / steps
        middle = first + share[:, None] * (last - first)
        positions.append(np.column_stack([middle, np.full(steps, LOOP_HEIGHT_mm)]))
        elements.append(np.tile(np.append((last - first) / steps, 0.0), (steps, 1)))
    return 1e-3 * np.concatenate(positions), 1e-3 * np.concatenate(elements)


def _axis(actuator: Actuator) -> list[Check]:
    """Compare the field on the axis of the blank of a pole with its closed form."""
    magnet = replace(actuator.magnet, front_radius_m=0.0)
    half = 0.5 * magnet.length_m
    z = half * AXIS_DISTANCES
    pole = direct_summation.pole_magnet(magnet, np.array([0.0, 0.0, 1.0]), 1.0, 1)
    observers = np.column_stack([0 * z, 0 * z, magnet.distance_m + z])
    ends = [(z + sign * half) / np.hypot(z + sign * half, magnet.radius_m) for sign in (1.0, -1.0)]
    exact = 0.5 * magnet.remanence_T * (ends[0] - ends[1])
    return [
        Check(
            name="field on the axis",
            compares="field of a flat pole on its axis against the closed form, over the remanence",
            states=len(z),
            value=float(np.max(np.abs(pole.getB(observers)[:, 2] - exact)) / magnet.remanence_T),
            bound=AXIS_BOUND,
            why="rounding",
        )
    ]


def _dipole(actuator: Actuator) -> list[Check]:
    """Measure the order at which the torque curve tends to that of two dipoles when the parts shrink."""
    errors = []
    for size in DIPOLE_SIZES:
        magnet, coil = _shrunk(actuator, size)
        exact = dipole_torque(magnet, coil, DIPOLE_ANGLES)
        computed = pole_torque.compute_curve(magnet, coil, DIPOLE_ANGLES).torque_Nm_per_A
        errors.append(float(np.max(np.abs(computed / exact - 1))))
    order = log2(errors[-2] / errors[-1])
    return [
        Check(
            name="dipole limit",
            compares="order at which f_t tends to the torque of two dipoles as magnet and coil shrink",
            states=len(DIPOLE_ANGLES) * len(DIPOLE_SIZES),
            value=order,
            bound=DIPOLE_ORDER + DIPOLE_ORDER_TOLERANCE,
            at_least=DIPOLE_ORDER - DIPOLE_ORDER_TOLERANCE,
            why="the next moment of a part with a plane of symmetry is two orders higher; the tolerance is"
            " for the moments after it",
            detail={
                f"error at size {size:g}": error for size, error in zip(DIPOLE_SIZES, errors, strict=True)
            },
        )
    ]


def dipole_torque(magnet: Magnet, coil: CoilGeometry, phi_rad: Array) -> Array:
    """Return the torque about the joint centre on a magnet, both parts taken as dipoles at their middles.

    Parameters
    ----------
    magnet, coil : Magnet, CoilGeometry
        The coil carries one ampere.
    phi_rad : (n,) array, rad
        Angle between their axes.

    Returns
    -------
    (n,) array, N·m/A
        Positive if it pulls the magnet towards the coil's axis, as in `TorqueCurve`.
    """
    turn_area = (
        pi / 3 * (coil.outer_radius_m**2 + coil.outer_radius_m * coil.inner_radius_m + coil.inner_radius_m**2)
    )
    coil_moment, magnet_moment = coil.turns * turn_area, magnet.remanence_T / MU_0 * magnet.volume_m3
    # The torque is minus the derivative of the energy -m.B by the angle, in the plane of both axes.
    a, b = magnet.distance_m, coil.distance_m
    c, s = np.cos(phi_rad), np.sin(phi_rad)
    r2 = a * a + b * b - 2 * a * b * c
    # B of the coil's dipole (along z, at b z) at the magnet, along the magnet's axis (s, 0, c).
    along_r, z = a - b * c, a * c - b
    # U = -k (3 (m.r)(c.r)/r^5 - m.c/r^3), with m.r = along_r, c.r = z.
    k = 1e-7 * coil_moment * magnet_moment
    d_along, d_z, d_r2 = b * s, -a * s, 2 * a * b * s
    value = 3 * along_r * z
    derivative = (
        3 * (d_along * z + along_r * d_z) / r2**2.5
        - 2.5 * value * d_r2 / r2**3.5
        + s / r2**1.5
        + 1.5 * c * d_r2 / r2**2.5
    )
    return np.asarray(-k * derivative)


def _shrunk(actuator: Actuator, size: float) -> tuple[Magnet, CoilGeometry]:
    """Return flat magnet and coil of a relative size, with their middles where they were."""
    magnet, coil = actuator.magnet, actuator.coil
    return (
        replace(magnet, radius_m=size * magnet.radius_m, length_m=size * magnet.length_m, front_radius_m=0.0),
        replace(
            coil,
            inner_radius_m=size * coil.inner_radius_m,
            outer_radius_m=size * coil.outer_radius_m,
            length_m=size * coil.length_m,
        ),
    )
