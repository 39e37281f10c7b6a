"""Trajectories of orientation: great circles and slerp as rotations, and what is refused near β = ±90°."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from spheretwin.models.base.errors import InputError
from spheretwin.models.kinematics import rate_jacobian, rotation
from spheretwin.trajectories.rotations import MINIMUM_JERK, GreatCircle
from spheretwin.trajectories.waypoints import Waypoints

HEADER = "t_s,alpha_rad,beta_rad,gamma_rad"
STEP = 1e-5


def written(path, t, poses):
    np.savetxt(path, np.column_stack([t, poses]), fmt="%.17g", delimiter=",", header=HEADER, comments="")
    return str(path)


@given(st.tuples(*[st.floats(-0.7, 0.7)] * 3), st.floats(0.0, 2 * np.pi))
def test_great_circle_turns_about_the_axis_of_the_stator(start, direction):
    axis = np.array([np.cos(direction), np.sin(direction), 0.5])
    shape = GreatCircle(middle_rad=start, axis=tuple(3 * axis), turn_rad=0.6, frequency_Hz=0.4)
    n, t = axis / np.linalg.norm(axis), np.linspace(0, 4, 41)
    for time, (q, qdot, _) in zip(t, shape.sample(t), strict=True):
        phase = 2 * np.pi * 0.4 * time
        turned = Rotation.from_rotvec(0.6 * np.sin(phase) * n).as_matrix() @ rotation(np.array(start))
        np.testing.assert_allclose(rotation(q), turned, atol=1e-13)
        velocity = 0.6 * 2 * np.pi * 0.4 * np.cos(phase) * n
        np.testing.assert_allclose(rate_jacobian(q) @ qdot, velocity, atol=1e-12)


def test_shaft_of_a_tilt_axis_follows_a_great_circle():
    q = GreatCircle(axis=(1.0, 2.0, 0.0)).sample(np.linspace(0, 2, 21))[:, 0]
    shafts = np.array([rotation(pose)[:, 2] for pose in q])
    np.testing.assert_allclose(shafts @ [1.0, 2.0, 0.0], 0.0, atol=1e-15)


def test_slerp_is_that_of_scipy_over_minimum_jerk(tmp_path):
    t, poses = np.array([0.5, 1.5, 2.0]), np.array([[0.1, -0.4, 3.0], [0.6, 1.1, 4.5], [-0.2, 0.3, 4.0]])
    shape = Waypoints(file=written(tmp_path / "poses.csv", t, poses), between="slerp")
    samples = shape.sample(t)
    np.testing.assert_allclose(samples[:, 0], poses, atol=1e-12)  # γ of the file, not within ±π
    np.testing.assert_allclose(samples[:, 1:], 0.0, atol=1e-10)
    slerp = Slerp(t, Rotation.from_matrix([rotation(q) for q in poses]))
    times, u = np.linspace(0.5, 1.5, 21), np.linspace(0, 1, 21)
    expected = slerp(0.5 + MINIMUM_JERK(u)).as_matrix()
    np.testing.assert_allclose([rotation(q) for q in shape.sample(times)[:, 0]], expected, atol=1e-12)
    before, now, after = (shape.sample(times[1:-1] + h) for h in (-STEP, 0, STEP))
    for row in (1, 2):
        # Central differences: h² of a third derivative of some thousand, and rounding over h.
        np.testing.assert_allclose(now[:, row], (after - before)[:, row - 1] / (2 * STEP), atol=2e-6)
    still = shape.sample(np.array([0.0, 7.0]))
    np.testing.assert_allclose(still[:, 0], poses[[0, -1]], atol=1e-12)
    np.testing.assert_array_equal(still[:, 1:], 0.0)


def test_peaks_are_those_of_the_hinges(tmp_path):
    """About the axis of one hinge a slerp is the minimum jerk of that hinge: rate 1.875 times the mean."""
    path = written(tmp_path / "poses.csv", [0, 2], [[0, 0, 0], [0, 0, 1.0]])
    rate, acceleration = Waypoints(file=path, between="slerp").peaks()
    np.testing.assert_allclose(
        [rate.value, rate.t_s, acceleration.value], [0.9375, 1.0, 10 / 3**0.5 / 4], rtol=1e-3
    )
    assert rate.axis == acceleration.axis == "gamma"
    with pytest.raises(InputError, match=r"expected a largest rate of 0.9 rad/s"):
        Waypoints(file=path, between="slerp", largest_rate_rad_s=0.9)


def test_a_path_through_the_locked_pose_is_refused():
    with pytest.raises(
        InputError, match=r"expected β within ±89.5°, received 89.9.° at 0.* s, where the hinges lock"
    ):
        GreatCircle(middle_rad=(0.0, 1.0, 0.0), axis=(0.0, 1.0, 0.0), turn_rad=1.0)
    GreatCircle(middle_rad=(0.0, 1.0, 0.0), axis=(0.0, 1.0, 0.0), turn_rad=0.56)


def test_a_path_on_which_a_hinge_would_jump_is_refused(tmp_path):
    """A whole turn of γ is no rotation."""
    path = written(tmp_path / "poses.csv", [0, 1], [[0, 0, 0], [0, 0, 2 * np.pi]])
    with pytest.raises(
        InputError, match=r"expected hinge angles without a jump, received one of 360° at 0.49"
    ):
        Waypoints(file=path, between="slerp")


def test_axis_other_than_0():
    with pytest.raises(ValueError, match="expected an axis other than 0, received 0"):
        GreatCircle(axis=(0.0, 0.0, 0.0))
