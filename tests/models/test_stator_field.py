"""Field of poles and coils at the stator, against magpylib and against the laws of a static field."""

from dataclasses import replace

import magpylib
import numpy as np
import pytest

from spheretwin.models.actuator import MJCF_PATH, load
from spheretwin.models.base.compiled import uncompiled
from spheretwin.models.base.errors import InputError
from spheretwin.models.design.rotor_field import rotor_magnets
from spheretwin.models.kinematics import frame_of_axis, rotation
from spheretwin.models.mjcf import read
from spheretwin.models.pole_symmetry import symmetry_rotations
from spheretwin.models.stator_field import (
    field_of_groups,
    field_of_poles,
    multipoles_T,
    pole_table,
    read_table,
)

ACTUATOR = load()
RADIUS_m = 0.085
STEP_m = 1e-4


def directions(n: int) -> np.ndarray:
    p = np.random.default_rng(3).normal(size=(n, 3))
    return p / np.linalg.norm(p, axis=1, keepdims=True)


@pytest.mark.parametrize("radius_m", [0.06, RADIUS_m])
def test_field_of_ground_poles_is_that_of_magpylib(radius_m):
    # A stack of 24 cylinders stands for the ground front there: within 2e-4 of the peak.
    R_SR, p = rotation(np.array([0.4, -0.3, 1.1])), directions(40) * radius_m
    magnets = rotor_magnets(read(MJCF_PATH).described)
    expected = magnets.getB(p @ R_SR) @ R_SR.T
    assert field_of_poles(ACTUATOR, p, R_SR) == pytest.approx(expected, abs=2e-4 * np.abs(expected).max())


def test_field_of_flat_poles_is_that_of_exact_cylinders():
    flat = replace(ACTUATOR, magnet=replace(ACTUATOR.magnet, front_radius_m=0.0))
    magnet, p, expected = flat.magnet, directions(40) * RADIUS_m, 0.0
    for axis, polarity in zip(flat.pole_axes, flat.pole_polarity, strict=True):
        size, frame = (2 * magnet.radius_m, magnet.length_m), frame_of_axis(axis)
        pole = magpylib.magnet.Cylinder(
            polarization=(0, 0, polarity * magnet.remanence_T), dimension=size, position=(0, 0, 0)
        )
        expected = expected + pole.getB(p @ frame - [0, 0, magnet.distance_m]) @ frame.T
    # Truncated at 1e-12, and both lose digits where sixteen fields cancel.
    assert field_of_poles(flat, p, np.eye(3)) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())


def test_field_has_no_divergence_and_no_rotation():
    p = directions(20) * RADIUS_m
    gradient = np.empty((20, 3, 3))
    for axis in range(3):
        step = STEP_m * np.eye(3)[axis]
        ahead, behind = (field_of_poles(ACTUATOR, p + sign * step, np.eye(3)) for sign in (1, -1))
        gradient[:, :, axis] = (ahead - behind) / (2 * STEP_m)
    size = np.abs(gradient).max()
    # Central differences miss h²/6 of the third derivative: some 1e-5 for a length of 20 mm.
    assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() < 1e-4 * size
    assert np.abs(gradient - gradient.transpose(0, 2, 1)).max() < 1e-4 * size


def test_symmetries_of_the_poles_leave_the_field_and_a_pitch_reverses_it():
    p = directions(20) * RADIUS_m
    field = field_of_poles(ACTUATOR, p, np.eye(3))
    rotations = symmetry_rotations(ACTUATOR.pole_axes, ACTUATOR.pole_polarity)
    for R in rotations:
        assert field_of_poles(ACTUATOR, p, R) == pytest.approx(field, abs=1e-12)
    pitch = rotation(np.array([0.0, 0.0, np.pi / 4]))
    assert field_of_poles(ACTUATOR, p, pitch) == pytest.approx(-field, abs=1e-12)


@pytest.mark.uncompiled
@pytest.mark.parametrize(("radius_m", "bound"), [(0.06, 3e-6), (RADIUS_m, 3e-8)])
def test_table_is_the_series(radius_m, bound):
    table, magnet = pole_table(ACTUATOR.magnet, radius_m), ACTUATOR.magnet
    x = np.random.default_rng(1).uniform(-1, 1, 300)
    x[:3] = -1, 1, 1 + 1e-12  # a cosine may round past 1
    values = np.array([uncompiled(read_table)(table, cosine) for cosine in x])
    degrees = np.arange(200)
    at_r = multipoles_T(magnet, 199) * (magnet.reach_m / radius_m) ** (degrees + 2)
    f, g = (degrees + 1) * at_r, np.polynomial.legendre.legder(at_r)
    for column, series in ((0, f), (2, g)):
        exact = np.polynomial.legendre.legval(x, series)
        slope = np.polynomial.legendre.legval(x, np.polynomial.legendre.legder(series))
        assert np.abs(values[:, column] - exact).max() < bound * np.abs(exact).max()
        assert np.abs(values[:, column + 1] - slope).max() < 100 * bound * np.abs(slope).max()


def test_field_of_groups_is_that_of_circular_loops():
    p, coil = directions(12) * RADIUS_m, ACTUATOR.coil
    loops = 40
    radii = coil.inner_radius_m + (coil.outer_radius_m - coil.inner_radius_m) * (np.arange(8) + 0.5) / 8
    heights = coil.length_m * ((np.arange(loops) + 0.5) / loops - 0.5)
    winding = magpylib.Collection(
        [
            magpylib.current.Circle(current=coil.turns / (8 * loops), diameter=2 * r, position=(0, 0, z))
            for r in radii
            for z in heights
        ]
    )
    expected = np.zeros((len(ACTUATOR.groups), len(p), 3))
    for group, coils in enumerate(ACTUATOR.groups):
        for c in coils:
            frame = frame_of_axis(ACTUATOR.coil_axes[c])
            local = p @ frame - [0, 0, coil.distance_m]
            expected[group] += ACTUATOR.coil_direction[c] * winding.getB(local) @ frame.T
    # Midpoints of 8 x 40 loops, and 4 x 6 x 24 Gauss points 10 mm away.
    assert field_of_groups(ACTUATOR, p) == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())


def test_points_near_the_poles_are_refused():
    with pytest.raises(InputError, match=r"expected sensors at a radius of at least 0\.0525 m"):
        pole_table(ACTUATOR.magnet, 0.05)
    with pytest.raises(InputError, match="expected radii of at least"):
        field_of_poles(ACTUATOR, np.array([[0.0, 0.0, 0.051]]), np.eye(3))
