"""Torque matrix: from 18 group currents to the torque on the rotor (12)-(15)."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.compiled import compiled
from spheretwin.models.kinematics import rotation
from spheretwin.models.torque_curve import TorqueCurve

# The look-up's intervals: wide where |cos phi| is below the knee, narrow above it, where f_t rises and falls
# (phi below 18 degrees). 780 intervals (25 kB) hold the spline to 3e-7 of its peak; equal intervals would
# need 8192 of them (262 kB), which falls out of the first-level cache.
KNEE = 0.95
WIDE_PER_UNIT = 200
NARROW_PER_UNIT = 4000


class TorqueModel(NamedTuple):
    """What the compiled torque matrix needs, and no more.

    The two coils of a group have axes s and -s, so a pole axis r enters a group's column as
    ``h(r.s) r x s`` with the odd function ``h(c) = g(c) - g(-c)``, ``g = f_t / sin``. Because h is
    odd, the poles at r and -r add: 16 poles are 8 *pole lines*, each with the sum of the two polarities
    as its weight. 144 look-ups give what 576 pairs of coil and pole would.
    """

    line_axes: NDArray[np.float64]  # (n_lines, 3), rotor frame
    line_weights: NDArray[np.float64]  # (n_lines,)
    group_axes: NDArray[np.float64]  # (3, 18), stator frame
    table: NDArray[np.float64]  # (781, 4), cubic coefficients of h, N·m/A


def torque_matrix(q: NDArray[np.float64], actuator: Actuator) -> NDArray[np.float64]:
    """Torque matrix G_t(q): ``torque_S = G_t(q) @ current`` (15).

    Parameters
    ----------
    q : (3,) array, rad
        Pose.
    actuator : Actuator
        Poles, coils, groups and torque curve.

    Returns
    -------
    (3, 18) array, N·m/A
        Column j is the stator-frame torque of one ampere in group j.
    """
    G = np.empty((3, len(actuator.groups)))
    fill_torque_matrix(np.asarray(q, dtype=np.float64), torque_model(actuator), G)
    return G


@lru_cache(maxsize=8)
def torque_model(actuator: Actuator) -> TorqueModel:
    """Compile-ready form of an actuator's magnetics, kept for the actuators used last."""
    axes, weights = _pole_lines(actuator)
    return TorqueModel(
        line_axes=axes,
        line_weights=weights,
        group_axes=np.ascontiguousarray(actuator.group_axes.T),
        table=lookup_table(actuator.torque_curve),
    )


def lookup_table(curve: TorqueCurve) -> NDArray[np.float64]:
    """Cubics for ``h(c) = g(c) - g(-c)`` on intervals of c from -1 to 1; `place` finds a cosine's row.

    Each cubic meets h at four Chebyshev points of its interval. The last row repeats the end of the one
    before it: the cosine of a pole straight in front of a coil may round past 1.

    Returns
    -------
    (n + 1, 4) array, N·m/A
        Coefficients of 1, t, t², t³ with t from 0 to 1 within an interval.
    """
    narrow = round((1 - KNEE) * NARROW_PER_UNIT)
    wide = round(2 * KNEE * WIDE_PER_UNIT)
    below, middle = np.linspace(-1, -KNEE, narrow + 1), np.linspace(-KNEE, KNEE, wide + 1)
    edges = np.concatenate([below[:-1], middle, -below[-2::-1]])  # (n + 1,)
    t = 0.5 - 0.5 * np.cos((2 * np.arange(4) + 1) * np.pi / 8)  # (4,)
    c = edges[:-1, None] + np.diff(edges)[:, None] * t  # (n, 4)
    h = curve.over_sine(c) - curve.over_sine(-c)
    table = np.linalg.solve(np.vander(t, increasing=True), h.T).T  # (n, 4)
    beyond = [[table[-1].sum(), 0.0, 0.0, 0.0]]
    return np.ascontiguousarray(np.concatenate([table, beyond]))


@compiled
def place(cosine: float) -> float:
    """Row of a cosine in the look-up table, the fraction being t: two slopes, joined at the knee."""
    beyond = cosine - min(max(cosine, -KNEE), KNEE)
    centre = KNEE * WIDE_PER_UNIT + (1 - KNEE) * NARROW_PER_UNIT
    return centre + WIDE_PER_UNIT * cosine + (NARROW_PER_UNIT - WIDE_PER_UNIT) * beyond


@compiled
def fill_torque_matrix(q: NDArray[np.float64], model: TorqueModel, G: NDArray[np.float64]) -> None:
    """Compiled torque matrix, written into `G` (3, 18), N·m/A.

    `g(cos phi)` is looked up, never `f_t(phi)`: no arc cosine, and no singular case where a pole
    stands in front of a coil. About 0.4 µs for 18 groups and 16 poles: halved twice by the pairs of
    opposite coils and opposite poles (see `TorqueModel`), and the groups lie innermost and
    contiguous, so that the compiler works on several at once.
    """
    R_SR = rotation(q)
    axes, table = model.group_axes, model.table
    groups = axes.shape[1]
    G[:] = 0.0
    for line in range(model.line_axes.shape[0]):
        r, weight = model.line_axes[line], model.line_weights[line]
        x = R_SR[0, 0] * r[0] + R_SR[0, 1] * r[1] + R_SR[0, 2] * r[2]
        y = R_SR[1, 0] * r[0] + R_SR[1, 1] * r[1] + R_SR[1, 2] * r[2]
        z = R_SR[2, 0] * r[0] + R_SR[2, 1] * r[1] + R_SR[2, 2] * r[2]
        for j in range(groups):
            cosine = x * axes[0, j] + y * axes[1, j] + z * axes[2, j]
            row = place(cosine)
            i = np.uint32(row)  # unsigned, so that no check for an index below 0 is compiled in
            t = row - i
            h = table[i, 0] + t * (table[i, 1] + t * (table[i, 2] + t * table[i, 3]))
            G[0, j] += weight * h * x
            G[1, j] += weight * h * y
            G[2, j] += weight * h * z
    for j in range(groups):
        x, y, z = G[0, j], G[1, j], G[2, j]
        G[0, j] = y * axes[2, j] - z * axes[1, j]
        G[1, j] = z * axes[0, j] - x * axes[2, j]
        G[2, j] = x * axes[1, j] - y * axes[0, j]


def _pole_lines(actuator: Actuator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Merge opposite poles; the sum of their polarities is the line's weight."""
    axes: list[NDArray[np.float64]] = []
    weights: list[float] = []
    for axis, polarity in zip(actuator.pole_axes, actuator.pole_polarity, strict=True):
        for known, other in enumerate(axes):
            if np.allclose(axis, -other, rtol=0.0, atol=1e-12):
                weights[known] += polarity
                break
        else:
            axes.append(axis)
            weights.append(polarity)
    return np.ascontiguousarray(axes), np.array(weights)
