"""Transitions between modes: the next motion begins with the present one.

While a law acts, the present motion is the reference: pose, rates and accelerations are continuous, and the
error does not change. After manual currents it is the motion of the rotor: the error begins at 0.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, distinct_texts
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.session import Session
from spheretwin.trajectories.rounding import LARGEST, Approach, faded
from spheretwin.trajectories.shapes import Hold, Jog
from spheretwin.trajectories.trajectory import Shape

# Distance of poses and jogging from the ends of a hinge's range; the prototype's watchdog keeps 0.02 of it.
EDGE_rad = 0.05

# Candidates for how long a way takes, each 4 % longer than the one before: 20 ms to some hours.
DURATIONS_s = 0.02 * 1.04 ** np.arange(340)
SHARES = np.linspace(0.0, 1.0, 33)

# For a cubic course of the rates to zero, the largest acceleration is this factor times rate over duration.
BRAKING = 1.5


class Limits(NamedTuple):
    """Limits of the approach to a pose or a shape, for each axis."""

    rate_rad_s: float = 1.0
    acceleration_rad_s2: float = 5.0


def current_motion(session: Session) -> Array:
    """Angle, rate and acceleration as rows, (3, 3), from which the next motion begins."""
    if session.scenario.manual.on:
        return np.array([session.q_rad, session.qdot_rad_s, np.zeros(3)])
    return session.scenario.trajectory.sample(np.array([session.t_s]))[0]


def hold_shape(initial_motion: Array, limits: Limits, hinge_range_rad: Array) -> Shape:
    """Shape that comes to rest as soon as the limits permit."""
    duration_s = BRAKING * np.abs(initial_motion[1]).max() / limits.acceleration_rad_s2
    low, high = _allowed_range(hinge_range_rad)
    return Hold(angle_rad=_triple(np.clip(initial_motion[0] + initial_motion[1] * duration_s / 2, low, high)))


def point_shape(pose_rad: tuple[float, float, float], hinge_range_rad: Array) -> Shape:
    """Shape that rests at a pose.

    Raises
    ------
    InputError
        A hinge would be at, or beyond, the end of its range.
    """
    for name, angle, low, high in zip(ANGLES, pose_rad, *_allowed_range(hinge_range_rad), strict=True):
        if not low <= angle <= high:
            least, most, received = distinct_texts(low, high, angle)
            raise InputError(f"bench: expected {name} from {least} to {most} rad, received {received}")
    return Hold(angle_rad=pose_rad)


def jog_shape(
    initial_motion: Array, rates_rad_s: tuple[float, float, float], limits: Limits, hinge_range_rad: Array
) -> Shape:
    """Shape that turns at steady rates up to the edge; an axis that has no room to brake there stays."""
    farthest, push = float(_allowed_range(hinge_range_rad)[1][:2].min()), limits.acceleration_rad_s2
    rates = np.array(rates_rad_s)
    room = farthest - np.sign(rates) * initial_motion[0]
    rates[:2][room[:2] < rates[:2] ** 2 / push] = 0.0
    # The approach meets its rates itself: only the stop at the edge is rounded.
    return Jog(
        start_rad=_triple(initial_motion[0]),
        rate_rad_s=_triple(rates),
        farthest_rad=farthest,
        rounding_rad_s2=push,
        approach=Approach(),
    )


def approach_fields(
    shape: Shape, initial_motion: Array, t_s: float, shape_s: float, limits: Limits, hinge_range_rad: Array
) -> dict[str, Any]:
    """Fields of the way to a shape, which begins now.

    Parameters
    ----------
    shape : Shape
        Without one.
    begun : (3, 3) array
        Angle, rate, acceleration as rows.
    t_s, shape_s : float, s
        Now, and the shape's own time now.
    limits : Limits
    hinge_range_rad : (3, 2) array
        If the shape stays within, so does the approach, or it leaves the range by as little as possible.
    """
    initial_motion = np.clip(initial_motion, -LARGEST, LARGEST)
    difference = initial_motion - shape.sample_after_approach(np.array([shape_s]))[0]
    duration_s = approach_duration_s(difference, limits)
    while duration_s > 2 * DURATIONS_s[0] and _leaves_range(
        shape, difference, shape_s, duration_s, hinge_range_rad
    ):
        duration_s /= 2
    return {
        "start_s": t_s,
        "lasts_s": duration_s,
        "angle_rad": initial_motion[0].tolist(),
        "rate_rad_s": initial_motion[1].tolist(),
        "acceleration_rad_s2": initial_motion[2].tolist(),
        "shape_s": shape_s,
    }


def approach_duration_s(difference: Array, limits: Limits) -> float:
    """Return the least time in which a difference of motions fades within limits, plus its own rates."""
    unit = np.zeros((2, 3, 3))
    unit[0, 0, 0] = unit[1, 1, 0] = 1.0
    by_angle, by_rate = (faded(motion, SHARES, 1.0)[:, :, 0] for motion in unit)  # (shares, 3) derivatives
    rate = np.abs(difference[1])
    T = DURATIONS_s[:, None, None]
    rates = difference[0] * by_angle[:, 1, None] / T + difference[1] * by_rate[:, 1, None]
    pushes = difference[0] * by_angle[:, 2, None] / T**2 + difference[1] * by_rate[:, 2, None] / T
    fits = np.all(np.abs(rates) <= limits.rate_rad_s + rate, axis=(1, 2))
    fits &= np.all(np.abs(pushes) <= limits.acceleration_rad_s2, axis=(1, 2))
    return float(DURATIONS_s[np.argmax(fits)] if fits.any() else DURATIONS_s[-1])


def _leaves_range(
    shape: Shape, difference: Array, shape_s: float, duration_s: float, hinge_range_rad: Array
) -> bool:
    """True if the approach to a shape leaves a hinge's range where the shape itself does not."""
    since = duration_s * SHARES
    alone = shape.sample_after_approach(shape_s + since)[:, 0]
    way = alone + faded(difference, since, duration_s)[:, 0]
    low, high = hinge_range_rad.T
    return bool(np.any(((way < low) | (way > high)) & (low <= alone) & (alone <= high)))


def _triple(values: Array) -> tuple[float, float, float]:
    first, second, third = values.tolist()
    return first, second, third


def _allowed_range(hinge_range_rad: Array) -> Array:
    """Return the ends (2, 3) of the hinges' ranges less the margin."""
    low, high = hinge_range_rad.T
    return np.array([low + EDGE_rad, high - EDGE_rad])
