"""Poses by the tilt of the shaft: how far, in which direction, and how far spun about itself."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator

Array = NDArray[np.float64]

# The nutation of the paper (59) tilts the shaft by 57 degrees at its end.
LARGEST_TILT_DEG = 57.0


class Workspace(NamedTuple):
    """A grid of poses.

    Attributes
    ----------
    tilt_rad, azimuth_rad, spin_rad : (t,), (a,), (s,) array, rad
        Axes of the grid.
    q : (t, a, s, 3) array, rad
        The poses.
    reachable : (t, a, s) bool array
        False where a hinge would have to leave its range.
    """

    tilt_rad: Array
    azimuth_rad: Array
    spin_rad: Array
    q: Array
    reachable: NDArray[np.bool_]


def pose(tilt_rad: Array | float, azimuth_rad: Array | float, spin_rad: Array | float) -> Array:
    """Pose of a rotor that is spun about its shaft, then tilted without further spin.

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
    # What the two other hinges have turned the rotor about its shaft, to be undone by the last.
    twist = np.arctan2(versine * ca * sa, 1.0 - versine * ca**2)
    gamma = np.mod(spin + twist + np.pi, 2 * np.pi) - np.pi
    return np.stack([alpha, beta, gamma], axis=-1)


def reachable(q: Array, actuator: Actuator) -> NDArray[np.bool_]:
    """Whether every hinge is within its range, for poses of shape (..., 3)."""
    low, high = actuator.hinge_range_rad.T
    return np.all((q >= low) & (q <= high), axis=-1)


def grid(
    actuator: Actuator,
    largest_tilt_deg: float = LARGEST_TILT_DEG,
    tilt_step_deg: float = 3.0,
    azimuths: int = 72,
    spins: int = 120,
) -> Workspace:
    """Even grid over tilt, azimuth and a whole turn of spin.

    Parameters
    ----------
    actuator : Actuator
        Its hinge ranges bound the workspace.
    largest_tilt_deg, tilt_step_deg : float, degrees
        The last step is the shorter one.
    azimuths, spins : int
        Numbers of directions and of spins.
    """
    steps = int(np.ceil(largest_tilt_deg / tilt_step_deg - 1e-9))
    tilt = np.radians(np.minimum(np.arange(steps + 1) * tilt_step_deg, largest_tilt_deg))
    azimuth = np.linspace(0.0, 2 * np.pi, azimuths, endpoint=False)
    spin = np.linspace(-np.pi, np.pi, spins, endpoint=False)
    q = pose(tilt[:, None, None], azimuth[:, None], spin)
    return Workspace(tilt, azimuth, spin, q, reachable(q, actuator))
