"""What the groups that are left can do along a path, beside what was needed there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.allocation.bounded import SCRATCH_ROWS, allocate_bounded
from spheretwin.control.allocation.least_norm import allocate
from spheretwin.models.base.compiled import compiled
from spheretwin.models.design.capability import LOST

Array = NDArray[np.float64]

# What is asked for to find out what there is: more is not told from it.
MOST = 1e3


class Left(NamedTuple):
    """The least along a path."""

    torque: float
    """Largest torque in the direction that was needed, currents within the limit, over what was needed; 0
    where a direction is lost. At most `MOST`."""
    least_norm: float
    """The same of least-norm currents, scaled as a whole."""
    comes: float
    """Of a torque that all groups are asked for, least norm, the share that those left give, in the worst
    direction."""
    singular_value_Nm_per_A: float
    """The smallest of the torque matrix."""
    rank: int


def left(G: Array, torque_S: Array, limit_A: float, opened: Sequence[int]) -> Left:
    """Find the least of each along a path.

    Parameters
    ----------
    G : (n, 3, groups) array, N·m/A
        Torque matrices of the path's poses, whole.
    torque_S : (n, 3) array, N·m
        Torque that was needed at each.
    limit_A : float, A
    opened : sequence of int
        Groups that give nothing.

    Notes
    -----
    Least-norm currents for a torque are ``G^T (G G^T)^-1 torque`` of the whole matrix. What is left of it,
    ``G_l``, makes ``K torque`` of them, ``K = G_l G_l^T (G G^T)^-1``. Its eigenvalues are those of the
    symmetric ``C^-1 G_l G_l^T C^-T`` with ``G G^T = C C^T``: between 0 and 1, and the smallest is the share
    that comes in the worst direction.
    """
    kept = G.copy()
    kept[:, :, list(opened)] = 0.0
    squared = kept @ kept.transpose(0, 2, 1)  # (n, 3, 3)
    sigma = np.sqrt(np.maximum(np.linalg.eigvalsh(squared), 0.0))  # (n, 3) rising
    whole = np.linalg.inv(np.linalg.cholesky(G @ G.transpose(0, 2, 1)))
    comes = np.linalg.eigvalsh(whole @ squared @ whole.transpose(0, 2, 1))[:, 0]
    most, scaled = np.empty(len(G)), np.empty(len(G))
    _fill_most(kept, np.ascontiguousarray(torque_S), limit_A, most, scaled)
    return Left(
        torque=float(most.min()),
        least_norm=float(scaled.min()),
        comes=float(np.clip(comes.min(), 0.0, 1.0)),
        singular_value_Nm_per_A=float(sigma[:, 0].min()),
        rank=int(np.sum(sigma > LOST * sigma[:, 2:], axis=1).min()),
    )


@compiled
def _fill_most(G: Array, torque_S: Array, limit: float, most: Array, scaled: Array) -> None:
    groups = G.shape[2]
    wanted, current, scratch = np.empty(3), np.empty(groups), np.empty((SCRATCH_ROWS, groups))
    for i in range(G.shape[0]):
        wanted[:] = MOST * torque_S[i]
        most[i] = MOST * allocate_bounded(G[i], wanted, limit, current, scratch)
        scaled[i] = MOST * allocate(G[i], wanted, limit, current)
