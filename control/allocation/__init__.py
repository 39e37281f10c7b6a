"""Allocations: group currents within their limit for a torque, one method per file, and the list of them."""

from numba import types

from spheretwin.control.allocation.bounded import allocate_bounded
from spheretwin.control.allocation.least_norm import allocate
from spheretwin.models.base.arrays import Array

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]

SIGNATURE = types.float64(_matrix, _vector, types.float64, _vector, _matrix)
"""G (3, n), torque_S (3,), current limit, current (n,), scratch (5, n); returns the share given."""


def least_norm(G: Array, torque_S: Array, limit: float, current: Array, scratch: Array) -> float:
    """Least-norm currents, scaled as a whole to respect the limit (16)."""
    return allocate(G, torque_S, limit, current)


def bounded(G: Array, torque_S: Array, limit: float, current: Array, scratch: Array) -> float:
    """Smallest currents within the limit for the torque, or for the largest share of it."""
    return allocate_bounded(G, torque_S, limit, current, scratch)


ALLOCATIONS = {
    "least_norm": least_norm,
    "bounded": bounded,
}
