"""Super-twisting: its equations, finite reaching time and its Lyapunov function."""

from math import log, sqrt

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from spheretwin.control.laws.super_twisting import SuperTwisting
from spheretwin.models.lagrangian import coriolis_matrix, inertia_matrix
from tests.control.laws.cases import PERIOD, SlowIntegral, follows, known, on_an_axis


class Slow(SlowIntegral):
    """The law as its docstring has it, as matrices."""

    def __call__(self, reference, measurement):
        slope, k1, k2, mu = self.named("surface_slope", "root_gain", "twisting_gain", "linear_share")
        q, qdot, believed = measurement
        e_rate = qdot - reference[1]
        s = e_rate + slope * (q - reference[0])
        phi1 = np.sqrt(np.abs(s)) * np.sign(s) + mu * s
        phi2 = phi1 * (0.5 / np.sqrt(np.abs(s)) + mu)
        self.integral += PERIOD * slope / sqrt(3) * (believed - self.asked())
        torque = inertia_matrix(q, self.J) @ (reference[2] - slope * e_rate - k1 * phi1)
        torque += coriolis_matrix(q, qdot, self.J) @ qdot + self.integral
        self.integral -= PERIOD * self.J * k2 * phi2
        self.asked.all.append(torque)
        return torque, np.concatenate([s, self.integral])


@pytest.mark.parametrize("delay_s", [0.0, 2.25e-3])
def test_law_follows_its_equations(actuator, delay_s):
    gains = SuperTwisting(
        surface_slope=[40.0, 20.0, 60.0],
        root_gain=[10.0, 30.0, 5.0],
        twisting_gain=[25.0, 400.0, 100.0],
        linear_share=[8.0, 0.0, 2.0],
    )
    follows(gains.build(known(actuator, delay_s)), Slow(gains, actuator.inertia, delay_s))


def reached(gains, s, w):
    """V and the bound on the time to the surface of the docstring, from s (rad/s) and w (rad/s²)."""
    k1, k2, mu = gains.root_gain[1], gains.twisting_gain[1], gains.linear_share[1]
    root = sqrt(k2)
    P = solve_continuous_lyapunov(np.array([[-k1, root], [-root, 0]]).T, -np.eye(2))
    zeta = np.array([np.sqrt(np.abs(s)) * np.sign(s) + mu * s, w / root])
    V = np.einsum("i...,ij,j...->...", zeta, P, zeta)
    least, largest = np.linalg.eigvalsh(P)
    a, b = 0.5 * sqrt(least) / largest, mu / largest
    bound = 2 / b * log(1 + b / a * sqrt(V.flat[0])) if mu else 2 * sqrt(V.flat[0]) / a
    return V, bound


@pytest.mark.parametrize(
    ("k1", "k2", "mu", "load_Nm"),
    [(10.0, 60.0, 0.0, 0.0), (10.0, 60.0, 0.0, 0.02), (10.0, 25.0, 8.0, 0.05), (40.0, 900.0, 1.0, 0.05)],
)
def test_the_surface_is_reached_in_finite_time(actuator, k1, k2, mu, load_Nm):
    period_s, J = 1e-4, actuator.inertia
    gains = SuperTwisting(surface_slope=30.0, root_gain=k1, twisting_gain=k2, linear_share=mu)
    law = gains.build(known(actuator, period_s=period_s))
    _, bound = reached(gains, np.array(1.5), np.array(-load_Nm / J[1]))
    result = on_an_axis(law, J, (0.05, 0.0), 1.2 * bound, period_s, load_Nm)
    # What is logged of the integral has been moved on by its tick already: it belongs to the next s.
    s, w = result[1:, 2], (result[:-1, 3] - load_Nm) / J[1]
    V, _ = reached(gains, s, w)
    floor = (k1 * period_s / 2) ** 2
    # Within what a period does, which the docstring says; twice it, as the integral turns s round too.
    assert np.abs(s[round(bound / period_s) :]).max() < 2 * floor
    last_away = np.flatnonzero(np.abs(s) > 1000 * floor)[-1]
    assert 0.1 * bound < last_away * period_s < bound  # the bound is one, and not an idle one
    assert np.all(np.diff(V[:last_away]) < 0)
