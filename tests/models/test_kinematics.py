"""Rotation and rate Jacobians against scipy and each other; the cross-check compares them with MuJoCo."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from spheretwin.models import kinematics

TILT = np.radians(80)
poses = st.tuples(
    st.floats(-TILT, TILT), st.floats(-TILT, TILT), st.floats(-40.0, 40.0)
).map(np.array)  # fmt: skip
vectors = st.tuples(*[st.floats(-10, 10)] * 3).map(np.array)

# Products of a few sines and cosines: a handful of roundings.
ROUNDING = 1e-14


@given(poses)
def test_rotation_is_the_intrinsic_xyz_rotation_of_scipy(q):
    assert_allclose(kinematics.rotation(q), Rotation.from_euler("XYZ", q).as_matrix(), atol=ROUNDING)


@pytest.mark.parametrize("pose", [(0.3, -1.2, 31.0), (0.3, -1.2, 3e7), (-2e5, 0.1, 1e15)])
def test_turns_are_those_of_the_library_from_any_turn_on(pose):
    cosines, sines = np.cos(pose), np.sin(pose)
    expected = np.column_stack([cosines, sines]).ravel()
    assert_allclose(kinematics.turns(pose), expected, rtol=0, atol=4e-16)


@given(poses)
def test_rotor_jacobian_is_the_stator_jacobian_seen_from_the_rotor(q):
    R_SR = kinematics.rotation(q)
    assert_allclose(kinematics.rotor_rate_jacobian(q), R_SR.T @ kinematics.rate_jacobian(q), atol=ROUNDING)


@given(poses, vectors)
def test_rate_jacobian_gives_the_rotation_s_derivative(q, qdot):
    h = 1e-6
    rate = (kinematics.rotation(q + h * qdot) - kinematics.rotation(q - h * qdot)) / (2 * h)
    spin = rate @ kinematics.rotation(q).T  # skew matrix of w_SR_S
    w_SR_S = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    # Central differences: h² times a third derivative (|qdot|³ < 6e3), plus rounding over h.
    assert_allclose(w_SR_S, kinematics.rate_jacobian(q) @ qdot, atol=1e-8)


@given(poses, vectors)
def test_cartesian_torque_does_the_same_work_as_the_generalised_one(q, torque_q):
    torque_S = np.empty(3)
    kinematics.cartesian_torque(q, torque_q, torque_S)
    # E^T recovers the generalised torque; at 80 degrees 1/cos(beta) magnifies rounding sixfold.
    assert_allclose(kinematics.rate_jacobian(q).T @ torque_S, torque_q, atol=1e-13)
