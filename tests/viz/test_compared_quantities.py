"""Quantities of compared runs against the definitions of a rotation and of virtual power."""

import numpy as np
import pytest

from spheretwin.models.kinematics import generalised_torque, rotation
from spheretwin.viz.quantities import angle_between, on_the_hinges

RANDOM = np.random.default_rng(0)


def test_the_whole_error_is_the_angle_of_the_rotation_between():
    q, q_ref = RANDOM.uniform(-1.2, 1.2, size=(2, 200, 3))
    for result, pose, wanted in zip(angle_between(q, q_ref), q, q_ref, strict=True):
        R = rotation(pose).T @ rotation(wanted)
        # The trace loses half of the digits near 0 and π, where none of these are.
        assert result == pytest.approx(np.arccos((np.trace(R) - 1) / 2), abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.1, 3.0, np.pi])
def test_a_turn_about_one_axis_is_its_own_error_to_the_last_digits(angle):
    for axis in range(3):
        turned = np.zeros((1, 3))
        turned[0, axis] = angle
        # Of quaternions of size 1, some units in the last place of 1; near π the sine is flat.
        assert angle_between(turned, np.zeros((1, 3)))[0] == pytest.approx(angle, abs=1e-15, rel=1e-7)


def test_a_whole_turn_is_no_error():
    q = RANDOM.uniform(-1, 1, size=(20, 3))
    np.testing.assert_allclose(angle_between(q + [0, 0, 2 * np.pi], q), 0, atol=1e-14)


def test_torque_on_the_hinges_is_that_of_the_model():
    q, torque_S = RANDOM.uniform(-1, 1, size=(2, 50, 3))
    expected = np.empty((50, 3))
    for pose, torque, row in zip(q, torque_S, expected, strict=True):
        generalised_torque(pose, torque, row)
    # Sums of three products up to 1.
    np.testing.assert_allclose(on_the_hinges(q, torque_S), expected, rtol=0, atol=1e-15)
