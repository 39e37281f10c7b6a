"""The Lagrangian model against definitions, derivatives, conservation laws and two other engines."""

import mujoco
import numpy as np
import pinocchio
import pytest
from scipy.integrate import solve_ivp

from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.kinematics import rate_jacobian, rotation, rotor_rate_jacobian, triple
from spheretwin.models.lagrangian import InertiaEntries, coriolis_matrix, inertia_matrix, solve_inertia


def random_states(count, seed=0):
    generator = np.random.default_rng(seed)
    tilt = np.radians(80)
    for _ in range(count):
        q = generator.uniform([-tilt, -tilt, -10], [tilt, tilt, 10])
        yield q, generator.uniform(-50, 50, 3)


def inertia_rate(q, qdot, inertia, h=1e-6):
    return (inertia_matrix(q + h * qdot, inertia) - inertia_matrix(q - h * qdot, inertia)) / (2 * h)


def test_inertia_matrix_is_the_kinetic_energy_of_the_rotor(actuator):
    for q, qdot in random_states(100):
        w_SR_R = rotor_rate_jacobian(q) @ qdot
        energy = 0.5 * w_SR_R @ (actuator.inertia * w_SR_R)
        # Two ways of summing the same squares: rounding only.
        assert 0.5 * qdot @ inertia_matrix(q, actuator.inertia) @ qdot == pytest.approx(energy, rel=1e-13)


def test_coriolis_matrix_has_the_christoffel_symbols_of_the_inertia_matrix(actuator):
    h = 1e-5
    for q, qdot in random_states(50):
        steps = h * np.eye(3)
        dM = np.stack(
            [inertia_matrix(q + d, actuator.inertia) - inertia_matrix(q - d, actuator.inertia) for d in steps]
        ) / (2 * h)  # dM[k] = dM/dq_k
        christoffel = 0.5 * (
            np.einsum("kij->ijk", dM) + np.einsum("jik->ijk", dM) - np.einsum("ijk->ijk", dM)
        )
        expected = christoffel @ qdot
        # Central differences of products of inertias near 2e-3: h² and rounding over h, times 50 rad/s.
        np.testing.assert_allclose(coriolis_matrix(q, qdot, actuator.inertia), expected, atol=1e-10)


def test_inertia_rate_less_twice_coriolis_is_skew_symmetric(actuator):
    for q, qdot in random_states(100):
        skew = inertia_rate(q, qdot, actuator.inertia) - 2 * coriolis_matrix(q, qdot, actuator.inertia)
        # The derivative is numeric: h² |qdot|³ times inertia, 1e-12 * 1e5 * 2e-3.
        np.testing.assert_allclose(skew, -skew.T, atol=1e-8)


def test_equal_inertias_leave_only_the_gyroscopic_coupling(actuator):
    J = 2.2e-3
    for q, qdot in random_states(20):
        a_rate, b_rate, c_rate = qdot
        sb, cb = np.sin(q[1]), np.cos(q[1])
        coupling = J * cb * np.array([b_rate * c_rate, -a_rate * c_rate, a_rate * b_rate])  # (3)-(5)
        bias = coriolis_matrix(q, qdot, np.full(3, J)) @ qdot
        np.testing.assert_allclose(bias, coupling, atol=1e-13)
        M = inertia_matrix(q, np.full(3, J))
        np.testing.assert_allclose(M, J * np.array([[1, 0, sb], [0, 1, 0], [sb, 0, 1]]), atol=1e-16)


def torque_free(inertia, q, qdot, duration):
    def flow(_, state):
        q, qdot = state[:3], state[3:]
        bias = coriolis_matrix(q, qdot, inertia) @ qdot
        return np.concatenate([qdot, np.linalg.solve(inertia_matrix(q, inertia), -bias)])

    state = np.concatenate([q, qdot])
    return solve_ivp(flow, (0, duration), state, method="DOP853", rtol=1e-12, atol=1e-12).y.T


def test_torque_free_rotor_keeps_its_energy_and_angular_momentum(actuator):
    states = torque_free(actuator.inertia, np.array([0.1, -0.2, 0.0]), np.array([0.5, 0.3, 2 * np.pi]), 5.0)
    energies, momenta = [], []
    for state in states:
        q, qdot = state[:3], state[3:]
        w_SR_R = rotor_rate_jacobian(q) @ qdot
        energies.append(0.5 * w_SR_R @ (actuator.inertia * w_SR_R))
        momenta.append(rotation(q) @ (actuator.inertia * w_SR_R))
    # The integrator's tolerance of 1e-12 a step, over some hundred steps.
    np.testing.assert_allclose(energies, energies[0], rtol=1e-9)
    np.testing.assert_allclose(
        momenta, np.tile(momenta[0], (len(momenta), 1)), atol=1e-9 * np.linalg.norm(momenta[0])
    )


def test_axisymmetric_rotor_precesses_as_euler_found():
    # With J1 = J2 the body rates turn about the symmetry axis at (J3 - J1)/J1 * w3, exactly.
    inertia = np.array([2.2e-3, 2.2e-3, 2.6e-3])
    q, qdot, duration = np.array([0.05, 0.1, 0.3]), np.array([0.8, -0.4, 9.0]), 2.0
    w = rotor_rate_jacobian(q) @ qdot
    angle = (inertia[2] - inertia[0]) / inertia[0] * w[2] * duration
    expected = [
        w[0] * np.cos(angle) - w[1] * np.sin(angle),
        w[0] * np.sin(angle) + w[1] * np.cos(angle),
        w[2],
    ]
    end = torque_free(inertia, q, qdot, duration)[-1]
    np.testing.assert_allclose(rotor_rate_jacobian(end[:3]) @ end[3:], expected, atol=1e-9)


@pytest.fixture(scope="module")
def engine():
    model = mjcf.read(actuators.MJCF_PATH).described
    return model, mujoco.MjData(model)


def test_mujoco_has_the_same_inertia_matrix_and_bias(actuator, engine):
    model, data = engine
    M = np.empty((3, 3))
    for q, qdot in random_states(500):
        data.qpos[:], data.qvel[:] = q, qdot
        mujoco.mj_forward(model, data)
        for i, column in enumerate(np.eye(3)):
            mujoco.mj_mulM(model, data, M[i], column)
        expected = inertia_matrix(q, actuator.inertia)
        # The rings of the joint weigh 5e-13 of the rotor; the rest is rounding.
        np.testing.assert_allclose(M, expected, atol=1e-12 * expected.max())
        bias = coriolis_matrix(q, qdot, actuator.inertia) @ qdot
        np.testing.assert_allclose(data.qfrc_bias, bias, atol=1e-12 * max(np.abs(bias).max(), 1))


def test_pinocchio_has_the_same_inertia_matrix_and_bias(actuator):
    model = pinocchio.buildModelFromMJCF(str(actuators.MJCF_PATH))
    data = model.createData()
    for q, qdot in random_states(100):
        configuration = q if model.nq == 3 else np.array([q[0], q[1], np.cos(q[2]), np.sin(q[2])])
        M = pinocchio.crba(model, data, configuration)
        expected = inertia_matrix(q, actuator.inertia)
        np.testing.assert_allclose(np.triu(M), np.triu(expected), atol=1e-12 * expected.max())
        bias = pinocchio.nonLinearEffects(model, data, configuration, qdot)
        expected = coriolis_matrix(q, qdot, actuator.inertia) @ qdot
        np.testing.assert_allclose(bias, expected, atol=1e-12 * max(np.abs(expected).max(), 1))


def test_rate_jacobian_and_inertia_lose_rank_together(actuator):
    # det E = cos(beta) and det M = J1 J2 J3 cos²(beta): the joint locks at 90 degrees, nowhere else.
    q = np.array([0.3, 1.2, -0.7])
    assert np.linalg.det(rate_jacobian(q)) == pytest.approx(np.cos(q[1]), rel=1e-13)
    determinant = np.linalg.det(inertia_matrix(q, actuator.inertia))
    assert determinant == pytest.approx(np.prod(actuator.inertia) * np.cos(q[1]) ** 2, rel=1e-12)


def test_solution_is_a_library_s_whatever_is_added_to_the_diagonal(actuator):
    generator = np.random.default_rng(3)
    for q, torque in random_states(200):
        M = inertia_matrix(q, actuator.inertia)
        M += np.diag(10 ** generator.uniform(-6, 0, 3) * generator.integers(0, 2, 3))
        entries = InertiaEntries(M[0, 0], M[1, 1], M[2, 2], M[0, 1], M[0, 2], 0.0)
        solution, expected = solve_inertia(entries, triple(torque), None), np.linalg.solve(M, torque)
        # Rounding of either, with a condition of 140 at the largest tilt.
        np.testing.assert_allclose(solution, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
