"""Limits of the allocation: the current limit, or a torque matrix without rank 3."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.table import Table


def saturated(rows: Table) -> NDArray[np.bool_]:
    """True for each row in which the current limit left a part of the commanded torque."""
    scale = rows["allocation_scale"]
    return (scale > 0) & (scale < 1)


def rank_lost(rows: Table) -> NDArray[np.bool_]:
    """True for each row in which the torque matrix of the groups in use has less than rank 3.

    Such a pose has a direction without torque. No currents are commanded then, whatever the limit.
    """
    return np.equal(rows["allocation_scale"], 0)
