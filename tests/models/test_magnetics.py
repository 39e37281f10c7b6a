"""The torque matrix against the paper's sum, and against what the arrangement's symmetries demand."""

from dataclasses import replace

import numpy as np
import pytest

from spheretwin.models.base.vectors import cubic
from spheretwin.models.kinematics import rate_jacobian, rotation
from spheretwin.models.magnetics import (
    fill_torque_matrix,
    lookup_table,
    place,
    scratch_of,
    torque_matrix,
    torque_model,
)
from spheretwin.models.torque_curve import TorqueCurve

# The look-up stays within 1e-6 of the curve's peak a pole and coil; a column sums 16 poles and two coils.
LOOKUP = 1e-6
SUMMED = 32 * LOOKUP


def random_poses(count, seed=0):
    generator = np.random.default_rng(seed)
    return generator.uniform([-1, -1, -np.pi], [1, 1, np.pi], (count, 3))


def papers_sum(q, actuator):
    """Equations (12) to (14) to the letter: every pole against every coil, by arc cosine."""
    R_SR = rotation(q)
    columns = np.zeros((36, 3))
    for j, s in enumerate(actuator.coil_axes):
        for r, polarity in zip(actuator.pole_axes @ R_SR.T, actuator.pole_polarity, strict=True):
            normal = np.cross(r, s)
            if np.linalg.norm(normal) > 1e-12:
                phi = np.arccos(np.clip(r @ s, -1, 1))
                force = actuator.torque_curve.spline(phi)
                columns[j] += polarity * force * normal / np.linalg.norm(normal)
    return columns[actuator.groups].sum(axis=1).T


def test_lookup_is_within_a_millionth_of_the_peak(actuator):
    curve = actuator.torque_curve
    phi = np.linspace(1e-6, np.pi - 1e-6, 200_001)
    table = lookup_table(curve)
    row = np.array([place(c) for c in np.cos(phi)])
    index = row.astype(int)
    t = row - index
    h = np.polynomial.polynomial.polyval(t, table[index].T, tensor=False)
    pair = curve.spline(phi) - curve.spline(np.pi - phi)  # a coil and its opposite
    assert np.abs(h * np.sin(phi) - pair).max() <= LOOKUP * curve.peak_Nm_per_A


def test_matrix_is_the_paper_s_sum_over_all_pairs(actuator):
    tolerance = SUMMED * actuator.torque_curve.peak_Nm_per_A
    for q in random_poses(20):
        np.testing.assert_allclose(torque_matrix(q, actuator), papers_sum(q, actuator), atol=tolerance)


@pytest.mark.parametrize("groups", [1, 2, 3, 4, 5, 7, 8, 17])
def test_columns_are_the_same_for_any_number_of_groups(actuator, groups):
    complete = torque_model(actuator)
    some = complete._replace(group_axes=np.ascontiguousarray(complete.group_axes[:, :groups]))
    G, around = np.empty((3, groups)), np.full((5, groups), 7.0)
    for q in random_poses(5):
        fill_torque_matrix(q, some, G, scratch_of(some))
        fill_torque_matrix(q, some, around[1:4], scratch_of(some))
        np.testing.assert_array_equal(G, torque_matrix(q, actuator)[:, :groups])
        np.testing.assert_array_equal(around, np.vstack([np.full(groups, 7.0), G, np.full(groups, 7.0)]))


def test_lookup_goes_on_beyond_its_ends(actuator):
    """The cosine of a pole in front of a coil, or behind it, may round past 1."""
    model, eps = torque_model(actuator), np.finfo(float).eps
    peak = actuator.torque_curve.peak_Nm_per_A
    for end in (-1.0, 1.0):
        inside, at, beyond = (cubic(model.table, place(end * (1 + step * eps))) for step in (-64, 0, 4))
        assert abs(at - inside) < 1e-9 * peak
        assert abs(beyond - at) < 1e-9 * peak


def test_pole_in_front_of_a_coil_is_no_singular_case(actuator):
    # The first pole's axis is turned onto the first coil of the middle layer.
    middle = next(j for j, s in enumerate(actuator.coil_axes) if abs(s[2]) < 1e-9)
    pole = actuator.pole_axes[0]
    q = np.array([0.0, np.arcsin(pole[2]), 0.0])
    facing = rotation(q) @ pole
    assert np.allclose(facing, actuator.coil_axes[middle], atol=1e-12)
    tolerance = SUMMED * actuator.torque_curve.peak_Nm_per_A
    np.testing.assert_allclose(torque_matrix(q, actuator), papers_sum(q, actuator), atol=tolerance)


def test_matrix_is_linear_in_the_torque_curve(actuator):
    # Spline, table and sum over pairs are: of two kinds of magnet in each pole the torques add.
    phi = actuator.torque_curve.phi_rad
    curves = [2.0 * actuator.torque_curve.torque_Nm_per_A, -3e-3 * np.sin(phi) * np.exp(np.cos(phi))]
    for q in random_poses(5):
        first, second, both = (
            torque_matrix(q, replace(actuator, torque_data=TorqueCurve(phi, curve)))
            for curve in (*curves, sum(curves))
        )
        # Rounding of the table's coefficients, of the size of the curve, in 32 pairs a column.
        np.testing.assert_allclose(both, first + second, atol=1e-12)
        assert np.abs(second).max() > 1e-3


def test_two_pole_pitches_of_spin_give_the_same_torque(actuator):
    for q in random_poses(10):
        turned = q + [0, 0, np.radians(90)]
        # Rounding of pi/2 in the cosines, magnified by the look-up's slope.
        np.testing.assert_allclose(torque_matrix(turned, actuator), torque_matrix(q, actuator), atol=1e-12)


def test_one_pole_pitch_of_spin_reverses_the_torque(actuator):
    for q in random_poses(10):
        turned = q + [0, 0, np.radians(45)]
        np.testing.assert_allclose(torque_matrix(turned, actuator), -torque_matrix(q, actuator), atol=1e-12)


def test_mirror_about_the_equator_mirrors_the_torque(actuator):
    # The mirror z -> -z maps poles and coils onto themselves and a tilt (alpha, beta) to its negative.
    # Torque is an axial vector: its x and y parts change sign, z stays.
    mirrored_axes = actuator.group_axes * [1, 1, -1]
    match = actuator.group_axes @ mirrored_axes.T
    group = np.argmax(np.abs(match), axis=1)  # the group that each group's mirror image is
    assert np.allclose(np.abs(match[np.arange(18), group]), 1, atol=1e-12)
    for q in random_poses(10):
        G = torque_matrix(q, actuator)
        mirrored = torque_matrix(q * [-1, -1, 1], actuator)
        np.testing.assert_allclose(mirrored, np.diag([-1, -1, 1]) @ G[:, group], atol=1e-12)


def test_positive_current_attracts_a_positive_pole(actuator):
    # Turn a positive pole of the upper layer to an azimuth a little short of its nearest upper coil, and
    # ask for the torque of that coil's group alone: it must pull the pole the rest of the way.
    positive = next(i for i, p in enumerate(actuator.pole_polarity) if p > 0 and actuator.pole_axes[i, 2] > 0)
    azimuth = np.arctan2(actuator.pole_axes[positive, 1], actuator.pole_axes[positive, 0])
    upper = next(j for j, (a, _) in enumerate(actuator.groups) if actuator.coil_axes[a, 2] > 0.1)
    s = actuator.group_axes[upper]
    short = np.radians(8)
    q = np.array([0.0, 0.0, np.arctan2(s[1], s[0]) - azimuth - short])
    assert torque_matrix(q, actuator)[2, upper] > 0.1 * actuator.torque_curve.peak_Nm_per_A
    q[2] += 2 * short
    assert torque_matrix(q, actuator)[2, upper] < -0.1 * actuator.torque_curve.peak_Nm_per_A


def test_the_two_coils_of_a_group_add(actuator):
    # Poles are aligned across the layers, so opposite poles are alike: each coil gives half the column.
    q = np.array([0.2, -0.1, 0.4])
    R_SR = rotation(q)
    curve = actuator.torque_curve
    for group, (a, b) in enumerate(actuator.groups):
        halves = []
        for s in (actuator.coil_axes[a], actuator.coil_axes[b]):
            r = actuator.pole_axes @ R_SR.T
            pull = actuator.pole_polarity * curve.over_sine(r @ s)
            halves.append(np.cross(pull @ r, s))
        tolerance = SUMMED * curve.peak_Nm_per_A
        np.testing.assert_allclose(halves[0], halves[1], atol=1e-12)
        np.testing.assert_allclose(torque_matrix(q, actuator)[:, group], 2 * halves[0], atol=tolerance)


def test_opposite_poles_share_one_line(actuator):
    model = torque_model(actuator)
    assert model.line_axes.shape == (8, 3)
    assert sorted(model.line_weights) == [-2] * 4 + [2] * 4


def test_work_around_a_closed_path_is_zero(actuator):
    # With constant currents the torque has a potential: no work is left after a loop of the tilt.
    current = np.random.default_rng(2).normal(size=18)
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    work, power = 0.0, 0.0
    for a in angle:
        q = np.array([0.3 * np.cos(a), 0.2 * np.sin(a), 0.5 * np.cos(a)])
        qdot = np.array([-0.3 * np.sin(a), 0.2 * np.cos(a), -0.5 * np.sin(a)])
        share = (torque_matrix(q, actuator) @ current) @ (rate_jacobian(q) @ qdot) / len(angle)
        work, power = work + share, power + abs(share)
    # The trapezoidal rule on a closed smooth path converges faster than any power of the step; the curve
    # is a cubic spline, whose kinks leave a little.
    assert abs(work) < 1e-4 * power


def test_least_norm_torque_reaches_what_the_layout_was_chosen_for(actuator):
    # Worst direction at 8 A, sampled over azimuth and spin; searched elsewhere: 0.557, 0.418, 0.378 N·m.
    generator = np.random.default_rng(3)
    for tilt_deg, torque in ((12, 0.557), (20, 0.418), (30, 0.378)):
        worst = np.inf
        for _ in range(300):
            azimuth, spin = generator.uniform(0, 2 * np.pi, 2)
            tilt = np.radians(tilt_deg)
            alpha = -np.arcsin(np.sin(tilt) * np.sin(azimuth))
            beta = np.arcsin(np.clip(np.sin(tilt) * np.cos(azimuth), -1, 1))
            q = np.array([alpha, beta, spin])
            inverse = np.linalg.pinv(torque_matrix(q, actuator))  # (18, 3)
            worst = min(worst, 8 / np.linalg.norm(inverse, axis=1).max())
        assert worst > torque
