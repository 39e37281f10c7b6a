"""Waypoints: a path through the poses of a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from pydantic import Field, PrivateAttr

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, distinct_texts
from spheretwin.models.telemetry.csv_series import TIME, TimeSeries, read
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.trajectories.rotations import AXES, OrientationPath, PathPeak
from spheretwin.trajectories.rounding import LARGEST
from spheretwin.trajectories.trajectory import Samples, Shape

COLUMNS = tuple(f"{axis}_rad" for axis in AXES)

Between = Literal["minimum_jerk", "cubic", "slerp"]
Limit = Annotated[float, Field(gt=0)]


class WaypointPath:
    """Polynomials from pose to pose; at rest before the first and from the last on.

    Parameters
    ----------
    poses : Series
        At least two, rad on (α, β, γ).
    between : "minimum_jerk" or "cubic"
        From rest at a pose to rest at the next, or a spline of two continuous derivatives that is at rest at
        both ends.
    """

    def __init__(self, poses: TimeSeries, between: Literal["minimum_jerk", "cubic"]) -> None:
        self._key = poses, between
        self._times, self._poses = poses.t_s, poses.values
        self._lasts = np.diff(poses.t_s)
        polynomials = _minimum_jerk(poses) if between == "minimum_jerk" else _cubic(poses)
        self._polynomials = polynomials  # of the share of a segment done: (powers, segments, 3)

    def __eq__(self, other: object) -> bool:
        return self._key == other._key if isinstance(other, WaypointPath) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._key)

    def sample(self, t: Array) -> Samples:
        """Return the motion in the form of a trajectory.

        Parameters
        ----------
        t : (n,) array, s
            Any times.

        Returns
        -------
        (n, 3, 3) array
            Angle (rad), rate (rad/s) and acceleration (rad/s²) as rows, for each time.
        """
        samples = np.zeros((len(t), 3, 3))
        samples[:, 0] = np.where((t < self._times[0])[:, None], self._poses[0], self._poses[-1])
        moving = (t >= self._times[0]) & (t < self._times[-1])
        segment = np.searchsorted(self._times, t[moving], side="right") - 1
        lasts = self._lasts[segment, None]
        share = (t[moving] - self._times[segment])[:, None] / lasts
        for row in range(3):
            samples[moving, row] = _derived(self._polynomials[:, segment], row, share, lasts)
        return samples

    def peaks(self) -> tuple[PathPeak, PathPeak]:
        """Return the largest rate and the largest acceleration."""
        return self._peak(1), self._peak(2)

    def _peak(self, row: int) -> PathPeak:
        shares = _candidates(self._polynomials)
        sizes = np.abs(_derived(self._polynomials, row, shares, self._lasts[:, None]))  # (k, segments, 3)
        place, segment, axis = (int(index) for index in np.unravel_index(np.argmax(sizes), sizes.shape))
        t = self._times[segment] + shares[place, segment, axis] * self._lasts[segment]
        return PathPeak(float(sizes[place, segment, axis]), float(t), AXES[axis])


class Waypoints(Shape):
    """Through the poses of a CSV file at their times; at rest before the first and from the last on.

    The file is read when the shape is created; later changes of the file have no effect.

    Raises
    ------
    InputError
        The file is not a series of poses, or the path exceeds a limit.
    """

    shape: Literal["waypoints"] = Field("waypoints", description="kind of trajectory")
    file: Annotated[str, Field(min_length=1)] = Field(
        description=f"CSV of the poses, with the columns {', '.join((TIME, *COLUMNS))}",
        json_schema_extra={"path": True},
    )
    between: Between = Field(
        "minimum_jerk",
        description="minimum jerk from rest at each pose to rest at the next, or one cubic spline, at rest at"
        " both ends, or minimum jerk along the shorter rotation",
    )
    largest_rate_rad_s: Limit | None = Field(
        None, description="rate that no axis may exceed, rad/s; any unless given"
    )
    largest_acceleration_rad_s2: Limit | None = Field(
        None, description="acceleration that no axis may exceed, rad/s²; any unless given"
    )

    _path: WaypointPath | OrientationPath = PrivateAttr()

    def sharp(self, t: Array) -> Samples:
        """Return the motion without rounded corners, as `Shape.sharp`."""
        return self._path.sample(t)

    def peaks(self) -> tuple[PathPeak, PathPeak]:
        """Return the largest rate (rad/s) and acceleration (rad/s²) of the path, with their times."""
        return self._path.peaks()

    def notes(self) -> list[str]:
        """Return the largest rate and acceleration of the path, which do not follow from its parameters."""
        rate, acceleration = (
            f"{peak.value:.4g} {unit} ({ANGLES[AXES.index(peak.axis)]} at {peak.t_s:.4g} s)"
            for peak, unit in zip(self.peaks(), ("rad/s", "rad/s²"), strict=True)
        )
        return [f"waypoints {self.file}: largest rate {rate}, largest acceleration {acceleration}"]

    def _check(self) -> None:
        poses = read("waypoints", Path(self.file), COLUMNS, LARGEST)
        if len(poses.t_s) < 2:
            raise InputError(f"waypoints {self.file}: expected at least two poses, received one")
        self._path = OrientationPath(poses) if self.between == "slerp" else WaypointPath(poses, self.between)
        rate, acceleration = self._path.peaks()
        self._check_limit("rate", "rad/s", rate, self.largest_rate_rad_s)
        self._check_limit("acceleration", "rad/s²", acceleration, self.largest_acceleration_rad_s2)

    def _check_limit(self, quantity: str, unit: str, peak: PathPeak, limit: float | None) -> None:
        if limit is not None and peak.value > limit:
            most, received = distinct_texts(limit, peak.value)
            raise InputError(
                f"waypoints {self.file}: expected a largest {quantity} of {most} {unit},"
                f" received {received} {unit} on {peak.axis} at {peak.t_s:g} s"
            )


def _minimum_jerk(poses: TimeSeries) -> Array:
    """Return the polynomials ``10 u³ - 15 u⁴ + 6 u⁵``: rate and acceleration are 0 at both ends."""
    way = np.diff(poses.values, axis=0)
    none = np.zeros_like(way)
    return np.stack([poses.values[:-1], none, none, 10 * way, -15 * way, 6 * way])


def _cubic(poses: TimeSeries) -> Array:
    from scipy.interpolate import CubicSpline  # slow to import, and rarely needed

    by_power = CubicSpline(poses.t_s, poses.values, bc_type="clamped").c[::-1]  # (4, segments, 3), of seconds
    scale = np.diff(poses.t_s) ** np.arange(4)[:, None]
    return np.ascontiguousarray(by_power * scale[:, :, None])


def _derived(polynomials: Array, row: int, share: Array, lasts: Array) -> Array:
    """Return angle, rate or acceleration (row 0, 1, 2) at shares of segments with durations in seconds."""
    derived: Array = polyval(share, polyder(polynomials, row), tensor=False) / lasts**row
    return derived


def _candidates(polynomials: Array) -> Array:
    """Return the shares (k, segments, 3) at which rate and acceleration of a segment can be largest.

    Minimum jerk has its largest rate at half of the way, and its largest accelerations at (1 ∓ 1/√3)/2. The
    acceleration of a cubic is largest at an end, its rate at an end or where the acceleration is 0.
    """
    bend, twist = polynomials[2:4]
    with np.errstate(
        divide="ignore", over="ignore", invalid="ignore"
    ):  # the acceleration of a straight line has no zero
        turn = np.nan_to_num(np.clip(-bend / (3 * twist), 0.0, 1.0))
    fixed = [0.0, (1 - 1 / np.sqrt(3)) / 2, 0.5, (1 + 1 / np.sqrt(3)) / 2, 1.0]
    return np.stack([*(np.full_like(turn, share) for share in fixed), turn])
