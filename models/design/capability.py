"""Torque capability of the actuator in a pose: worst direction, within the current limit."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import compiled
from spheretwin.models.coil_group import of_each_group
from spheretwin.models.magnetics import TorqueModel, fill_torque_matrix, scratch_of, torque_model

# A direction whose singular value is below this share of the largest one counts as lost: a millionth of
# the torque for the same current is rounding and model error.
LOST = 1e-6

# Two columns span a facet if the sine of their angle is above this; below, its direction is rounding.
PARALLEL = 1e-9

# Poses evaluated at once: their matrices stay in the cache of the processor.
BLOCK = 4096


class Capability(NamedTuple):
    """Figures of n poses; "worst" is over all directions of the torque."""

    singular_value_Nm_per_A: Array  # (n,), the smallest: torque per ampere of the current vector's norm
    condition: Array  # (n,), largest singular value over smallest; infinite if a direction is lost
    weak_direction: Array  # (n, 3), unit vector, stator frame, of the smallest singular value
    copper_W_per_Nm2: Array  # (n,), heat per torque squared in that direction, least possible
    least_norm_Nm: Array  # (n,), worst torque that least-norm currents (16) reach at the limit
    least_norm_direction: Array  # (n, 3), of that torque
    best_Nm: Array  # (n,), worst torque that any currents within the limit reach
    best_direction: Array  # (n, 3), of that torque

    def at(self, index: Any) -> Capability:
        """Return the figures of some poses."""
        return Capability(*(figures[index] for figures in self))

    def reshaped(self, shape: tuple[int, ...]) -> Capability:
        """Return the figures in the shape of a grid."""
        return Capability(*(figures.reshape(*shape, *figures.shape[1:]) for figures in self))


def capability(q: Array, actuator: Actuator, track: Callable[[range], Iterable[int]] = iter) -> Capability:
    """Return the torque capability of poses.

    Parameters
    ----------
    q : (n, 3) array, rad
        Poses.
    actuator : Actuator
        Magnetics, current limit and resistance.
    track : callable
        Iterates over the numbers of the blocks of poses, and may show progress.

    Notes
    -----
    Least-norm currents for a torque along u are ``I = G⁺ u torque``: group j reaches its limit at
    ``limit / |row j of G⁺ . u|``, so the worst u is the largest row's own direction.

    All torques within the limit form a zonotope ``{G I: |I_j| <= limit}``. The torque available in every
    direction is the radius of the ball inscribed in it, the distance of its nearest facet. A facet's
    normal is the cross product of two columns, its distance ``limit sum_k |g_k . n|``: trying all pairs
    is exact; no linear programme is needed.
    """
    starts = range(0, len(q), BLOCK)
    blocks = [_capability(q[starts[i] : starts[i] + BLOCK], actuator) for i in track(range(len(starts)))]
    return Capability(*(np.concatenate(figures) for figures in zip(*blocks, strict=True)))


def torque_matrices(q: Array, actuator: Actuator) -> Array:
    """Return the torque matrices of many poses: (n, 3) in rad to (n, 3, groups) in N·m/A."""
    model, G = torque_model(actuator), np.empty((len(q), 3, len(actuator.groups)))
    _fill_torque_matrices(np.ascontiguousarray(q), model, G, scratch_of(model))
    return G


def _least_heat(G: Array, actuator: Actuator, direction: Array, lost: Array) -> Array:
    """Return the least heat per torque squared in a direction (n, 3): the currents minimise Σ R i²."""
    per_heat = (G / of_each_group(actuator.group.resistance_ohm, G.shape[2])) @ G.transpose(0, 2, 1)
    per_heat[lost] = np.eye(3)
    heat: Array = np.einsum("ni,nij,nj->n", direction, np.linalg.inv(per_heat), direction)
    return heat


def _capability(q: Array, actuator: Actuator) -> Capability:
    G = torque_matrices(q, actuator)
    limit = actuator.group.current_limit_A
    squared, U = np.linalg.eigh(G @ G.transpose(0, 2, 1))  # (n, 3) rising, (n, 3, 3)
    sigma = np.sqrt(np.maximum(squared, 0.0))
    lost = sigma[:, 0] <= LOST * sigma[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = (G.transpose(0, 2, 1) @ U / squared[:, None]) @ U.transpose(0, 2, 1)  # (n, groups, 3)
        rows = np.linalg.norm(inverse, axis=2)  # (n, groups)
        condition = np.where(lost, np.inf, sigma[:, 2] / sigma[:, 0])
    weak = U[:, :, 0]
    copper = np.where(lost, np.inf, _least_heat(G, actuator, weak, lost))
    first = (
        np.arange(len(q)),
        np.argmax(rows, axis=1),
    )  # for each pose, the group that reaches its limit first
    least_norm = np.where(lost, 0.0, limit / np.where(lost, 1.0, rows[first]))
    direction = np.where(lost[:, None], weak, inverse[first] / np.where(lost, 1.0, rows[first])[:, None])
    best, best_direction = np.empty(len(q)), np.empty((len(q), 3))
    _fill_inscribed(G, best, best_direction)
    return Capability(
        singular_value_Nm_per_A=sigma[:, 0],
        condition=condition,
        weak_direction=weak,
        copper_W_per_Nm2=copper,
        least_norm_Nm=least_norm,
        least_norm_direction=direction,
        best_Nm=limit * best,
        best_direction=best_direction,
    )


@compiled
def _fill_torque_matrices(q: Array, model: TorqueModel, G: Array, scratch: Array) -> None:
    for i in range(q.shape[0]):
        fill_torque_matrix(q[i], model.arrangement[0], model.tables, G[i], scratch)


@compiled
def _fill_inscribed(G: Array, radius: Array, direction: Array) -> None:
    """Write the radius of the inscribed ball and the normal of the facet that it touches, for each matrix."""
    for i in range(G.shape[0]):
        radius[i], direction[i, 0], direction[i, 1], direction[i, 2] = _nearest_facet(G[i])


@compiled
def _nearest_facet(G: Array) -> tuple[float, float, float, float]:
    x, y, z = G[0], G[1], G[2]
    columns = G.shape[1]
    nearest, n_x, n_y, n_z = np.inf, 0.0, 0.0, 0.0
    for i in range(columns):
        for j in range(i):
            a, b, c = y[i] * z[j] - z[i] * y[j], z[i] * x[j] - x[i] * z[j], x[i] * y[j] - y[i] * x[j]
            area = np.sqrt(a * a + b * b + c * c)
            sides = (x[i] ** 2 + y[i] ** 2 + z[i] ** 2) * (x[j] ** 2 + y[j] ** 2 + z[j] ** 2)
            if not area > PARALLEL * np.sqrt(sides):
                continue
            a, b, c = a / area, b / area, c / area
            distance = 0.0
            for k in range(columns):
                distance += abs(a * x[k] + b * y[k] + c * z[k])
            if distance < nearest:
                nearest, n_x, n_y, n_z = distance, a, b, c
    if nearest == np.inf:  # all columns on one line
        return 0.0, n_x, n_y, n_z
    return nearest, n_x, n_y, n_z
