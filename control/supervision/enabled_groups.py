"""Coil groups that the allocation may use: without those reported faulty and those detected faulty."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free

IN_USE, REPORTED, DETECTED_OPEN, DETECTED_SHORTED = 0, 1, 2, 3
"""States of a group."""

STATES = ("in use", "known to be out", "found open", "found shorted")
"""Names of the states."""


class EnabledGroups(NamedTuple):
    """Enabled and disabled groups, for compiled code."""

    some_out: NDArray[np.bool_]  # (1,)
    out: NDArray[np.int64]  # (n,) state: `IN_USE`, or the reason why the group is out
    out_s: NDArray[np.float64]  # (n,) time since which a group is out, s; undefined for a group in use
    G: NDArray[np.float64]  # (3, n) N·m/A, torque matrix with zero columns for the groups that are out

    def state_arrays(self) -> tuple[NDArray[Any], ...]:
        """Return the arrays that hold the state."""
        return self.some_out, self.out, self.out_s


def groups(count: int) -> EnabledGroups:
    """Return groups that are all in use."""
    return EnabledGroups(
        np.zeros(1, dtype=np.bool_), np.zeros(count, dtype=np.int64), np.zeros(count), np.zeros((3, count))
    )


def mark_faulty_groups(groups: EnabledGroups, reported: NDArray[np.bool_], t_s: float) -> None:
    """Disable the groups (n,) reported faulty, from a time on; enable those no longer reported.

    A group that the detector found stays out: the detector cannot detect that an unused group works again.
    """
    added, cleared = reported & (groups.out == IN_USE), ~reported & (groups.out == REPORTED)
    groups.out[added], groups.out_s[added] = REPORTED, t_s
    groups.out[cleared] = IN_USE
    groups.some_out[0] = np.any(groups.out != IN_USE)


@allocation_free
def mask_disabled_groups(groups: EnabledGroups, G: NDArray[np.float64]) -> None:
    """Copy a torque matrix (3, n) with zero columns for the groups that are out."""
    for j in range(groups.out.shape[0]):
        enabled = groups.out[j] == IN_USE
        for i in range(3):
            groups.G[i, j] = G[i, j] if enabled else 0.0
