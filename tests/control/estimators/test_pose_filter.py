"""Pose filter on readings of simulated arrays."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spheretwin.control.estimators.pose_filter import fill_field, turn
from spheretwin.models.base.compiled import uncompiled
from spheretwin.models.kinematics import rotation
from spheretwin.models.stator_field import field_of_poles
from tests.twin.electronics.hall_cases import ACTUATOR, PERIOD_s, array_of, at_rest, estimates

RADIUS_m = 0.085


def random_pose(rng):
    return rng.uniform([-1.2, -1.2, -0.7], [1.2, 1.2, 0.7])


def field_at(hall, R):
    readings = len(hall.reading_T)
    result, slopes = np.empty(readings), np.empty((readings, 3))
    fill_field(hall.geometry, hall.poles[:], hall.strength[:], R, result, slopes)
    return result, slopes


def test_field_at_the_readings_is_the_series():
    hall = array_of(count=10, axes="three")[0][0]
    R = rotation(np.array([0.3, -0.5, 0.2]))
    expected = np.sum(
        field_of_poles(ACTUATOR, RADIUS_m * hall.geometry.points, R) * hall.geometry.axes, axis=1
    )
    # The table misses 3e-8 of the peak of each of sixteen poles.
    assert field_at(hall, R)[0] == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def test_slopes_are_those_of_the_field():
    hall, step = array_of(count=10, axes="three")[0][0], 1e-5
    R = rotation(np.array([-0.4, 0.6, 0.1]))
    slopes = field_at(hall, R)[1]
    for axis in range(3):
        ahead, behind = (
            field_at(hall, Rotation.from_rotvec(s * step * np.eye(3)[axis]).as_matrix() @ R)[0]
            for s in (1, -1)
        )
        # Slopes of cubics through 512 intervals: third order, some 1e-5.
        assert slopes[:, axis] == pytest.approx(
            (ahead - behind) / (2 * step), abs=1e-4 * np.abs(slopes).max()
        )


@pytest.mark.uncompiled
@pytest.mark.parametrize("vector", [(0.3, -1.2, 2.0), (1e-9, 0, 2e-9), (0, 0, 0)])
def test_turn_is_the_rotation_by_a_vector(vector):
    R = rotation(np.array([0.3, 0.2, -0.9]))
    expected = Rotation.from_rotvec(vector).as_matrix() @ R
    uncompiled(turn)(R, *vector)
    assert pytest.approx(expected, abs=1e-15) == R


def test_poses_are_found_without_a_prior_and_with_any_currents():
    rng = np.random.default_rng(5)
    for _ in range(25):
        q, current_A = random_pose(rng), rng.uniform(-8, 8, len(ACTUATOR.groups))
        result = estimates(array_of(count=16), at_rest(q, 20), current_A=current_A)
        assert result[0] == pytest.approx(q, abs=2e-3)  # damped steps stop short
        assert result[-1] == pytest.approx(q, abs=1e-5)  # the table


def test_gamma_is_the_one_next_to_the_start_and_the_poles_allow_no_other_knowledge():
    q = np.array([0.2, -0.3, 0.4])
    turned = q + [0, 0, np.pi / 2]
    near, far = (array_of(count=16, start_rad=(0.0, 0.0, gamma)) for gamma in (0.0, 2.0))
    assert estimates(near, at_rest(turned, 5))[-1] == pytest.approx(q, abs=1e-4)
    assert estimates(far, at_rest(turned, 5))[-1] == pytest.approx(turned, abs=1e-4)


def test_gamma_counts_turns():
    t = PERIOD_s * np.arange(1000)
    poses = np.stack([0.3 * np.sin(8 * t), 0.2 * np.sin(5 * t), 15 * t], axis=1)
    result = estimates(array_of(count=16, noise_T=2e-5), poses)
    assert np.abs(result[50:] - poses[50:]).max() < 5e-3
    assert poses[-1, 2] > 2 * np.pi


def test_errors_have_the_covariance_of_the_filter():
    rng, share = np.random.default_rng(2), []
    for seed in range(60):
        q = random_pose(rng)
        array = array_of(count=12, noise_T=5e-5, acceleration_density_rad2_s3=1e-6)
        result = estimates(array, at_rest(q, 200), seed=seed)[-1]
        error = Rotation.from_matrix(rotation(q) @ rotation(result).T).as_rotvec()
        share.append(error @ np.linalg.solve(array[0][0].pose.P[:3, :3], error))
    # Chi-squared of 3 degrees of freedom: the mean of 60 has a deviation of sqrt(6 / 60).
    assert np.mean(share) == pytest.approx(3, abs=3 * np.sqrt(6 / 60))


def test_remanence_is_estimated_if_it_is_uncertain():
    q, poses = np.array([0.4, 0.5, -0.2]), at_rest([0.4, 0.5, -0.2], 200)
    hot = array_of(count=16, remanence_error=0.1)
    result = estimates(hot, poses, remanence=0.93)[-1]
    assert result == pytest.approx(q, abs=1e-4)
    assert hot[0][0].pose.remanence == pytest.approx(0.93, abs=1e-4)
    assert np.abs(estimates(array_of(count=16), poses, remanence=0.93)[-1] - q).max() > 1e-3


def test_field_of_the_coils_is_subtracted():
    q, current_A = np.array([0.4, 0.5, -0.2]), np.linspace(-2, 3, len(ACTUATOR.groups))
    poses = at_rest(q, 50)
    blind = array_of(count=16, subtracts_coils=False)
    assert estimates(array_of(count=16), poses, current_A=current_A)[-1] == pytest.approx(q, abs=1e-5)
    assert np.abs(estimates(blind, poses, current_A=current_A)[-1] - q).max() > 0.02
    measured_A = current_A + 0.1
    wrong = estimates(array_of(count=16), poses, current_A=current_A, measured_A=measured_A)[-1]
    assert np.abs(wrong - q).max() > 1e-4


def test_lost_pose_is_found_again_in_the_same_period_of_gamma():
    before, after = np.array([0.0, 0.0, 2.0]), np.array([0.7, -0.6, 2.4])
    array = array_of(count=16, start_rad=(0.0, 0.0, 2.0))
    result = estimates(array, np.concatenate([at_rest(before, 20), at_rest(after, 20)]))
    assert result[19] == pytest.approx(before, abs=1e-4)
    assert result[20] == pytest.approx(after, abs=2e-3)
    assert array[0][0].pose.searches == 2
