"""The laws in JAX: PD without memory, AFSM with all consequents of an axis at once."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from problem import Problem

CENTRES = np.array([-3.0, -1.5, 0.0, 1.5, 3.0])


class Pd:
    """``-stiffness e - damping edot``, as an acceleration."""

    def __init__(self, problem: Problem) -> None:
        self._stiffness = problem.nominal_inertia * problem.law["stiffness"]
        self._damping = problem.nominal_inertia * problem.law["damping"]

    def start(self):
        return ()

    def step(self, memory, error, error_rate, q, qdot):
        torque = (
            -(stiffness * e + damping * rate)
            for stiffness, damping, e, rate in zip(
                self._stiffness, self._damping, error, error_rate, strict=True
            )
        )
        return tuple(torque), memory


class Estimates(NamedTuple):
    """Estimates of AFSM."""

    theta: Any  # (3, 75)
    xi: Any  # (3,)
    zeta: Any  # (3,)


class Afsm:
    """Equations (40)-(43) on all three axes at once, 75 consequents each."""

    def __init__(self, problem: Problem) -> None:
        self._gains, self._inertia, self._period_s = problem.law, problem.nominal_inertia, problem.period_s

    def start(self):
        return Estimates(jnp.zeros((3, 75)), jnp.zeros(3), jnp.zeros(3))

    def step(self, memory, error, error_rate, q, qdot):
        gains, (theta, xi, zeta) = self._gains, memory
        angle, rate = jnp.stack(q), jnp.stack(qdot)
        s = gains["surface_slope"] * jnp.stack(error) + jnp.stack(error_rate)
        bound = 1 + jnp.abs(s) + s**2
        psi = (memberships(rate)[:, :, None] * memberships(angle)[:, None, :]).reshape(3, 25)
        regressor = jnp.concatenate([psi, psi * rate[:, None], psi * angle[:, None]], axis=1)  # (3, 75)
        fuzzy = jnp.sum(theta * regressor, axis=1)
        v = fuzzy - jnp.sign(s) * (xi + zeta * bound) - gains["reaching_gain"] * s
        grown = self._period_s * jnp.abs(s)
        adapted = Estimates(
            theta - (gains["fuzzy_rate"] * self._period_s * s)[:, None] * regressor,
            xi + gains["switching_rate"] * grown,
            zeta + gains["bound_rate"] * grown * bound,
        )
        return tuple(self._inertia * v), adapted


def memberships(x):
    """Degrees of membership in the five sets, (3, 5), normalised."""
    exponent = -0.125 * (x[:, None] - CENTRES) ** 2
    degrees = jnp.exp(exponent - jnp.max(exponent, axis=1, keepdims=True))
    return degrees / jnp.sum(degrees, axis=1, keepdims=True)


LAWS = {"pd": Pd, "afsm": Afsm}
