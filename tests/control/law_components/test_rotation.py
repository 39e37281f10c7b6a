"""Rotation error against rotation matrices, and its invariance under a common rotation."""

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from spheretwin.control.law_components.rotation import (
    pose_quaternion,
    rotated,
    rotation_error,
    rotor_motion,
    write_torque,
)
from spheretwin.models.kinematics import rotation, rotor_rate_jacobian

ANGLE = st.floats(-7.0, 7.0)
VECTOR = st.tuples(*[st.floats(-5.0, 5.0)] * 3).map(np.array)
POSE = st.tuples(ANGLE, ANGLE, ANGLE).map(np.array)
# Products of a dozen sines, and numbers up to some hundred: rounding.
ROUNDING = {"rtol": 0, "atol": 1e-12}


def matrix_of(quaternion):
    return np.column_stack([rotated(quaternion, tuple(axis)) for axis in np.eye(3)])


def rows(q, qdot, qddot):
    return np.array([q, qdot, qddot])


@given(POSE)
def test_quaternion_of_a_pose_is_its_rotation(q):
    np.testing.assert_allclose(matrix_of(pose_quaternion(tuple(q))), rotation(q), **ROUNDING)


@given(POSE, VECTOR, VECTOR)
def test_velocity_is_that_of_the_jacobian_and_acceleration_its_rate(q, qdot, qddot):
    velocity, acceleration = rotor_motion(tuple(q), tuple(qdot), tuple(qddot))
    np.testing.assert_allclose(velocity, rotor_rate_jacobian(q) @ qdot, **ROUNDING)
    h = 1e-5
    later, earlier = (
        rotor_rate_jacobian(q + s * qdot + 0.5 * s**2 * qddot) @ (qdot + s * qddot) for s in (h, -h)
    )
    # Central difference: h²/6 of a third derivative of some thousands, and rounding over h.
    np.testing.assert_allclose(acceleration, (later - earlier) / (2 * h), rtol=0, atol=1e-6)


@given(POSE, VECTOR, VECTOR, POSE, VECTOR)
def test_errors_are_those_of_the_matrices(q_d, qdot_d, qddot_d, q, qdot):
    error = rotation_error(rows(q_d, qdot_d, qddot_d), rows(q, qdot, 0 * q))
    R, R_d = rotation(q), rotation(q_d)
    eta, epsilon = error.quaternion.scalar, np.array(error.quaternion.vector)
    assert eta >= 0
    np.testing.assert_allclose(eta**2 + epsilon @ epsilon, 1, **ROUNDING)
    skew = 0.5 * (R_d.T @ R - R.T @ R_d)
    np.testing.assert_allclose(2 * eta * epsilon, [skew[2, 1], skew[0, 2], skew[1, 0]], **ROUNDING)
    velocity, velocity_d = rotor_rate_jacobian(q) @ qdot, rotor_rate_jacobian(q_d) @ qdot_d
    np.testing.assert_allclose(error.velocity, velocity, **ROUNDING)
    np.testing.assert_allclose(error.rate, velocity - R.T @ R_d @ velocity_d, **ROUNDING)
    _, acceleration_d = rotor_motion(tuple(q_d), tuple(qdot_d), tuple(qddot_d))
    carried = R.T @ R_d @ velocity_d
    expected = R.T @ R_d @ np.array(acceleration_d) - np.cross(velocity, carried)
    np.testing.assert_allclose(error.acceleration, expected, rtol=0, atol=1e-10)


def turned_by(A, q, qdot, qddot):
    """Return the hinge motion of a rotor that is turned by A in the stator frame."""
    q_A = Rotation.from_matrix(A @ rotation(q)).as_euler("XYZ")
    assume(abs(np.cos(q_A[1])) > 0.1)
    B = rotor_rate_jacobian(q_A)
    velocity, acceleration = rotor_motion(tuple(q), tuple(qdot), tuple(qddot))
    qdot_A = np.linalg.solve(B, velocity)
    _, left = rotor_motion(tuple(q_A), tuple(qdot_A), (0.0, 0.0, 0.0))
    return rows(q_A, qdot_A, np.linalg.solve(B, np.subtract(acceleration, left)))


@given(POSE, VECTOR, VECTOR, POSE, VECTOR, POSE)
def test_a_common_rotation_leaves_the_errors_as_they_are(q_d, qdot_d, qddot_d, q, qdot, turn):
    reference, measurement = rows(q_d, qdot_d, qddot_d), rows(q, qdot, 0 * q)
    A = rotation(turn)
    error = rotation_error(reference, measurement)
    assume(error.quaternion.scalar > 1e-3)  # else the shorter way is known to rounding only
    other = rotation_error(turned_by(A, *reference), turned_by(A, *measurement))
    for name in ("quaternion", "rate", "acceleration"):
        ours, theirs = (
            np.hstack([np.atleast_1d(part) for part in getattr(each, name)]) for each in (error, other)
        )
        # Rates of hinges are up to 10 times those of the rotor, accelerations 100 times.
        np.testing.assert_allclose(theirs, ours, rtol=1e-9, atol=1e-9)
    first, second = np.zeros(3), np.zeros(3)
    write_torque(error, (1.0, 2.0, 3.0), (2e-3, 3e-3, 4e-3), first)
    write_torque(other, (1.0, 2.0, 3.0), (2e-3, 3e-3, 4e-3), second)
    np.testing.assert_allclose(second, A @ first, rtol=1e-9, atol=1e-11)
