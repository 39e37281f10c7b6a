"""Symmetry group of the poles."""

import numpy as np
import pytest

from spheretwin.models.actuator import load
from spheretwin.models.pole_symmetry import symmetry_rotations, turn_period_rad

CUBE = np.vstack([np.eye(3), -np.eye(3)])


def test_shipped_poles_have_eight_rotations_and_a_quarter_turn():
    actuator = load()
    rotations = symmetry_rotations(actuator.pole_axes, actuator.pole_polarity)
    assert len(rotations) == 8  # dihedral: four turns about z, four half turns about horizontal axes
    assert sorted(np.round(rotations[:, 2, 2])) == [-1] * 4 + [1] * 4
    assert turn_period_rad(rotations) == pytest.approx(np.pi / 2)


def test_rotations_form_a_group():
    rotations = symmetry_rotations(CUBE, np.array([1, 1, 1, -1, -1, -1]))
    assert len(rotations) == 3  # about the diagonal of the equal poles
    for a in rotations:
        for b in rotations:
            assert min(np.abs(a @ b - c).max() for c in rotations) < 1e-12
    assert turn_period_rad(rotations) == pytest.approx(2 * np.pi)


def test_equal_poles_on_the_axes_have_the_rotations_of_a_cube():
    assert len(symmetry_rotations(CUBE, np.ones(6))) == 24


def test_a_single_odd_pole_leaves_the_turns_about_its_axis():
    polarity = np.array([1, 1, -1, 1, 1, 1])
    rotations = symmetry_rotations(CUBE, polarity)
    assert len(rotations) == 4
    assert turn_period_rad(rotations) == pytest.approx(np.pi / 2)


def test_poles_on_a_line_are_refused():
    with pytest.raises(ValueError, match="two axes"):
        symmetry_rotations(CUBE[[0, 3]], np.array([1, -1]))
