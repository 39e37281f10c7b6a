"""Forward and inverse dynamics of the nominal rotor."""

from typing import NamedTuple

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, compiled
from spheretwin.models.kinematics import Triple, Turns, turns
from spheretwin.models.lagrangian import (
    InertiaEntries,
    acceleration_entries,
    coriolis_matrix,
    coriolis_rows,
    inertia_entries,
    inertia_matrix,
)

UPRIGHT = Turns(1.0, 0.0, 1.0, 0.0, 1.0, 0.0)
AT_REST = (0.0, 0.0, 0.0)


class RotorModel(NamedTuple):
    """Nominal rotor of a law."""

    inertia: Triple  # principal inertias, kg·m²
    coupled: bool
    """True if the axes are coupled; otherwise each is a double integrator of its own inertia."""


class RotorMotion(NamedTuple):
    """Angles and rates of the rotor."""

    angle: Triple  # rad
    rate: Triple  # rad/s


@allocation_free
def advance_motion(motion: RotorMotion, torque: Triple, nominal: RotorModel, time_s: float) -> RotorMotion:
    """Return the motion after some time (s) under a constant torque (N·m), with the initial acceleration."""
    at, rate = _operating_point(motion, nominal)
    push = acceleration_entries(at, rate, torque, nominal.inertia, 0.0)
    half = 0.5 * time_s * time_s
    (q1, q2, q3), (v1, v2, v3) = motion.angle, motion.rate
    angle = (
        q1 + time_s * v1 + half * push[0],
        q2 + time_s * v2 + half * push[1],
        q3 + time_s * v3 + half * push[2],
    )
    return RotorMotion(angle, (v1 + time_s * push[0], v2 + time_s * push[1], v3 + time_s * push[2]))


@allocation_free
def required_torque(motion: RotorMotion, acceleration: Triple, nominal: RotorModel) -> Triple:
    """Return the torque ``M a + C qdot`` (N·m) for an acceleration (rad/s²)."""
    at, rate = _operating_point(motion, nominal)
    C_alpha, C_beta, C_gamma = coriolis_rows(at, rate, nominal.inertia)
    alpha, beta, gamma = _times(inertia_entries(at, nominal.inertia), acceleration)
    return (
        alpha + C_alpha[0] * rate[0] + C_alpha[1] * rate[1] + C_alpha[2] * rate[2],
        beta + C_beta[0] * rate[0] + C_beta[1] * rate[1] + C_beta[2] * rate[2],
        gamma + C_gamma[0] * rate[0] + C_gamma[1] * rate[1] + C_gamma[2] * rate[2],
    )


@allocation_free
def inertial_torque(angle: Triple, acceleration: Triple, nominal: RotorModel) -> Triple:
    """Return the torque ``M a`` (N·m), without Coriolis terms."""
    at, _ = _operating_point(RotorMotion(angle, AT_REST), nominal)
    return _times(inertia_entries(at, nominal.inertia), acceleration)


@allocation_free
def _operating_point(motion: RotorMotion, nominal: RotorModel) -> tuple[Turns, Triple]:
    """Return pose and rates for the equations of motion; upright and at rest, the axes are not coupled."""
    if nominal.coupled:
        return turns(motion.angle), motion.rate
    return UPRIGHT, AT_REST


@allocation_free
def _times(M: InertiaEntries, x: Triple) -> Triple:
    return (
        M.alpha * x[0] + M.alpha_beta * x[1] + M.alpha_gamma * x[2],
        M.alpha_beta * x[0] + M.beta * x[1],
        M.alpha_gamma * x[0] + M.gamma * x[2],
    )


@compiled
def model_torque(measurement: Array, acceleration: Array, rate: Array, inertia: Array, torque: Array) -> None:
    """Write the torque ``M acceleration + C rate`` at the measured pose and rates.

    Parameters
    ----------
    measurement : (3, 3) array
        Angle and rate as the first rows, as a law receives it.
    acceleration, rate : (3,) array, rad/s² and rad/s
        Factors of M and C.
    inertia : (3,) array, kg·m²
        Nominal principal inertias.
    torque : (3,) array, N·m
        Result.
    """
    M, C = inertia_matrix(measurement[0], inertia), coriolis_matrix(measurement[0], measurement[1], inertia)
    for i in range(3):
        torque[i] = 0.0
        for j in range(3):
            torque[i] += M[i, j] * acceleration[j] + C[i, j] * rate[j]
