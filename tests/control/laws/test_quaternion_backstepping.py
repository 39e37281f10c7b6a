"""Quaternion backstepping: its Lyapunov function on the Lagrangian rotor, its poles, and its load."""

import numpy as np
from hypothesis import assume, given

from spheretwin.control.law_components.rotation import rotation_error, rotor_motion
from spheretwin.control.laws.quaternion_backstepping import QuaternionBackstepping
from spheretwin.models.kinematics import rotation
from tests.control.laws.cases import PERIOD, known
from tests.control.laws.test_geometric import POSE, VECTOR, hinge_acceleration, rows, torque_of

GAINS = {"angle_gain": 5.0, "coupling": 7.0, "rate_gain": 3.0}


def parts(error):
    return error.quaternion.scalar, np.array(error.quaternion.vector), np.array(error.rate)


@given(POSE, VECTOR, VECTOR, POSE, VECTOR)
def test_the_remainder_follows_its_equation_on_the_true_rotor(actuator, q_d, qdot_d, qddot_d, q, qdot):
    """z' = −k ε − h z, which gives V' = −k c |ε|² − h |z|², for the rotor on its hinges."""
    reference, measurement = rows(q_d, qdot_d, qddot_d), rows(q, qdot)
    error = rotation_error(reference, measurement)
    eta, epsilon, rate = parts(error)
    assume(eta > 1e-3)
    torque_S = torque_of(QuaternionBackstepping(**GAINS).build(known(actuator)), reference, measurement)
    qddot = hinge_acceleration(actuator, q, qdot, torque_S)
    _, turned = rotor_motion(tuple(q), tuple(qdot), tuple(qddot))
    growth = 0.5 * (eta * rate + np.cross(epsilon, rate))
    z = rate + 5.0 * epsilon
    z_rate = np.subtract(turned, error.acceleration) + 5.0 * growth
    np.testing.assert_allclose(z_rate, -7.0 * epsilon - 3.0 * z, rtol=0, atol=1e-9)


def test_the_load_is_learnt_in_the_stator_frame(actuator):
    """The growth of D cancels the load's term of V' for any inertia and pose, within the bound."""
    gains = QuaternionBackstepping(**GAINS, load_rate=11.0, load_limit_Nm=1e-3)
    law = gains.build(known(actuator))
    state, torque = law.state.copy(), np.empty(3)
    reference, measurement = rows([0.1, 0.2, 0.3], [1.0, 2.0, 3.0]), rows([0.5, -0.3, 0.9], [0.2, 0.1, -0.4])
    law.step(0.0, reference, measurement, law.parameters, state, torque)
    _, epsilon, rate = parts(rotation_error(reference, measurement))
    z, R, J = rate + 5.0 * epsilon, rotation(measurement[0]), actuator.inertia
    np.testing.assert_allclose(state[:3], z, rtol=1e-12)
    load_error = np.array([0.3, -0.2, 0.1])
    power = z @ (R.T @ load_error / J) * PERIOD
    np.testing.assert_allclose(load_error @ state[3:] / (11.0 * J.mean() ** 2), -power, rtol=1e-9)
    before = torque.copy()
    law.step(0.0, reference, measurement, law.parameters, state, torque)
    assert np.abs(torque - before).max() > 0  # D enters one tick later
    for _ in range(5000):
        law.step(0.0, reference, measurement, law.parameters, state, torque)
    np.testing.assert_array_equal(np.abs(state[3:]), 1e-3)


def test_the_default_is_a_triple_pole():
    gains = QuaternionBackstepping()
    c, k, h, rate = gains.angle_gain, gains.coupling, gains.rate_gain, gains.load_rate
    polynomial = [1, h + c / 2, (k + h * c) / 2 + rate, rate * c / 2]
    np.testing.assert_allclose(polynomial, np.poly([-h] * 3), rtol=1e-12)


def test_the_linear_loop_has_the_polynomial_of_the_docstring(actuator):
    """The matrix of one period of (γ, rate, D) near the origin, at a short period."""
    T, J = 1e-5, actuator.inertia.mean()
    gains = QuaternionBackstepping(**GAINS, load_rate=11.0, load_limit_Nm=1e9)
    law = gains.build(known(actuator, period_s=T)._replace(inertia=np.full(3, J)))
    columns = []
    for angle, rate, load in 1e-6 * np.eye(3):
        state, torque = law.state.copy(), np.empty(3)
        state[5] = J * load
        law.step(0.0, np.zeros((3, 3)), rows([0, 0, angle], [0, 0, rate]), law.parameters, state, torque)
        columns.append(np.array([angle + T * rate, rate + T * torque[2] / J, state[5] / J]) / 1e-6)
    polynomial = np.poly((np.transpose(columns) - np.eye(3)) / T)
    # Euler's rule at T: relative errors of the order of T times the poles.
    np.testing.assert_allclose(polynomial, [1, 5.5, 0.5 * (7 + 15) + 11, 11 * 2.5], rtol=1e-3)
