"""Workspace: poses by tilt, azimuth and spin of the shaft, and the search for the worst ones."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.design.capability import Capability, capability

# The nutation of the paper (59) tilts the shaft by 57 degrees at its end.
LARGEST_TILT_DEG = 57.0


class Workspace(NamedTuple):
    """Grid of poses.

    Attributes
    ----------
    tilt_rad, azimuth_rad, spin_rad : (t,), (a,), (s,) array, rad
        Axes of the grid.
    q : (t, a, s, 3) array, rad
        Poses.
    reachable : (t, a, s) bool array
        False if a hinge would leave its range.
    """

    tilt_rad: Array
    azimuth_rad: Array
    spin_rad: Array
    q: Array
    reachable: NDArray[np.bool_]


def pose(tilt_rad: Array | float, azimuth_rad: Array | float, spin_rad: Array | float) -> Array:
    """Return the pose of a rotor that is spun about its shaft, then tilted without further spin.

    Parameters
    ----------
    tilt_rad, azimuth_rad, spin_rad : (...) array, rad
        Angle of the shaft, the rotor's z axis, to the stator's, below 90 degrees; direction of the tilt
        from x towards y; turn about the shaft.

    Returns
    -------
    (..., 3) array, rad
        ``q`` with ``R_SR(q) = Rz(azimuth) Ry(tilt) Rz(spin - azimuth)``. A turn of the whole stator by
        some angle adds it to azimuth and spin alike, so an even grid keeps the actuator's symmetries.
    """
    tilt, azimuth, spin = np.broadcast_arrays(tilt_rad, azimuth_rad, spin_rad)
    ca, sa = np.cos(azimuth), np.sin(azimuth)
    beta = np.arcsin(np.sin(tilt) * ca)
    alpha = np.arctan2(-np.sin(tilt) * sa, np.cos(tilt))
    versine = 1.0 - np.cos(tilt)
    # Rotation about the shaft by the two other hinges, which the last hinge compensates.
    twist = np.arctan2(versine * ca * sa, 1.0 - versine * ca**2)
    gamma = np.mod(spin + twist + np.pi, 2 * np.pi) - np.pi
    return np.stack([alpha, beta, gamma], axis=-1)


def reachable(q: Array, actuator: Actuator) -> NDArray[np.bool_]:
    """Return True if every hinge is within its range, for poses of shape (..., 3)."""
    low, high = actuator.hinge_range_rad.T
    return np.all((q >= low) & (q <= high), axis=-1)


def grid(
    actuator: Actuator,
    largest_tilt_deg: float = LARGEST_TILT_DEG,
    tilt_step_deg: float = 3.0,
    azimuths: int = 72,
    spins: int = 120,
) -> Workspace:
    """Return an even grid over tilt, azimuth and a full turn of spin.

    Parameters
    ----------
    actuator : Actuator
        Its hinge ranges bound the workspace.
    largest_tilt_deg, tilt_step_deg : float, degrees
        The last step may be shorter.
    azimuths, spins : int
        Numbers of directions and of spins.
    """
    steps = int(np.ceil(largest_tilt_deg / tilt_step_deg - 1e-9))
    tilt = np.radians(np.minimum(np.arange(steps + 1) * tilt_step_deg, largest_tilt_deg))
    azimuth = np.linspace(0.0, 2 * np.pi, azimuths, endpoint=False)
    spin = np.linspace(-np.pi, np.pi, spins, endpoint=False)
    q = pose(tilt[:, None, None], azimuth[:, None], spin)
    return Workspace(tilt, azimuth, spin, q, reachable(q, actuator))


# Each round halves the steps of a pose without a better neighbour: 18 halvings of a 5 degree step give
# 0.07 arc seconds, and six rounds remain for moves.
ROUNDS = 24

# The worst pose of the grid may not be near the global minimum: one start in each sector of azimuth.
SECTORS = 6

# Two poses count as one if symmetry maps one onto the other, which shows in equal tilt and figure.
SAME_TILT_RAD = np.radians(0.5)
SAME_FIGURE = 0.01

# Figures of poses that symmetry maps onto each other differ by rounding, some 1e-14, which depends on the
# processor: they are equal, and the first pose counts.
ROUNDING = 1e-11

# Figure of each pose that is minimised.
Figure = Callable[[Capability], Array]

FIGURES: dict[str, Figure] = {
    "least_norm": lambda poses: poses.least_norm_Nm,
    "best": lambda poses: poses.best_Nm,
    "singular_value": lambda poses: poses.singular_value_Nm_per_A,
    "condition": lambda poses: -poses.condition,
}


class WorstPoses(NamedTuple):
    """Worst poses and their torque capability."""

    tilt_azimuth_spin_rad: Array  # (n, 3)
    q: Array  # (n, 3), rad
    capability: Capability

    def at(self, index: Any) -> WorstPoses:
        """Return some of the poses."""
        return WorstPoses(self.tilt_azimuth_spin_rad[index], self.q[index], self.capability.at(index))


def worst_by_tilt(
    workspace: Workspace, on_grid: Capability, figure: Figure, actuator: Actuator
) -> WorstPoses:
    """Return the worst pose at each tilt of the grid, over all azimuths and spins.

    Parameters
    ----------
    workspace : Workspace
        The grid.
    on_grid : Capability
        Of its poses, in the grid's shape.
    figure : callable
        One of `FIGURES`.
    actuator : Actuator
        For poses between those of the grid.
    """
    start = _starts(workspace, on_grid, figure)
    poses = _downhill(start, _steps(workspace) * [0, 1, 1], figure, actuator, workspace.tilt_rad[-1])
    order = np.lexsort((_rounded(figure(poses.capability)), start[:, 0]))
    _, first = np.unique(start[order, 0], return_index=True)
    return poses.at(order[first])


def local_minima(workspace: Workspace, by_tilt: WorstPoses, figure: Figure, actuator: Actuator) -> WorstPoses:
    """Return the worst poses of the whole workspace, the worst first; equivalent poses by symmetry only once.

    Parameters
    ----------
    workspace : Workspace
        The grid.
    by_tilt : Found
        Result of `worst_by_tilt` for the same figure.
    figure, actuator
        As in `worst_by_tilt`.
    """
    start = by_tilt.tilt_azimuth_spin_rad
    poses = _downhill(start, _steps(workspace), figure, actuator, workspace.tilt_rad[-1])
    value, tilt = figure(poses.capability), poses.tilt_azimuth_spin_rad[:, 0]
    distinct: list[int] = []
    for i in np.argsort(_rounded(value), kind="stable"):
        near = [
            k
            for k in distinct
            if abs(tilt[i] - tilt[k]) < SAME_TILT_RAD and _alike(float(value[i]), float(value[k]))
        ]
        if not near:
            distinct.append(int(i))
    return poses.at(distinct)


def _alike(a: float, b: float) -> bool:
    return a == b or abs(a - b) <= SAME_FIGURE * max(abs(a), abs(b))


def _rounded(value: Array) -> Array:
    """Return figures rounded to the digits that do not depend on the processor."""
    finite = np.isfinite(value)
    exponent = np.floor(np.log10(np.abs(np.where(finite & (value != 0), value, 1.0))))
    quantum = 10.0**exponent * ROUNDING
    return np.where(finite, np.round(np.where(finite, value, 0.0) / quantum) * quantum, value)


def _first_least(value: Array) -> Any:
    """Return the index of the first least value along the last axis; values equal but for rounding tie."""
    least = value.min(axis=-1, keepdims=True)
    return (value <= least + ROUNDING * np.abs(np.where(np.isfinite(least), least, 0.0))).argmax(axis=-1)


def _steps(workspace: Workspace) -> Array:
    """Return half the steps of the grid."""
    return 0.5 * np.array(
        [_spacing(axis) for axis in (workspace.tilt_rad, workspace.azimuth_rad, workspace.spin_rad)]
    )


def _spacing(axis: Array) -> float:
    return float(axis[1] - axis[0]) if len(axis) > 1 else 0.0


def _starts(workspace: Workspace, on_grid: Capability, figure: Figure) -> Array:
    """Return tilt, azimuth and spin, (n, 3) in rad, of the worst pose at each tilt and sector of azimuth."""
    value = np.where(workspace.reachable, figure(on_grid), np.inf)
    sectors = np.array_split(np.arange(len(workspace.azimuth_rad)), min(SECTORS, len(workspace.azimuth_rad)))
    starts = []
    for tilt, at_tilt in zip(workspace.tilt_rad, value, strict=True):
        for sector in sectors:
            azimuth, spin = np.unravel_index(_first_least(at_tilt[sector].ravel()), at_tilt[sector].shape)
            if at_tilt[sector][azimuth, spin] < np.inf:  # otherwise no pose of the sector is reachable
                starts.append((tilt, workspace.azimuth_rad[sector[azimuth]], workspace.spin_rad[spin]))
    return np.array(starts)


def _downhill(
    start: Array, steps: Array, figure: Figure, actuator: Actuator, largest_tilt: float
) -> WorstPoses:
    """Run a pattern search from each start: go to the best neighbour, or halve the steps if there is none."""
    offsets = np.array(list(itertools.product(*((-1, 0, 1) if step else (0,) for step in steps))))
    offsets = offsets[np.argsort(np.any(offsets, axis=1), kind="stable")]  # no move comes first and wins ties
    at, scale = start.copy(), np.ones(len(start))
    for _ in range(ROUNDS):
        neighbours = at[:, None] + scale[:, None, None] * (offsets * steps)  # (n, offsets, 3)
        neighbours[..., 0] = np.clip(neighbours[..., 0], 0.0, largest_tilt)
        q = pose(*np.moveaxis(neighbours, -1, 0)).reshape(-1, 3)
        value = np.where(reachable(q, actuator), figure(capability(q, actuator)), np.inf)
        best = _first_least(value.reshape(neighbours.shape[:2]))
        at = neighbours[np.arange(len(at)), best]
        scale = np.where(best == 0, scale / 2, scale)
    q = pose(*at.T)
    return WorstPoses(at, q, capability(q, actuator))
