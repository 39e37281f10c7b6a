"""Trajectories of orientation: rotations about an axis, as hinge angles, rates and accelerations.

A rotor that starts at R_0 and turns by φ about an axis n of its own has R = R_0 exp(φ n), the angular
velocity φ' n and the angular acceleration φ'' n in the rotor frame. With x and y of these along the hinges α
and β,

    α' = x / cos β,      β' = y,      γ' = Ω_z − α' sin β,

so that rates of α and γ grow without bound towards β = ±90°. There the three hinges lock: a path that comes
closer than `CLOSEST_rad`, or on which a hinge would have to jump, is refused with the time.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from pydantic import Field

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError
from spheretwin.models.kinematics import rotation
from spheretwin.models.telemetry.csv_series import TimeSeries
from spheretwin.trajectories.rounding import LARGEST, ZERO, Bounded, Triple
from spheretwin.trajectories.trajectory import Samples, Shape

CLOSEST_rad = np.radians(0.5)
"""Least distance of β from ±90°: rates of α and γ are up to 115 times those of the rotor there."""
_CHECKED = 2000  # samples of a path, or of a part of it, that is checked

MINIMUM_JERK = Polynomial([0, 0, 0, 10, -15, 6])
"""Share of the way over the share of the time: rate and acceleration are 0 at both ends."""

AXES = ("alpha", "beta", "gamma")


class PathPeak(NamedTuple):
    """Largest rate or acceleration of a path."""

    value: float
    """Magnitude, rad/s or rad/s²."""
    t_s: float
    axis: str


def turned_about(start_rad: Array, axis: Array, angle: Array, near_rad: Array) -> Samples:
    """Return the hinge motion of rotors that turn about axes of their own.

    Parameters
    ----------
    start_rad : (n, 3) array, rad
        Pose from which each turns.
    axis : (n, 3) array
        Unit vector in the rotor frame.
    angle : (n, 3) array
        Angle of the turn, its rate and acceleration (rad, rad/s, rad/s²).
    near_rad : (n, 3) array, rad
        Pose within π of which α and γ are given.

    Returns
    -------
    (n, 3, 3) array
        Angle, rate and acceleration of the hinges as rows, for each turn.
    """
    from scipy.spatial.transform import Rotation  # slow to import, and rarely needed

    starts = np.array([rotation(np.array(q)) for q in start_rad]).reshape(-1, 3, 3)
    R = starts @ Rotation.from_rotvec(angle[:, :1] * axis).as_matrix().reshape(-1, 3, 3)
    samples = np.empty((len(R), 3, 3))
    alpha, gamma = np.arctan2(-R[:, 1, 2], R[:, 2, 2]), np.arctan2(-R[:, 0, 1], R[:, 0, 0])
    q = np.stack([alpha, np.arcsin(np.clip(R[:, 0, 2], -1, 1)), gamma], axis=1)
    q[:, ::2] += 2 * np.pi * np.round((near_rad - q)[:, ::2] / (2 * np.pi))
    cb, sb, cg, sg = np.cos(q[:, 1]), np.sin(q[:, 1]), np.cos(q[:, 2]), np.sin(q[:, 2])
    velocity, acceleration = angle[:, 1:2] * axis, angle[:, 2:] * axis
    x, y = cg * velocity[:, 0] - sg * velocity[:, 1], sg * velocity[:, 0] + cg * velocity[:, 1]
    v1, v2 = x / cb, y
    v3 = velocity[:, 2] - sb * v1
    ax = cg * acceleration[:, 0] - sg * acceleration[:, 1] + sb * v2 * v1 - y * v3
    ay = sg * acceleration[:, 0] + cg * acceleration[:, 1] + x * v3
    a1 = ax / cb
    samples[:, 0], samples[:, 1] = q, np.stack([v1, v2, v3], axis=1)
    samples[:, 2] = np.stack([a1, ay, acceleration[:, 2] - sb * a1 - cb * v2 * v1], axis=1)
    return samples


def check_path(name: str, t: Array, samples: Samples) -> None:
    """Check that samples of a path stay away from β = ±90° and that no hinge jumps.

    Raises
    ------
    InputError
        They do not.
    """
    q = samples[:, 0]
    worst = int(np.argmax(np.abs(q[:, 1])))
    if abs(q[worst, 1]) > np.pi / 2 - CLOSEST_rad:
        raise InputError(
            f"{name}: expected β within ±{90 - np.degrees(CLOSEST_rad):g}°, received"
            f" {np.degrees(q[worst, 1]):.2f}° at {t[worst]:.4g} s, where the hinges lock"
        )
    jumps = np.abs(np.diff(q, axis=0)).max(axis=1)
    if len(jumps) and jumps.max() > np.pi:
        raise InputError(
            f"{name}: expected hinge angles without a jump, received one of"
            f" {np.degrees(jumps.max()):.0f}° at {t[int(jumps.argmax())]:.4g} s"
        )


class OrientationPath:
    """From rest at a pose to rest at the next along the shorter rotation (slerp), with minimum jerk.

    Parameters
    ----------
    poses : TimeSeries
        At least two, rad on (α, β, γ).

    Raises
    ------
    InputError
        A hinge would lock or jump on the way.
    """

    def __init__(self, poses: TimeSeries) -> None:
        from scipy.spatial.transform import Rotation  # slow to import, and rarely needed

        self._poses, self._times = poses, poses.t_s
        R = np.array([rotation(q) for q in poses.values])
        turns = Rotation.from_matrix(R[:-1].transpose(0, 2, 1) @ R[1:]).as_rotvec()
        self._angles = np.linalg.norm(turns, axis=1, keepdims=True)
        self._axes = turns / np.maximum(self._angles, np.finfo(float).tiny)
        self._t = np.unique(np.linspace(self._times[:-1], self._times[1:], _CHECKED))
        self._checked = self.sample(self._t)
        check_path("waypoints", self._t, self._checked)

    def __eq__(self, other: object) -> bool:
        return self._poses == other._poses if isinstance(other, OrientationPath) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._poses)

    def sample(self, t: Array) -> Samples:
        """Return the motion in the form of a trajectory, at any times (s)."""
        segment = np.clip(np.searchsorted(self._times, t, side="right") - 1, 0, len(self._times) - 2)
        duration = np.diff(self._times)[segment]
        share = np.clip((t - self._times[segment]) / duration, 0.0, 1.0)
        done = MINIMUM_JERK(share)
        rates = [MINIMUM_JERK.deriv(order)(share) / duration**order for order in (1, 2)]
        near = self._poses.values[segment] + done[:, None] * np.diff(self._poses.values, axis=0)[segment]
        angle = self._angles[segment] * np.stack([done, *rates], axis=1)
        return turned_about(self._poses.values[segment], self._axes[segment], angle, near)

    def peaks(self) -> tuple[PathPeak, PathPeak]:
        """Return the largest rate and the largest acceleration of a hinge among the checked times."""
        rate, acceleration = (self._peak(row) for row in (1, 2))
        return rate, acceleration

    def _peak(self, row: int) -> PathPeak:
        sizes = np.abs(self._checked[:, row])
        place, axis = divmod(int(sizes.argmax()), 3)
        return PathPeak(float(sizes[place, axis]), float(self._t[place]), AXES[axis])


class GreatCircle(Shape):
    """Turn to and fro by ``turn sin(2 pi f t)`` about a fixed axis; the shaft follows a great circle."""

    shape: Literal["great_circle"] = Field("great_circle", description="kind of trajectory")
    middle_rad: Triple = Field(ZERO, description="pose in the middle of the turn, rad")
    axis: tuple[Bounded, Bounded, Bounded] = Field(
        (1.0, 1.0, 0.0), description="axis of the turn in the stator frame; only its direction counts"
    )
    turn_rad: Annotated[float, Field(ge=0, le=np.pi)] = Field(0.5, description="amplitude, rad")
    frequency_Hz: Annotated[float, Field(gt=0, le=LARGEST)] = Field(0.5, description="frequency, Hz")

    def sharp(self, t: Array) -> Samples:
        """Return the motion without rounded corners, as `Shape.sharp`."""
        w, start = 2 * np.pi * self.frequency_Hz, np.array(self.middle_rad)
        axis = rotation(start).T @ np.array(self.axis) / np.linalg.norm(self.axis)
        sine, cosine = np.sin(w * t), np.cos(w * t)
        angle = self.turn_rad * np.stack([sine, w * cosine, -(w**2) * sine], axis=1)
        starts = np.broadcast_to(start, (len(t), 3))
        return turned_about(starts, np.broadcast_to(axis, (len(t), 3)), angle, starts)

    def _check(self) -> None:
        if not np.linalg.norm(self.axis) > 0:
            raise ValueError("expected an axis other than 0, received 0")
        t = np.linspace(0.0, 1 / self.frequency_Hz, _CHECKED)
        check_path("great_circle", t, self.sharp(t))
