"""Torques that the hinges exert on each other, for any three inertias what (6) to (10) are for equal ones."""

from __future__ import annotations

import numpy as np

from spheretwin.viz.quantities.quantity import Array, Kept, Rows, by_axis


def values(rows: Rows) -> Array:
    """What of ``M qddot + C qdot`` is not an axis's own inertia, (n, 3) in N·m.

    The accelerations are those of the rates from tick to tick; the inertia is that of the rotor alone.
    """
    q, rate, t_s = rows.table["q_rad"], rows.table["qdot_rad_s"], rows.table["t_s"]
    step_s = np.diff(t_s, prepend=rows.before["t_s"])
    change = np.diff(rate, axis=0, prepend=rows.before["qdot_rad_s"])
    acceleration = change / np.where(step_s > 0, step_s, 1.0)[:, None]  # 0 at the first tick of a run
    return _inertial(q, acceleration, rows.actuator.inertia) + _coriolis(q, rate, rows.actuator.inertia)


def _inertial(q: Array, acceleration: Array, inertia: Array) -> Array:
    """Entries off the diagonal of M, times the accelerations."""
    J1, J2, J3 = inertia
    alpha_beta = (J1 - J2) * np.cos(q[:, 1]) * np.cos(q[:, 2]) * np.sin(q[:, 2])
    alpha_gamma = J3 * np.sin(q[:, 1])
    a, b, g = acceleration.T
    return np.stack([alpha_beta * b + alpha_gamma * g, alpha_beta * a, alpha_gamma * a], axis=1)


def _coriolis(q: Array, rate: Array, inertia: Array) -> Array:
    """Coriolis and centrifugal torques ``C qdot``: each product of rates once."""
    J1, J2, J3 = inertia
    cb, sb, cg, sg = np.cos(q[:, 1]), np.sin(q[:, 1]), np.cos(q[:, 2]), np.sin(q[:, 2])
    a, b, g = rate.T
    D = J1 - J2
    double_angle = D * cb * (cg**2 - sg**2)
    tilt = (J3 - J1 * cg**2 - J2 * sg**2) * sb * cb
    turn = D * sg * cg
    return np.stack(
        [
            2 * tilt * a * b - 2 * turn * cb**2 * a * g - turn * sb * b**2 + (double_angle + J3 * cb) * b * g,
            -tilt * a**2 + (double_angle - J3 * cb) * a * g + 2 * turn * b * g,
            turn * cb**2 * a**2 + (J3 * cb - double_angle) * a * b - turn * b**2,
        ],
        axis=1,
    )


COUPLING = by_axis(
    "coupling_torque_Nm",
    "N·m",
    "torques of the hinges on each other (6)-(10)",
    values,
    floor=0.005,
    kept=Kept.MEAN,  # accelerations from tick to tick are mostly the chatter of the command
)
