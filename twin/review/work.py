"""The work that the coils do on the rotor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.table import Table

Array = NDArray[np.float64]


def mechanical_work_J(table: Table, period_s: float) -> float | None:
    """Work of the coils' torque over a run, ∫ T·ω dt, J; None without a row.

    Torque and rates are those at the ticks, held from each to the next.

    Parameters
    ----------
    table : Table
        Telemetry.
    period_s : float
        Control period, s.
    """
    if not len(table):
        return None
    power_W = np.einsum("ij,ij->i", table["torque_Nm"], angular_velocity(table["q_rad"], table["qdot_rad_s"]))
    return float(power_W.sum() * period_s)


def angular_velocity(q: Array, qdot: Array) -> Array:
    """Angular velocity of the rotor ``w_SR_S = E(q) qdot``, (n, 3) in rad/s, for many rows at once.

    Parameters
    ----------
    q, qdot : (n, 3) array, rad and rad/s
        Hinge angles and their rates.
    """
    (sa, sb, _), (ca, cb, _) = np.sin(q).T, np.cos(q).T
    da, db, dg = qdot.T
    return np.stack([da + sb * dg, ca * db - sa * cb * dg, sa * db + ca * cb * dg], axis=1)
