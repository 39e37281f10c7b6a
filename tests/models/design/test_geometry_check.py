"""Geometry of an actuator: overlaps against points inside both cylinders, air gap, curve of another model."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from spheretwin.models.design.geometry_check import air_gap_m, clearance, of_model_file, overlaps
from tests.models.model_files import edited

RADIUS, LENGTH, DISTANCE = 0.011, 0.025, 0.063


def axes_apart(angle):
    return np.array([[np.sin(angle / 2), 0, np.cos(angle / 2)], [-np.sin(angle / 2), 0, np.cos(angle / 2)]])


def inside(points, axis):
    along = points @ axis
    across = np.linalg.norm(points - along[:, None] * axis, axis=1)
    return (np.abs(along - DISTANCE) <= LENGTH / 2) & (across <= RADIUS)


def some_point_is_in_both(angle):
    first, second = axes_apart(angle)
    # Two mirror images meet in the mirror x = 0, if at all: a fine net there.
    z = np.linspace(0, DISTANCE + LENGTH, 1201)
    y = np.linspace(-RADIUS, RADIUS, 41)
    Y, Z = (grid.ravel() for grid in np.meshgrid(y, z))
    points = np.column_stack([np.zeros(len(Y)), Y, Z])
    return bool(np.any(inside(points, first) & inside(points, second)))


@pytest.mark.parametrize("degrees", [5, 20, 24, 24.4, 24.7, 26, 40, 90, 180])
def test_sign_tells_whether_they_share_a_point(degrees):
    room = clearance(axes_apart(np.radians(degrees)), RADIUS, LENGTH, DISTANCE)[0, 1]
    assert (room < 0) == some_point_is_in_both(np.radians(degrees))


def test_touching_ones_have_no_room():
    touching = 2 * np.arctan(RADIUS / (DISTANCE - LENGTH / 2))
    assert_allclose(clearance(axes_apart(touching), RADIUS, LENGTH, DISTANCE)[0, 1], 0, atol=1e-15)


def test_opposite_ones_have_the_hole_between_them():
    room = clearance(axes_apart(np.pi), RADIUS, LENGTH, DISTANCE)[0, 1]
    assert_allclose(room, 2 * DISTANCE - LENGTH, rtol=1e-12)


def test_coils_of_neighbouring_layers_overlap_first(actuator):
    # The closest coils are neighbours of the upper layer, 26.4 degrees apart: 12 pairs, and 12 below.
    wide = replace(actuator, coil=replace(actuator.coil, outer_radius_m=0.0120))
    result = overlaps(wide)
    assert len(result) == 24
    assert {overlap.part for overlap in result} == {"coil"}
    for overlap in result:
        assert wide.coil_axes[overlap.first, 2] == pytest.approx(wide.coil_axes[overlap.second, 2])
        assert overlap.first < overlap.second
        assert 0 < overlap.depth_m < 1e-3


def test_poles_overlap_deepest_first(actuator):
    result = overlaps(replace(actuator, magnet=replace(actuator.magnet, radius_m=0.018)))
    assert {overlap.part for overlap in result} == {"pole"}
    depths = [overlap.depth_m for overlap in result]
    assert np.all(np.diff(depths) < 1e-8)  # equal ones by their indices


@pytest.mark.parametrize("front_radius_m", [0.0, 0.012, 0.03, 0.05, 0.2])
def test_air_gap_is_that_of_the_farthest_point_of_a_pole(actuator, front_radius_m):
    magnet = replace(actuator.magnet, front_radius_m=front_radius_m)
    rho = np.linspace(0, magnet.radius_m, 1001)
    if front_radius_m:
        height = magnet.front_m - front_radius_m + np.sqrt(front_radius_m**2 - rho**2)
    else:
        height = np.full_like(rho, magnet.front_m)
    farthest = np.hypot(rho, height).max()
    face = actuator.coil.distance_m - actuator.coil.length_m / 2
    assert air_gap_m(replace(actuator, magnet=magnet)) == pytest.approx(face - farthest, abs=1e-12)


def test_a_model_file_is_held_against_a_curve_that_says_what_it_is_for(actuator, tmp_path):
    path = edited(tmp_path, ('_turns" data="320"', '_turns" data="640"'))
    (line,) = of_model_file(path, actuator.torque_curve)
    assert "coil turns 320" in line
    # As one that has just been computed from the file itself.
    assert of_model_file(path, replace(actuator.torque_curve, computed_for=None)) == []


def test_a_model_file_without_a_rotor_is_not_warned_of(actuator, tmp_path):
    (path := tmp_path / "mine.xml").write_text("<mujoco/>")
    assert of_model_file(path, actuator.torque_curve) == []
