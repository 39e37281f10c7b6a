"""Currents to torque on the hinges about a pose, and torques asked for to currents."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.kinematics import rate_jacobian, rotation
from spheretwin.twin.linear.knowledge import Knowledge, Magnetics

Array = NDArray[np.float64]

# Of fourth-order differences: with a tenth of it slopes differ by 3e-10 of the largest, with ten times it by
# 6e-7, as the steps then reach over knots of the curve's spline.
DIFFERENCE_rad = 1e-4


class Actuation(NamedTuple):
    """Torque of the coils on the hinges about a pose, where currents of n groups hold the rotor."""

    of_currents: Array
    """(3, n) N·m/A: the torque of one ampere."""
    of_commands: Array
    """(3, 3): the torque that one N·m asked for leads to; the unit matrix where nothing is mistaken."""
    holding_torque_Nm: Array
    """(3,): the command that holds the rotor."""
    holding_current_A: Array
    """(n,): the currents that answer it."""
    stiffness_of_currents: Array
    """(3, 3) N·m/rad: how their torque changes with the pose while they stay the same."""
    stiffness_of_commands: Array
    """(3, 3) N·m/rad: how it does while the command stays and the allocation follows the pose."""


def actuation(known: Knowledge, q: Array, held_Nm: Array) -> Actuation:
    """Actuation about a pose.

    Parameters
    ----------
    known : Knowledge
    q : (3,) array, rad
        Pose.
    held_Nm : (3,) array, N·m
        Torque on the hinges that the coils hold there.
    """
    own, own_slopes = hinge_matrix(q, known.magnetics), slopes(q, known.magnetics)
    believed = hinge_matrix(q, known.believed)
    inverse = np.asarray(np.linalg.pinv(believed), np.float64)
    mistaken = not _same(known.magnetics, known.believed)
    of_commands = own @ inverse if mistaken else np.eye(3)
    command = np.asarray(np.linalg.solve(of_commands, held_Nm), np.float64)
    current = inverse @ command
    stiffness = np.column_stack([each @ current for each in own_slopes])
    turning = np.zeros((3, 3))
    if mistaken:
        follows = [
            _inverse_slope(believed, inverse, each) @ command for each in slopes(q, known.believed)
        ]  # (n,) each, A/rad
        turning = stiffness + own @ np.column_stack(follows)
    return Actuation(own, of_commands, command, current, stiffness, turning)


def hinge_matrix(q: Array, magnetics: Magnetics) -> Array:
    """Torque on the hinges of one ampere in each group, ``E^T G_t(q)`` times the gains; (3, n) in N·m/A.

    From the torque curve itself: the table of the compiled torque matrix meets it within 2e-7 of its peak,
    but has no slopes of use.
    """
    actuator = magnetics.actuator
    return rate_jacobian(q).T @ _torque_matrix(q, actuator) * magnetics.gain


def slopes(q: Array, magnetics: Magnetics) -> Array:
    """Derivatives of `hinge_matrix` by the three angles; (3, 3, n), the first index the angle."""

    def moved(angle: int, steps: int) -> Array:
        return hinge_matrix(q + steps * DIFFERENCE_rad * np.eye(3)[angle], magnetics)

    return np.array(
        [
            (8 * (moved(i, 1) - moved(i, -1)) - (moved(i, 2) - moved(i, -2))) / (12 * DIFFERENCE_rad)
            for i in range(3)
        ]
    )


def _torque_matrix(q: Array, actuator: Actuator) -> Array:
    """G_t(q) (15) as a sum over every pole and the two coils of every group."""
    poles, axes = actuator.pole_axes @ rotation(q).T, actuator.group_axes  # (p, 3), (n, 3)
    cosine = poles @ axes.T
    curve = actuator.torque_curve
    pull = curve.over_sine(cosine) - curve.over_sine(-cosine)  # of both coils, along r x s
    crossed = np.cross(poles[:, None], axes[None])  # (p, n, 3)
    return np.einsum("p,pn,pnk->kn", actuator.pole_polarity, pull, crossed)


def _inverse_slope(matrix: Array, inverse: Array, slope: Array) -> Array:
    """Derivative of the least-norm inverse of a matrix whose rows are independent."""
    across = np.eye(matrix.shape[1]) - inverse @ matrix
    return -inverse @ slope @ inverse + across @ slope.T @ inverse.T @ inverse


def _same(first: Magnetics, second: Magnetics) -> bool:
    return first.actuator is second.actuator and bool(np.all(first.gain == second.gain))
