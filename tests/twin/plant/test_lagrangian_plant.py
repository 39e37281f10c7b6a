"""The Lagrangian as a plant: its payload from energies, its steps of order four, one loop for both plants."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from spheretwin.models import lagrangian
from spheretwin.models.base.compiled import compiled
from spheretwin.models.lagrangian import acceleration, coriolis_matrix, gravity_torque, inertia_matrix
from spheretwin.plant import lagrangian_rotor
from tests.twin.plant.allocations import allocates_nothing
from tests.twin.plant.motions import gradient, ideal_rotor, kinetic_J, order, potential_J

STEP_S, PAYLOAD_KG = 5e-4, 0.05


def states(count, seed=1):
    generator = np.random.default_rng(seed)
    for _ in range(count):
        q = generator.uniform([-1.4, -1.4, -3], [1.4, 1.4, 3])
        yield q, generator.uniform(-5, 5, 3), generator.uniform(-50, 50, 3)


def test_the_inertia_matrix_has_the_kinetic_energy_of_rotor_and_payload(actuator):
    """Its Coriolis matrix belongs to it: tests/models/test_lagrangian.py."""
    rotor = ideal_rotor(actuator, STEP_S, payload_kg=PAYLOAD_KG)
    for q, qdot, _ in states(20):
        energy = 0.5 * qdot @ inertia_matrix(q, rotor.joint[0].inertia) @ qdot
        assert energy == pytest.approx(kinetic_J(q, qdot, actuator, PAYLOAD_KG), rel=1e-12)


@pytest.mark.parametrize("gravity_m_s2", [9.81, 1.62, 0.0, -9.81])
def test_payload_weighs_what_gravity_makes_of_it(actuator, gravity_m_s2):
    rotor = ideal_rotor(actuator, STEP_S, payload_kg=PAYLOAD_KG, gravity_m_s2=gravity_m_s2)
    for q, _, _ in states(20):
        expected = gradient(lambda pose: potential_J(pose, actuator, PAYLOAD_KG, gravity_m_s2), q)
        np.testing.assert_allclose(gravity_torque(q, rotor.joint[0].weight_moment), expected, atol=1e-12)
    earth = ideal_rotor(actuator, STEP_S, payload_kg=PAYLOAD_KG)
    np.testing.assert_array_equal(rotor.joint["inertia"], earth.joint["inertia"])
    plant = rotor.start(np.array([0.1, 0.0, 0.0]), np.zeros(3))
    lagrangian_rotor.step(plant)
    assert np.sign(plant.qdot[0]) == np.sign(gravity_m_s2)  # a tilted shaft falls to where gravity pulls


def test_acceleration_solves_the_equation_of_motion(actuator):
    for q, qdot, torque in states(200):
        qddot = acceleration(q, qdot, torque, actuator.inertia, 0.05)
        M, C = inertia_matrix(q, actuator.inertia), coriolis_matrix(q, qdot, actuator.inertia)
        size = np.linalg.norm(M) * np.linalg.norm(qddot) + np.linalg.norm(torque)
        left_over = M @ qddot + C @ qdot + gravity_torque(q, 0.05) - torque
        # Backward error of an elimination without growth: rounding alone.
        assert np.linalg.norm(left_over) < 1e-15 * size


def test_coupling_torques_are_the_paper_s():
    q, qdot, qddot, J = np.array([0.0, np.pi / 6, 0.4]), np.array([1.0, 2.0, 3.0]), np.full(3, 10.0), 2.0
    inertial, coriolis = lagrangian.coupling_torques(q, qdot, qddot, J)
    np.testing.assert_allclose(inertial, [10, 0, 10])  # (6), (9)
    np.testing.assert_allclose(coriolis, np.sqrt(3) * np.array([6, -3, 2]))  # (7), (8), (10)


def end_of_steps(actuator, step_s, duration, torque_q):
    plant = ideal_rotor(actuator, step_s, payload_kg=PAYLOAD_KG).start(START[:3], START[3:])
    plant.torque_q[:] = torque_q
    for _ in range(round(duration / step_s)):
        lagrangian_rotor.step(plant)
    return np.concatenate([plant.q, plant.qdot])


START = np.array([0.2, -0.3, 0.5, 3.0, -2.0, 20.0])


def test_steps_are_of_order_four(actuator):
    duration, torque_q = 0.08, np.array([0.15, -0.1, -0.05])
    joint = ideal_rotor(actuator, STEP_S, payload_kg=PAYLOAD_KG).joint[0]

    def flow(_, state):
        q, qdot = state[:3].copy(), state[3:].copy()
        return np.concatenate([qdot, acceleration(q, qdot, torque_q, joint.inertia, joint.weight_moment)])

    exact = solve_ivp(flow, (0, duration), START, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    steps = np.array([8e-3, 4e-3, 2e-3, 1e-3, 5e-4])
    errors = [np.abs(end_of_steps(actuator, h, duration, torque_q) - exact).max() for h in steps]
    assert 3.8 < order(steps, errors) < 4.2, errors


@compiled
def step_first(rotors):
    lagrangian_rotor.step(rotors[0])


def test_a_step_allocates_nothing(actuator):
    rotor = ideal_rotor(actuator, STEP_S, payload_kg=PAYLOAD_KG)
    rotor.start(START[:3], START[3:])
    assert allocates_nothing(step_first, rotor.rows)


def test_start_does_not_hold_on_to_its_arguments(actuator):
    pose = np.zeros(3)
    plant = ideal_rotor(actuator, STEP_S).start(pose, np.array([1.0, 0.0, 0.0]))
    lagrangian_rotor.step(plant)
    np.testing.assert_array_equal(pose, 0)
