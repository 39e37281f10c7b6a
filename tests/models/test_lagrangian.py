"""The Lagrangian model against definitions and derivatives; the cross-check compares it with two engines."""

import numpy as np
import pytest

from spheretwin.models.kinematics import rotor_rate_jacobian, triple
from spheretwin.models.lagrangian import InertiaEntries, coriolis_matrix, inertia_matrix, solve_inertia


def random_states(count, seed=0):
    generator = np.random.default_rng(seed)
    tilt = np.radians(80)
    for _ in range(count):
        q = generator.uniform([-tilt, -tilt, -10], [tilt, tilt, 10])
        yield q, generator.uniform(-50, 50, 3)


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
        christoffel = 0.5 * (np.einsum("kij->ijk", dM) + np.einsum("jik->ijk", dM) - dM)
        expected = christoffel @ qdot
        # Central differences of products of inertias near 2e-3: h² and rounding over h, times 50 rad/s.
        np.testing.assert_allclose(coriolis_matrix(q, qdot, actuator.inertia), expected, atol=1e-10)


def test_solution_is_a_library_s_whatever_is_added_to_the_diagonal(actuator):
    generator = np.random.default_rng(3)
    for q, torque in random_states(200):
        M = inertia_matrix(q, actuator.inertia)
        M += np.diag(10 ** generator.uniform(-6, 0, 3) * generator.integers(0, 2, 3))
        entries = InertiaEntries(M[0, 0], M[1, 1], M[2, 2], M[0, 1], M[0, 2], 0.0)
        solution, expected = solve_inertia(entries, triple(torque), False), np.linalg.solve(M, torque)
        # Rounding of either, with a condition of 140 at the largest tilt.
        np.testing.assert_allclose(solution, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
