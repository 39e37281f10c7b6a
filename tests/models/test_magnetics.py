"""The torque matrix against the paper's sum, and against what the arrangement's symmetries demand."""

import numpy as np
import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models.base.vectors import cubic
from spheretwin.models.kinematics import rotation
from spheretwin.models.magnetics import (
    Arrangement,
    fill_torque_matrix,
    lookup_table,
    place,
    scratch_of,
    torque_matrix,
    torque_model,
)
from tests.models.poses import SECOND, random_poses, work_around_a_closed_path

# The look-up stays within 1e-6 of the curve's peak a pole and coil; a column sums 16 poles and two coils.
LOOKUP = 1e-6
SUMMED = 32 * LOOKUP


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
    # At the last pose the first pole's axis is turned onto the first coil of the middle layer.
    facing = np.array([0.0, np.arcsin(actuator.pole_axes[0, 2]), 0.0])
    middle = next(s for s in actuator.coil_axes if abs(s[2]) < 1e-9)
    assert np.allclose(rotation(facing) @ actuator.pole_axes[0], middle, atol=1e-12)
    tolerance = SUMMED * actuator.torque_curve.peak_Nm_per_A
    for q in [*random_poses(20), facing]:
        np.testing.assert_allclose(torque_matrix(q, actuator), papers_sum(q, actuator), atol=tolerance)


@pytest.mark.parametrize("groups", [1, 2, 3, 4, 5, 7, 8, 17])
def test_columns_are_the_same_for_any_number_of_groups(actuator, groups):
    complete = torque_model(actuator)
    rows = Arrangement.zeros(**complete.sizes | {"groups": groups, "pairs": 8 * groups})
    for name in ("line_axes", "line_weights"):
        rows[name] = complete.arrangement[name]
    rows["group_axes"] = complete.arrangement["group_axes"][:, :, :groups]
    some, tables, scratch = rows[0], complete.tables, scratch_of(complete)
    G, around = np.empty((3, groups)), np.full((5, groups), 7.0)
    for q in random_poses(5):
        fill_torque_matrix(q, some, tables, G, scratch)
        fill_torque_matrix(q, some, tables, around[1:4], scratch)
        np.testing.assert_array_equal(G, torque_matrix(q, actuator)[:, :groups])
        np.testing.assert_array_equal(around, np.vstack([np.full(groups, 7.0), G, np.full(groups, 7.0)]))


def test_lookup_goes_on_beyond_its_ends(actuator):
    """The cosine of a pole in front of a coil, or behind it, may round past 1."""
    curve, eps = torque_model(actuator).tables.curve, np.finfo(float).eps
    peak = actuator.torque_curve.peak_Nm_per_A
    for end in (-1.0, 1.0):
        inside, at, beyond = (cubic(curve, place(end * (1 + step * eps))) for step in (-64, 0, 4))
        assert abs(at - inside) < 1e-9 * peak
        assert abs(beyond - at) < 1e-9 * peak


def test_one_pole_pitch_of_spin_reverses_the_torque(actuator):
    for q in random_poses(10):
        turned = q + [0, 0, np.radians(45)]
        np.testing.assert_allclose(torque_matrix(turned, actuator), -torque_matrix(q, actuator), atol=1e-12)


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


@pytest.mark.parametrize("path", [actuators.MJCF_PATH, SECOND], ids=["curve", "field"])
def test_constant_currents_do_no_work_around_a_closed_path(path):
    # With constant currents the torque has a potential: no work is left after a loop of the tilt.
    actuator = actuators.load(path)
    work, power = work_around_a_closed_path(lambda q: torque_matrix(q, actuator), len(actuator.groups))
    # The trapezoidal rule on a closed smooth path converges faster than any power of the step; the curve
    # is a cubic spline, whose kinks leave a little. The spline of the field is within 4e-5 of a potential.
    assert abs(work) < 1e-4 * power
