"""Coil groups that the allocation may use: without those reported faulty and those detected faulty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.record import Record, Rows, field

IN_USE, REPORTED, DETECTED_OPEN, DETECTED_SHORTED = 0, 1, 2, 3
"""States of a group."""

STATES = ("in use", "known to be out", "found open", "found shorted")
"""Names of the states."""


class EnabledGroups(Record):
    """Enabled and disabled groups; all are in use if every number is 0."""

    out: NDArray[np.int64] = field("`IN_USE`, or why the group is out", "", "groups", state=True)
    out_s: Array = field("time since which a group is out; undefined in use", "s", "groups", state=True)
    G: Array = field("torque matrix with zero columns for the groups that are out", "N·m/A", (3, "groups"))


def mark_faulty_groups(rows: Rows, reported: NDArray[np.bool_], t_s: float) -> None:
    """Disable the groups (n,) reported faulty, from a time on; enable those no longer reported.

    A group that the detector found stays out: the detector cannot detect that an unused group works again.
    """
    out = rows["out"]
    added, cleared = reported & (out == IN_USE), ~reported & (out == REPORTED)
    out[added], rows["out_s"][added] = REPORTED, t_s
    out[cleared] = IN_USE


@allocation_free
def mask_disabled_groups(groups: EnabledGroups, G: Array) -> None:
    """Copy a torque matrix (3, n) with zero columns for the groups that are out."""
    for j in range(groups.out.shape[0]):
        enabled = groups.out[j] == IN_USE
        for i in range(3):
            groups.G[i, j] = G[i, j] if enabled else 0.0
