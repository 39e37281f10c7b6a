"""The nominal rotor's motion against the matrices of the equations of motion."""

import numpy as np
import pytest

from spheretwin.control.law_components.nominal_motion import (
    RotorModel,
    RotorMotion,
    advance_motion,
    inertial_torque,
    required_torque,
)
from spheretwin.models.lagrangian import coriolis_matrix, inertia_matrix

DRAWS = np.random.default_rng(0).normal(size=(20, 3, 3))
STEP_s = 1e-3


def motion_of(angle, rate):
    return RotorMotion(tuple(angle), tuple(rate))


@pytest.mark.parametrize(("q", "qdot", "x"), DRAWS)
def test_torque_is_that_of_the_matrices(actuator, q, qdot, x):
    nominal = RotorModel(tuple(actuator.inertia), True)
    inertial = inertia_matrix(q, actuator.inertia) @ x
    whole = inertial + coriolis_matrix(q, qdot, actuator.inertia) @ qdot
    # Sums of a dozen products of the order of an inertia, 2e-3 kg·m²: rounding.
    np.testing.assert_allclose(
        required_torque(motion_of(q, qdot), tuple(x), nominal), whole, rtol=0, atol=1e-16
    )
    np.testing.assert_allclose(inertial_torque(tuple(q), tuple(x), nominal), inertial, rtol=0, atol=1e-16)


@pytest.mark.parametrize(("q", "qdot", "x"), DRAWS)
def test_a_torque_moves_the_rotor_by_the_acceleration_it_is_for(actuator, q, qdot, x):
    nominal = RotorModel(tuple(actuator.inertia), True)
    motion = motion_of(q, qdot)
    angle, rate = advance_motion(motion, required_torque(motion, tuple(x), nominal), nominal, STEP_s)
    # M is inverted on the way: its condition, up to some hundred near beta = 90 degrees, times rounding.
    np.testing.assert_allclose(rate, qdot + STEP_s * x, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(angle, q + STEP_s * qdot + 0.5 * STEP_s**2 * x, rtol=1e-12, atol=1e-15)


def test_without_coupling_each_axis_has_its_own_inertia(actuator):
    nominal = RotorModel(tuple(actuator.inertia), False)
    motion = motion_of([0.5, -0.7, 0.9], [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(
        required_torque(motion, (1.0, 2.0, 3.0), nominal), actuator.inertia * [1, 2, 3]
    )
