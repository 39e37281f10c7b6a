"""Mutual inductance: against Maxwell's formula, the flux of magpylib's field, and symmetries."""

from dataclasses import replace
from itertools import product

import magpylib
import numpy as np
import pytest
from scipy.special import ellipe, ellipk

from spheretwin.models import inductance
from spheretwin.models.actuator import load
from spheretwin.models.inductance import coil_pair, mutual_inductance
from tests.models.design.quadrature import winding_loops, winding_section

MU0 = 4e-7 * np.pi
ACTUATOR = load()
COIL = ACTUATOR.coil
GROUP_H = ACTUATOR.group.inductance_H


def test_opposite_coils_are_maxwells_coaxial_loops():
    """J. C. Maxwell, A Treatise on Electricity and Magnetism, art. 701: complete elliptic integrals."""
    total = 0.0
    points = winding_section(COIL, 6, 8)
    for (a, first, share), (b, second, other) in product(points, points):
        squared = 4 * a * b / ((a + b) ** 2 + (first + second) ** 2)
        k = np.sqrt(squared)
        loops = MU0 * np.sqrt(a * b) * ((2 / k - k) * ellipk(squared) - 2 / k * ellipe(squared))
        total += share * other * loops
    # Both currents run about outward axes, which are opposite: the flux of one is against the other.
    expected = -(COIL.turns**2) * total
    assert coil_pair(COIL, np.pi) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("degrees", [26.42, 30.0, 60.0, 90.0, 127.6])
def test_inclined_coils_have_the_flux_of_magpylibs_field(degrees):
    """The field of loops, integrated over the areas of the turns of the other coil."""
    angle = np.radians(degrees)
    axis, side = np.array([np.sin(angle), 0, np.cos(angle)]), np.array([np.cos(angle), 0, -np.sin(angle)])
    up = np.array([0.0, 1.0, 0.0])
    x, weight = np.polynomial.legendre.leggauss(8)
    azimuth = 2 * np.pi * np.arange(24) / 24
    points, areas = [], []
    for radius, height, share in winding_section(COIL, 4, 6):
        for rho, w in zip(radius * (x + 1) / 2, weight * radius / 2, strict=True):
            for psi in azimuth:
                points.append(height * axis + rho * (np.cos(psi) * side + np.sin(psi) * up))
                areas.append(share * w * rho * 2 * np.pi / len(azimuth))
    field = magpylib.getB(winding_loops(COIL, 5, 10), np.array(points), sumup=True)
    expected = COIL.turns * np.array(areas) @ (field @ axis)
    # The coarser points of either method at coils that are 0.5 mm apart.
    assert coil_pair(COIL, angle) == pytest.approx(expected, rel=2e-4)


def test_neighbours_have_two_per_cent_of_the_inductance_of_a_group():
    share = mutual_inductance(ACTUATOR) / GROUP_H
    cosine = np.abs(ACTUATOR.group_axes @ ACTUATOR.group_axes.T)
    results = {
        round(float(np.degrees(np.arccos(c))), 2): s
        for c, s in zip(cosine.ravel(), share.ravel(), strict=True)
        if 0.5 < c < 0.999
    }
    # Around the equator, across layers, and along the outer layers: 30, 28 and 26.42 degrees.
    assert {angle: round(100 * value, 2) for angle, value in results.items() if angle < 35} == {
        30.0: -1.75,
        28.0: -2.05,
        26.42: -2.34,
    }
    assert np.all(share <= 0)  # fields of neighbours return through each other


def test_matrix_is_symmetric_without_diagonal_and_with_positive_energy():
    matrix = mutual_inductance(ACTUATOR)
    np.testing.assert_array_equal(np.diag(matrix), 0)
    np.testing.assert_allclose(matrix, matrix.T, rtol=0, atol=1e-18)
    assert np.linalg.eigvalsh(GROUP_H * np.eye(18) + matrix)[0] > 0.8 * GROUP_H


def test_group_is_the_sum_over_its_coils_in_any_order():
    matrix, axes = mutual_inductance(ACTUATOR), ACTUATOR.group_axes
    for j, k in ((0, 1), (3, 9), (5, 17)):
        angle = np.arccos(axes[j] @ axes[k])
        expected = 2 * coil_pair(COIL, angle) + 2 * coil_pair(COIL, np.pi - angle)
        assert matrix[j, k] == pytest.approx(expected, rel=1e-6)  # cosines are rounded to 1e-9
    swapped = replace(ACTUATOR, groups=ACTUATOR.groups[:, ::-1])
    np.testing.assert_allclose(mutual_inductance(swapped), matrix, rtol=1e-12)


def test_inductance_grows_with_the_square_of_turns_and_with_size():
    lengths = ("inner_radius_m", "outer_radius_m", "length_m", "distance_m")
    large = replace(COIL, **{name: 3 * getattr(COIL, name) for name in lengths})
    pair = coil_pair(COIL, np.radians(30))
    for coil, factor in ((replace(COIL, turns=2 * COIL.turns), 4), (large, 3)):
        assert coil_pair(coil, np.radians(30)) == pytest.approx(factor * pair, rel=1e-12)


@pytest.mark.release("0.7 s; the other tests compare with exact inductances")
def test_twice_the_points_change_the_nearest_neighbours_by_less_than_stated(monkeypatch):
    angle = np.radians(26.42)
    coarse = coil_pair(COIL, angle)
    for name in ("RADIAL", "AXIAL", "AROUND"):
        monkeypatch.setattr(inductance, name, 2 * getattr(inductance, name))
    assert coil_pair(COIL, angle) == pytest.approx(coarse, rel=4e-5)
