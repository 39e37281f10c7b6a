"""Coil groups that the allocation leaves out: those it was told of, and those that a detector found."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.compiled import allocation_free

IN_USE, REPORTED, DETECTED_OPEN, DETECTED_SHORTED = 0, 1, 2, 3
"""How a group stands."""

STATES = ("in use", "known to be out", "found open", "found shorted")
"""The same in words."""


class EnabledGroups(NamedTuple):
    """Which groups may be used, for compiled code."""

    some_out: NDArray[np.bool_]  # (1,)
    out: NDArray[np.int64]  # (n,) `IN_USE`, or why it is not
    out_s: NDArray[np.float64]  # (n,) since when, s; without meaning for a group in use
    G: NDArray[np.float64]  # (3, n) N·m/A, torque matrix without the columns of those that are out

    def state_arrays(self) -> tuple[NDArray[Any], ...]:
        """Arrays that it goes on from."""
        return self.some_out, self.out, self.out_s


def groups(count: int) -> EnabledGroups:
    """All in use."""
    return EnabledGroups(
        np.zeros(1, dtype=np.bool_), np.zeros(count, dtype=np.int64), np.zeros(count), np.zeros((3, count))
    )


def mark_faulty_groups(groups: EnabledGroups, reported: NDArray[np.bool_], t_s: float) -> None:
    """Leave out the groups (n,) that are known to fail, from a time on, and use again those that no more do.

    What a detector has found stays out: it cannot tell that a group works which it does not use.
    """
    added, cleared = reported & (groups.out == IN_USE), ~reported & (groups.out == REPORTED)
    groups.out[added], groups.out_s[added] = REPORTED, t_s
    groups.out[cleared] = IN_USE
    groups.some_out[0] = np.any(groups.out != IN_USE)


@allocation_free
def mask_disabled_groups(groups: EnabledGroups, G: NDArray[np.float64]) -> None:
    """Copy a torque matrix (3, n), with nothing in the columns of the groups that are out."""
    for j in range(groups.out.shape[0]):
        used = groups.out[j] == IN_USE
        for i in range(3):
            groups.G[i, j] = G[i, j] if used else 0.0
