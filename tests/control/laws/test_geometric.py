"""Geometric laws: exact error dynamics on the Lagrangian rotor, orders near the origin, the singular pose."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from spheretwin.control.law_components.rotation import rotation_error, rotor_motion
from spheretwin.control.laws.geometric import GeometricPD, GeometricPID
from spheretwin.control.laws.pd import PD
from spheretwin.models.kinematics import generalised_torque, rotation
from spheretwin.models.lagrangian import acceleration
from tests.control.laws.cases import PERIOD, known

VECTOR = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)
POSE = st.tuples(st.floats(-3.0, 3.0), st.floats(-1.3, 1.3), st.floats(-3.0, 3.0)).map(np.array)


def rows(q, qdot, qddot=(0.0, 0.0, 0.0)):
    return np.array([q, qdot, qddot])


def torque_of(law, reference, measurement):
    """Return the first Cartesian torque of a law."""
    torque = np.empty(3)
    law.step(0.0, reference, measurement, law.parameters, law.state.copy(), torque)
    return torque


def hinge_acceleration(actuator, q, qdot, torque_S):
    torque_q = np.empty(3)
    generalised_torque(q, torque_S, torque_q)
    return acceleration(q, qdot, torque_q, actuator.inertia, 0.0)


def turn(error):
    return 2 * error.quaternion.scalar * np.array(error.quaternion.vector)


@given(POSE, VECTOR, VECTOR, POSE, VECTOR)
def test_error_dynamics_are_exact_on_the_true_rotor(actuator, q_d, qdot_d, qddot_d, q, qdot):
    """The rotor of the Lagrangian model, on its hinges, has e_Ω' = −stiffness e_R − damping e_Ω."""
    law = GeometricPD(rotation_stiffness=7.0, rotation_damping=3.0)
    reference, measurement = rows(q_d, qdot_d, qddot_d), rows(q, qdot)
    error = rotation_error(reference, measurement)
    torque_S = torque_of(law.build(known(actuator)), reference, measurement)
    qddot = hinge_acceleration(actuator, q, qdot, torque_S)
    _, turned = rotor_motion(tuple(q), tuple(qdot), tuple(qddot))
    # Hinge accelerations are up to some thousand rad/s² near ±74°: rounding.
    expected = -7.0 * turn(error) - 3.0 * np.array(error.rate)
    np.testing.assert_allclose(np.subtract(turned, error.acceleration), expected, rtol=0, atol=1e-9)


def test_energy_falls_by_the_damping_alone(actuator):
    """V = stiffness (1 − cos θ) + ½ |e_Ω|² and the dissipated energy add up to a constant."""
    law = GeometricPD(rotation_stiffness=100.0, rotation_damping=5.0).build(known(actuator))

    def reference_at(t):
        amplitude, w = np.array([0.5, 0.9, 2.0]), np.array([3.0, 2.0, 1.0])
        return rows(
            amplitude * np.sin(w * t), amplitude * w * np.cos(w * t), -amplitude * w**2 * np.sin(w * t)
        )

    def slope(t, x):
        measurement, reference = rows(x[:3], x[3:6]), reference_at(t)
        rate = np.array(rotation_error(reference, measurement).rate)
        torque_S = torque_of(law, reference, measurement)
        return np.hstack([x[3:6], hinge_acceleration(actuator, x[:3], x[3:6], torque_S), 5.0 * rate @ rate])

    def energy(t, x):
        error = rotation_error(reference_at(t), rows(x[:3], x[3:6]))
        cosine = 0.5 * (np.trace(rotation(reference_at(t)[0]).T @ rotation(x[:3])) - 1)
        return 100.0 * (1 - cosine) + 0.5 * np.dot(error.rate, error.rate)

    start = np.array([0.8, -0.6, 1.5, 0.0, 0.0, 0.0, 0.0])
    solved = solve_ivp(slope, (0, 1), start, rtol=1e-9, atol=1e-10, t_eval=[0.0, 0.25, 0.5, 1.0])
    energies = np.array([energy(t, x) for t, x in zip(solved.t, solved.y.T, strict=True)])
    assert energies[-1] < 0.1 * energies[0]
    # The integrator's tolerance, a thousand steps.
    np.testing.assert_allclose(energies + solved.y[6], energies[0], rtol=1e-6)


def test_the_linearised_error_dynamics_are_left_in_the_third_order(actuator):
    """About one axis θ'' = −k sin θ − c θ': the distance to the linear solution is of order three in θ."""
    k, c, angles, end = 100.0, 8.0, np.array([0.1, 0.2, 0.4]), 0.2
    law = GeometricPD(rotation_stiffness=k, rotation_damping=c).build(known(actuator))

    def final(angle):
        def slope(t, x):
            q, qdot = np.array([0.0, 0.0, x[0]]), np.array([0.0, 0.0, x[1]])
            return [x[1], torque_of(law, np.zeros((3, 3)), rows(q, qdot))[2] / actuator.inertia[2]]

        return solve_ivp(slope, (0, end), [angle, 0.0], rtol=1e-10, atol=1e-12).y[0, -1]

    w = np.sqrt(k - c**2 / 4)
    linear = np.exp(-c / 2 * end) * (np.cos(w * end) + c / 2 / w * np.sin(w * end))
    distances = np.array([abs(final(angle) - linear * angle) for angle in angles])
    orders = np.log2(distances[1:] / distances[:-1])
    np.testing.assert_allclose(orders, 3, atol=0.15)  # the next term is of order five: θ²/20 of it


def test_near_the_origin_it_is_pd_to_first_order(actuator):
    ours = GeometricPD(rotation_stiffness=300.0, rotation_damping=30.0).build(known(actuator))
    theirs = PD(stiffness=[300.0] * 3, damping=[30.0] * 3).build(known(actuator))
    generator = np.random.default_rng(1)
    reference, measurement = generator.normal(size=(2, 3, 3))
    reference[2] = 0.0

    def distance(size):
        inputs = size * reference, size * measurement
        return np.linalg.norm(torque_of(ours, *inputs) - torque_of(theirs, *inputs))

    sizes = np.array([4e-3, 2e-3, 1e-3])
    distances = np.array([distance(size) for size in sizes])
    # Of second order; the next term adds the size of the angles.
    np.testing.assert_allclose(np.log2(distances[:-1] / distances[1:]), 2, atol=0.05)


@pytest.mark.parametrize("kind", [GeometricPD, GeometricPID])
def test_torque_does_not_grow_at_the_singular_pose(actuator, kind):
    """A hinge law's torque in the stator frame grows as 1/cos β there."""
    law, offset = kind().build(known(actuator)), np.array([0.01, -0.02, 0.015])
    sizes = []
    for beta in np.radians([0.0, 45.0, 80.0, 89.0, 89.99, 90.0]):
        q = np.array([0.4, beta, -0.7])
        torque = torque_of(law, rows(q, np.zeros(3)), rows(q + offset, np.zeros(3)))
        sizes.append(np.linalg.norm(torque))
    # |e_R| is at most the sum of the hinges' errors.
    assert max(sizes) <= law.parameters[0] * actuator.inertia.max() * np.abs(offset).sum()


def test_the_integral_stays_in_the_stator_frame_and_within_its_limit(actuator):
    law = GeometricPID(integral_limit_Nm=0.05).build(known(actuator))
    state, torque = law.state.copy(), np.empty(3)
    q_d, q = np.array([0.3, -0.5, 0.9]), np.array([0.31, -0.52, 0.92])
    error = rotation_error(rows(q_d, np.zeros(3)), rows(q, np.zeros(3)))
    growth = -PERIOD * law.parameters[2] * rotation(q) @ (actuator.inertia * turn(error))
    for _ in range(3):
        law.step(0.0, rows(q_d, np.zeros(3)), rows(q, np.zeros(3)), law.parameters, state, torque)
    np.testing.assert_allclose(state[3:], 3 * growth, rtol=1e-9)
    np.testing.assert_allclose(state[:3], turn(error), rtol=1e-12)
    without = torque.copy()
    law.step(0.0, rows(q_d, np.zeros(3)), rows(q, np.zeros(3)), law.parameters, state, torque)
    np.testing.assert_allclose(torque - without, growth, rtol=1e-6)  # the integral enters one tick later
    for _ in range(4000):
        law.step(0.0, rows(q_d, np.zeros(3)), rows(q, np.zeros(3)), law.parameters, state, torque)
    np.testing.assert_array_equal(state[3:], 0.05 * np.sign(growth))
