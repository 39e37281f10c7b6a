"""Rounding of the corners of a trajectory at a stated acceleration, each corner within its own window.

Outside the windows the motion does not change. A jump of the rate becomes a parabolic blend, symmetric about
its time. A jump of the angle becomes the fastest move from rest to rest, which begins at the jump. A start
with a rate becomes the fastest move from rest to the motion. Each is a correction with piecewise constant
acceleration, which is added to the motion.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import ROUND_CEILING, Context
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.csv_series import LONGEST_s

# Format of the smallest acceleration in messages: six digits, rounded up.
UP = Context(prec=6, rounding=ROUND_CEILING)


class Corners(NamedTuple):
    """Times at which a motion jumps; if angle and rate jump at one time, their windows overlap."""

    t_s: Array
    """(m,) from 0 on, rising; from this time the motion after the jump applies."""
    angle_rad: Array
    """(m, 3) jumps of the angles, between poses at rest."""
    rate_rad_s: Array
    """(m, 3) jumps of the rates."""


class Windows(NamedTuple):
    """Windows of one axis: at an acceleration a, a window lasts ``p / a + s / sqrt(a)``."""

    t_s: Array  # (m,) of the corners
    before: Array  # (m,) p of the part before the corner
    after: Array  # (m,) p of the part after the corner
    move: Array  # (m,) s, completely after the corner


def no_corners() -> Corners:
    """Return the corners of a smooth motion: none."""
    return Corners(np.empty(0), np.empty((0, 3)), np.empty((0, 3)))


def rounded(sharp: Array, t: Array, start_rad_s: Array, corners: Corners, acceleration: float) -> Array:
    """Return a motion with rounded corners.

    Parameters
    ----------
    sharp : (n, 3, 3) array
        Angle, rate and acceleration as rows, for each time.
    t : (n,) array, s
        Times, from 0 on.
    start_rad_s : (3,) array, rad/s
        Rates of `sharp` at 0 s, where the rounded motion is at rest.
    corners : Corners
        Its jumps.
    acceleration : float, rad/s²
        Magnitude that is added to or subtracted from the acceleration of `sharp` within a window.

    Returns
    -------
    (n, 3, 3) array
        Rows whose rates and accelerations are the derivatives of the angles.
    """
    result = sharp.copy()
    for axis in range(3):
        knots, motion = _pieces(start_rad_s[axis], corners, axis, acceleration)
        if not len(knots):
            continue
        piece = np.searchsorted(knots, t, side="right") - 1
        inside = piece >= 0  # the last piece of a window is rest
        since = np.where(inside, t - knots[piece], 0.0)
        angle, rate, push = (motion[piece] * inside[:, None]).T
        result[:, 0, axis] += angle + rate * since + 0.5 * push * since**2
        result[:, 1, axis] += rate + push * since
        result[:, 2, axis] += push
    return result


def least_acceleration(start_rad_s: Array, corners: Corners) -> float:
    """Return the smallest acceleration at which windows neither overlap nor begin before the start.

    Parameters
    ----------
    start_rad_s : (3,) array, rad/s
        Initial rates of the motion.
    corners : Corners
        Its jumps.

    Returns
    -------
    float, rad/s²
        0 if there are no corners, infinite if no acceleration is sufficient.
    """
    return max(_least(_windows(start_rad_s[axis], corners, axis)) for axis in range(3))


def format_acceleration(acceleration: float) -> str:
    """Return the text of a smallest acceleration, rounded up to six digits."""
    return f"{UP.create_decimal(str(acceleration)):g}"


def _pieces(start: float, corners: Corners, axis: int, acceleration: float) -> tuple[Array, Array]:
    """Return the correction of one axis: start times of its pieces, and angle, rate, acceleration there."""
    kinds = [
        _catch_up(np.array([start]), acceleration),
        _move(*_jumps(corners.t_s, corners.angle_rad[:, axis]), acceleration),
        _blend(*_jumps(corners.t_s, corners.rate_rad_s[:, axis]), acceleration),
    ]
    begins = np.concatenate([begin for begin, _ in kinds])  # (m, 3)
    motion = np.concatenate([motion for _, motion in kinds])  # (m, 3, 3)
    order = np.argsort(begins[:, 0], kind="stable")
    # Rounding errors may swap the times of windows that just touch.
    return np.maximum.accumulate(begins[order].ravel()), motion[order].reshape(-1, 3)


def _catch_up(rate: Array, a: float) -> tuple[Array, Array]:
    """Return the correction from rest at 0 s to a motion with a rate: beyond that rate, then back to it."""
    rate = rate[rate != 0]
    beyond = rate / np.sqrt(2)
    push, zero = a * np.sign(rate), np.zeros_like(rate)
    turn, end = np.abs(rate + beyond) / a, np.abs(rate + 2 * beyond) / a
    return _three(
        (zero, zero, -rate, push),
        (turn, -beyond * np.abs(beyond) / (2 * a), beyond, -push),
        end,
    )


def _move(t: Array, jump: Array, a: float) -> tuple[Array, Array]:
    """Return the correction from rest to rest: acceleration over half of the way, then deceleration."""
    half, push, zero = np.sqrt(np.abs(jump) / a), a * np.sign(jump), np.zeros_like(jump)
    return _three((t, -jump, zero, push), (t + half, -jump / 2, push * half, -push), t + 2 * half)


def _blend(t: Array, jump: Array, a: float) -> tuple[Array, Array]:
    """Return the correction from rate to rate: constant acceleration, symmetric about the corner."""
    half, push, zero = np.abs(jump) / (2 * a), a * np.sign(jump), np.zeros_like(jump)
    return _three((t - half, zero, zero, push), (t, jump * half / 4, -jump / 2, push), t + half)


def _three(first: tuple[Array, ...], second: tuple[Array, ...], end: Array) -> tuple[Array, Array]:
    """Return times (m, 3) and motion (m, 3, 3) of windows of two pieces followed by rest."""
    begins = np.stack([first[0], second[0], end], axis=1)
    return begins, np.stack(
        [np.stack(first[1:], axis=1), np.stack(second[1:], axis=1), np.zeros((len(end), 3))], axis=1
    )


def _jumps(t: Array, jump: Array) -> tuple[Array, Array]:
    return t[jump != 0], jump[jump != 0]


def _windows(start: float, corners: Corners, axis: int) -> Windows:
    """Return the windows of one axis in order; the start is included even without an initial rate."""
    moved_at, angle = _jumps(corners.t_s, corners.angle_rad[:, axis])
    blent_at, rate = _jumps(corners.t_s, corners.rate_rad_s[:, axis])
    none, share = np.zeros_like(angle), np.abs(rate) / 2
    rows = np.concatenate(
        [
            [[0.0, 0.0, (1 + np.sqrt(2)) * abs(start), 0.0]],
            np.stack([moved_at, none, none, 2 * np.sqrt(np.abs(angle))], axis=1),
            np.stack([blent_at, share, share, np.zeros_like(share)], axis=1),
        ]
    )
    return Windows(*rows[np.argsort(rows[:, 0], kind="stable")].T)


def _least(windows: Windows) -> float:
    """Return the smallest a with ``(after + before of the next) / a + move / sqrt(a)`` within each gap."""
    gap, move = np.diff(windows.t_s), windows.move[:-1]
    steady = windows.after[:-1] + windows.before[1:]
    needed = (steady > 0) | (move > 0)
    gap, move, steady = gap[needed], move[needed], steady[needed]
    with np.errstate(divide="ignore", over="ignore"):  # without a gap no acceleration is sufficient
        root = (move + np.sqrt(move**2 + 4 * steady * gap)) / (2 * gap)
    return float(np.max(root**2, initial=0.0))


CONFIG = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

# Far beyond any motion of the actuator; its square remains finite.
LARGEST = 1e4

Bounded = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Triple = tuple[Bounded, Bounded, Bounded]
Time = Annotated[float, Field(ge=0, le=LONGEST_s)]

ZERO: Triple = (0.0, 0.0, 0.0)


# Short enough that a difference of 10 rad/s² moves the angle by only 2 mrad.
ACCELERATION_FADE_s = 0.1

# Coefficients of powers 0 to 5 of the time share, (3, 6): polynomials with an angle, a rate or an
# acceleration
# acceleration of 1 at the start, and all three 0 at the end.
FADING = np.array(
    [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
    ]
)


class Approach(BaseModel):
    """Transition from a stated motion to the shape; before it begins, the pose is held."""

    model_config = CONFIG

    start_s: Time = Field(0.0, description="start of the approach, s")
    lasts_s: Annotated[float, Field(ge=1e-6, le=LONGEST_s)] = Field(
        1.0, description="duration of the approach, s"
    )
    angle_rad: Triple = Field(ZERO, description="pose at the start, rad")
    rate_rad_s: Triple = Field(ZERO, description="rates at the start, rad/s")
    acceleration_rad_s2: Triple = Field(ZERO, description="accelerations at the start, rad/s²")
    shape_s: Time = Field(0.0, description="time of the shape at the start, s")

    def join(self, shape: Callable[[Array], Array], t: Array) -> Array:
        """Return the motion at times `t` (s), in the form of a shape: (n, 3, 3)."""
        since = t - self.start_s
        samples = shape(self.shape_s + np.maximum(since, 0.0))
        begun = np.array([self.angle_rad, self.rate_rad_s, self.acceleration_rad_s2])
        samples += faded(begun - shape(np.array([self.shape_s]))[0], np.maximum(since, 0.0), self.lasts_s)
        samples[since < 0] = [begun[0], np.zeros(3), np.zeros(3)]
        return samples


def faded(difference: Array, since: Array, lasts_s: float) -> Array:
    """Return the remainder of a difference of two motions as it fades.

    Parameters
    ----------
    difference : (3, 3) array
        Angle, rate, acceleration as rows, at the start.
    since : (n,) array, s
        Times since then.
    lasts_s : float, s
        Time after which the difference is 0.

    Returns
    -------
    (n, 3, 3) array
    """
    fade_s = min(lasts_s, ACCELERATION_FADE_s)
    return _faded(difference[:2], since, lasts_s, 0) + _faded(difference[2:], since, fade_s, 2)


def _faded(rows: Array, since: Array, lasts_s: float, first: int) -> Array:
    """Return the remainder of rows that fade together; the first row is the derivative `first`."""
    share = np.minimum(since / lasts_s, 1.0)
    remainder = np.zeros((len(since), 3, 3))
    for order, row in enumerate(rows, first):
        polynomial = np.polynomial.Polynomial(FADING[order])
        for derivative in range(3):
            weight = polynomial.deriv(derivative)(share) * lasts_s ** (order - derivative)
            weight[share >= 1.0] = 0.0
            remainder[:, derivative] += weight[:, None] * row
    return remainder
