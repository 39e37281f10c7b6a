"""Search of the order and the signs of coil groups under which logged currents explain a motion.

The residual is quadratic in the matrix that assigns logged columns to groups. A local search over exchanges
and sign changes starts from several assignments; it returns the best one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from spheretwin.machine.torque_balance import Motion, TorqueBalance
from spheretwin.models.base.arrays import Array, Integers

REGULARISATION = 1e-3
ROUNDING = 1e-9


class Assignment(NamedTuple):
    """Logged column and sign of each group."""

    order: Integers
    """Logged column of each group."""
    signs: Integers

    def matrix(self) -> Array:
        """Return the matrix (groups, logged) that maps logged currents to those of the groups."""
        matrix = np.zeros((len(self.order), len(self.order)))
        matrix[np.arange(len(self.order)), self.order] = self.signs
        return matrix


def in_order(groups: int) -> Assignment:
    """Return the assignment of a correct log."""
    return Assignment(np.arange(groups), np.ones(groups, np.int64))


class Quadratic(NamedTuple):
    """Residual of an assignment: ``x.H.x - 2 f.x + constant`` of the flat matrix x, (N·m)²."""

    H: Array
    f: Array
    constant: float

    def value(self, matrix: Array) -> float:
        """Return the residual of a matrix (groups, logged)."""
        x = matrix.ravel()
        return float(x @ self.H @ x - 2 * self.f @ x) + self.constant


def quadratic(balance: TorqueBalance, motion: Motion, currents: Array) -> Quadratic:
    """Return the residual of each assignment, without friction, payload and constant torques."""
    torques = balance.group_torques(motion, currents)
    windows, _, groups, logged = torques.shape
    constant = np.broadcast_to(np.eye(3), (windows, 3, 3))
    unknown = np.concatenate([motion.unknown_Nm, constant], axis=2).reshape(windows * 3, -1)
    basis, sizes, _ = np.linalg.svd(unknown, full_matrices=False)
    basis = basis[:, sizes > ROUNDING * sizes[0]]
    flat = torques.reshape(windows * 3, groups * logged)
    A, y = (values - basis @ (basis.T @ values) for values in (flat, motion.need_Nm.ravel()))
    return Quadratic(A.T @ A, A.T @ y, float(y @ y))


def search(residual: Quadratic, groups: int) -> Assignment:
    """Return the assignment with the least residual that was found."""
    assignments = [_descend(residual, start) for start in _starts(residual, groups)]
    return min(assignments, key=lambda assignment: residual.value(assignment.matrix()))


def _starts(residual: Quadratic, groups: int) -> Iterator[Assignment]:
    """Yield the order of the log, the same with all signs changed, and that nearest to any linear map."""
    correct = in_order(groups)
    yield correct
    yield correct._replace(signs=-correct.signs)
    size = REGULARISATION * np.trace(residual.H) / len(residual.H)
    if size == 0:  # no currents
        return
    linear = np.linalg.solve(residual.H + size * np.eye(len(residual.H)), residual.f).reshape(groups, groups)
    _, order = linear_sum_assignment(-np.abs(linear))
    yield Assignment(order, np.where(linear[np.arange(groups), order] < 0, -1, 1))


def _descend(residual: Quadratic, assignment: Assignment) -> Assignment:
    """Apply the best exchange or sign change until none reduces the residual."""
    groups = len(assignment.order)
    changes = _changes(groups)
    while True:
        entries, weights = _differences(assignment, changes)
        gradient = residual.H @ assignment.matrix().ravel() - residual.f
        curvature = residual.H[entries[:, :, None], entries[:, None, :]]
        steps = 2 * np.sum(gradient[entries] * weights, axis=1)
        steps += np.einsum("ca,cab,cb->c", weights, curvature, weights)
        best = int(np.argmin(steps))
        if steps[best] > -ROUNDING * residual.constant:
            return assignment
        flat = assignment.matrix().ravel()
        np.add.at(flat, entries[best], weights[best])
        matrix = flat.reshape(groups, groups)
        assignment = Assignment(
            np.argmax(np.abs(matrix), axis=1), matrix.sum(axis=1).round().astype(np.int64)
        )


def _changes(groups: int) -> Integers:
    """Return all changes (n, 4): two groups j and k whose columns are exchanged, and a factor for each.

    With j equal to k, the sign of the group changes.
    """
    pairs = [(j, k, a, b) for j in range(groups) for k in range(j) for a in (1, -1) for b in (1, -1)]
    return np.array([*pairs, *((j, j, -1, -1) for j in range(groups))])


def _differences(assignment: Assignment, changes: Integers) -> tuple[Integers, Array]:
    """Return the four entries (n, 4) of the flat matrix that each change alters, and by how much."""
    order, signs = assignment
    j, k, a, b = changes.T
    groups, same = len(order), j == k
    entries = [j * groups + order[j], k * groups + order[k], j * groups + order[k], k * groups + order[j]]
    # A sign change: one entry by twice its value; the other three stay.
    weights = [-signs[j] * (1 + same), -signs[k] * ~same, a * signs[k] * ~same, b * signs[j] * ~same]
    return np.stack(entries, axis=1), np.stack(weights, axis=1).astype(np.float64)


def flips(residual: Quadratic, groups: int) -> Array:
    """Return the residual after a change of the sign of each group, (groups,)."""
    correct = in_order(groups)
    entries, weights = _differences(correct, _changes(groups)[-groups:])
    values = []
    for entry, weight in zip(entries, weights, strict=True):
        matrix = correct.matrix().ravel()
        np.add.at(matrix, entry, weight)
        values.append(residual.value(matrix))
    return np.array(values)
