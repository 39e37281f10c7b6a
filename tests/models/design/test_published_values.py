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

from dataclasses import replace
from math import hypot, log2, pi

import numpy as np
import pytest
from magpylib.magnet import Cuboid
from magpylib.misc import Dipole

from spheretwin.models.design import direct_summation, pole_torque
from spheretwin.models.design.direct_summation import Rule
from spheretwin.models.magnet_and_coil import CoilGeometry, Magnet

MU_0 = 4e-7 * pi  # the value behind the published forces; that of 2019 differs by 1e-10
Z = np.array([0.0, 0.0, 1.0])

# Magnet of radius 9 mm, length 10 mm, 1 T; coil of length 20 mm, 10 mm from centre to centre, 1 A.
MAGNET = Magnet(remanence_T=1.0, radius_m=9e-3, length_m=10e-3, distance_m=0.0)
FORCE_RULE = Rule(across=48, along=96, around=4)  # by symmetry one point of the circle would be sufficient


def force_N(outer_radius_m, turns):
    """Return the axial force of the magnet on a coaxial coil with one ampere, by the Lorentz force."""
    position, element = direct_summation.conductors(
        CoilGeometry(10e-3, outer_radius_m, 20e-3, 10e-3, turns), FORCE_RULE
    )
    field = direct_summation.pole_magnet(MAGNET, Z, 1.0, FORCE_RULE.stacked)
    return abs(np.sum(direct_summation.lorentz_force(field, position, element), axis=0)[2])


def test_a_magnet_pulls_a_coil_with_the_published_force():
    # All 14 printed digits but the last: 2.5e-12.
    assert force_N(11e-3, 400.0) == pytest.approx(2.4544438300903, rel=1e-11)
    # Printed 0.4937842; two independent quadratures give 0.4937846.
    assert force_N(15e-3, 100.0) == pytest.approx(0.4937842 * (1 + 7.5e-7), rel=1e-8)


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


def rectangle():
    """Return middles and lengths of the elements of the loop, m."""
    positions, elements = [], []
    for first, last in zip(LOOP_CORNERS_mm, np.roll(LOOP_CORNERS_mm, -1, axis=0), strict=True):
        steps = round(LOOP_STEPS_PER_mm * hypot(*(last - first)))
        share = (np.arange(steps) + 0.5) / steps
        middle = first + share[:, None] * (last - first)
        positions.append(np.column_stack([middle, np.full(steps, LOOP_HEIGHT_mm)]))
        elements.append(np.tile(np.append((last - first) / steps, 0.0), (steps, 1)))
    return 1e-3 * np.concatenate(positions), 1e-3 * np.concatenate(elements)


def test_a_cuboid_pulls_a_loop_with_the_force_of_finite_elements():
    """Within 0.3 %; their stated error is 1 %."""
    position, element = rectangle()
    for place_mm, published_uN in LOOP_FORCES:
        middle_mm = np.add(place_mm, (0.0, 0.0, 0.5 * CUBOID_mm[2]))
        magnet = Cuboid(
            dimension=1e-3 * np.array(CUBOID_mm), polarization=(1.0, 0.0, 0.0), position=1e-3 * middle_mm
        )
        forces = direct_summation.lorentz_force(magnet, position, element)
        force_uN = 1e6 * LOOP_CURRENT_A * np.sum(forces, axis=0)
        assert np.linalg.norm(force_uN - published_uN) < 4e-3 * np.linalg.norm(published_uN)


def test_the_field_of_a_flat_pole_on_its_axis_is_its_closed_form(actuator):
    magnet = replace(actuator.magnet, front_radius_m=0.0)
    half = 0.5 * magnet.length_m
    z = half * np.geomspace(1.05, 20.0, 40)  # from the middle of the magnet
    pole = direct_summation.pole_magnet(magnet, Z, 1.0, 1)
    observers = np.column_stack([0 * z, 0 * z, magnet.distance_m + z])
    ends = [(z + sign * half) / np.hypot(z + sign * half, magnet.radius_m) for sign in (1.0, -1.0)]
    exact = 0.5 * magnet.remanence_T * (ends[0] - ends[1])
    np.testing.assert_allclose(pole.getB(observers)[:, 2], exact, atol=1e-14 * magnet.remanence_T, rtol=0)


def dipole_torque(magnet, coil, phi_rad):
    """Return the torque about the joint centre on a magnet, both parts taken as dipoles at their middles.

    Positive if it pulls the magnet towards the coil's axis, as in `TorqueCurve`: central differences of the
    energy -m.B in magpylib's field, within 2e-8 of the torque.
    """
    share = (np.arange(10_000) + 0.5) / 10_000  # mean over the winding, within 1e-9
    area = pi * np.mean((coil.inner_radius_m + share * (coil.outer_radius_m - coil.inner_radius_m)) ** 2)
    source = Dipole(moment=(0, 0, coil.turns * area), position=(0, 0, coil.distance_m))
    moment, step = magnet.remanence_T * magnet.volume_m3 / MU_0, 1e-5

    def energy(phi):
        axis = np.column_stack([np.sin(phi), 0 * phi, np.cos(phi)])
        return -moment * np.sum(axis * source.getB(magnet.distance_m * axis), axis=1)

    return (energy(phi_rad + step) - energy(phi_rad - step)) / (2 * step)


def test_the_curve_tends_to_that_of_two_dipoles_with_order_2(actuator):
    """The next moment of a part with a plane of symmetry is two orders higher; then come others."""
    angles, errors = np.radians([15.0, 60.0, 100.0, 150.0]), []
    for size in (0.125, 0.0625):
        magnet, coil = (
            replace(part, **{name: size * getattr(part, name) for name in names}, **more)
            for part, names, more in (
                (actuator.magnet, ("radius_m", "length_m"), {"front_radius_m": 0.0}),
                (actuator.coil, ("inner_radius_m", "outer_radius_m", "length_m"), {}),
            )
        )
        computed = pole_torque.compute_curve(magnet, coil, angles).torque_Nm_per_A
        errors.append(np.max(np.abs(computed / dipole_torque(magnet, coil, angles) - 1)))
    assert log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.03)  # measured: 2.020
