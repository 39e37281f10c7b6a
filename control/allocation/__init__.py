"""From a torque to group currents within their limit, one way a file, and their names."""

from numba import types

from spheretwin.control.allocation.bounded import allocate_bounded
from spheretwin.control.allocation.least_norm import allocate
from spheretwin.control.allocation.simplex import Array

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]

SIGNATURE = types.float64(_matrix, _vector, types.float64, _vector, _matrix)
"""G (3, n), torque_S (3,), current limit, current (n,), scratch (5, n); the share given."""


def least_norm(G: Array, torque_S: Array, limit: float, current: Array, scratch: Array) -> float:
    """Least-norm currents, scaled as a whole to respect the limit (16)."""
    return allocate(G, torque_S, limit, current)


def bounded(G: Array, torque_S: Array, limit: float, current: Array, scratch: Array) -> float:
    """All that the limit allows."""
    return allocate_bounded(G, torque_S, limit, current, scratch)


ALLOCATIONS = {
    "least_norm": least_norm,
    "bounded": bounded,
}
