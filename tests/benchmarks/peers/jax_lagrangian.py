"""The rotor in JAX: the equations of motion with Runge-Kutta steps of order four, on scalars."""

from jax_loop import turns
from problem import Problem

NAME = "JAX, Lagrangian"


class Rotor:
    """Three hinges, three principal inertias."""

    def __init__(self, problem: Problem) -> None:
        self._step_s = problem.step_s

    def start(self, q, inertia):
        still = 0.0 * inertia[0]
        return q, (still,) * 3, tuple(inertia)

    def pose(self, state):
        return state[0], state[1]

    def step(self, state, torque_q):
        """One step with a constant torque on the hinges."""
        h, (q1, v1, inertia) = self._step_s, state
        a1 = acceleration(q1, v1, torque_q, inertia)
        q2, v2 = moved(q1, 0.5 * h, v1), moved(v1, 0.5 * h, a1)
        a2 = acceleration(q2, v2, torque_q, inertia)
        q3, v3 = moved(q1, 0.5 * h, v2), moved(v1, 0.5 * h, a2)
        a3 = acceleration(q3, v3, torque_q, inertia)
        q4, v4 = moved(q1, h, v3), moved(v1, h, a3)
        a4 = acceleration(q4, v4, torque_q, inertia)
        return moved(q1, h, mean(v1, v2, v3, v4)), moved(v1, h, mean(a1, a2, a3, a4)), inertia


def moved(start, time, rate):
    return tuple(a + time * b for a, b in zip(start, rate, strict=True))


def mean(*stages):
    return tuple((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(*stages, strict=True))


def acceleration(q, qdot, torque_q, inertia):
    """``M**-1 (torque - C qdot)``, C in Christoffel form, M eliminated from its last row upward."""
    _, _, cb, sb, cg, sg = turns(q)
    (J1, J2, J3), (alpha_rate, beta_rate, gamma_rate) = inertia, qdot
    D = J1 - J2
    D_double = D * cb * (cg**2 - sg**2)
    D_product = D * sg * cg
    tilt = (J3 - J1 * cg**2 - J2 * sg**2) * sb * cb
    plus, minus = 0.5 * (D_double + J3 * cb), 0.5 * (D_double - J3 * cb)
    # Products of two rates that occur twice in C are computed once.
    coriolis = (
        2 * alpha_rate * (tilt * beta_rate - D_product * cb**2 * gamma_rate)
        - D_product * sb * beta_rate**2
        + 2 * plus * beta_rate * gamma_rate,
        -tilt * alpha_rate**2 + 2 * gamma_rate * (minus * alpha_rate + D_product * beta_rate),
        D_product * (cb**2 * alpha_rate**2 - beta_rate**2) - 2 * minus * alpha_rate * beta_rate,
    )
    net = tuple(torque - other for torque, other in zip(torque_q, coriolis, strict=True))
    M_alpha, M_beta = (J1 * cg**2 + J2 * sg**2) * cb**2 + J3 * sb**2, J1 * sg**2 + J2 * cg**2
    alpha_beta, alpha_gamma = D_product * cb, J3 * sb
    to_beta, to_gamma = alpha_beta / M_beta, alpha_gamma / J3
    left = M_alpha - to_beta * alpha_beta - to_gamma * alpha_gamma
    alpha = (net[0] - to_beta * net[1] - to_gamma * net[2]) / left
    return alpha, net[1] / M_beta - to_beta * alpha, net[2] / J3 - to_gamma * alpha
