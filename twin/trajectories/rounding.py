"""Corners of a trajectory rounded at a stated acceleration, each within a window of its own.

Beside the windows the motion stays as it is. A jump of rate is spread evenly about its time: the parabolic
blend. A jump of angle becomes the quickest move from rest to rest, which begins at the jump. A start with a
rate becomes the quickest catching up from rest. All of these are a correction of constant acceleration by
pieces, which is added to the motion.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import ROUND_CEILING, Context
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.models.telemetry.csv_series import LONGEST_s

Array = NDArray[np.float64]

# How the smallest acceleration is told: in six digits, rounded up.
UP = Context(prec=6, rounding=ROUND_CEILING)


class Corners(NamedTuple):
    """Times at which a motion jumps; where both jump at once, their windows cannot lie apart."""

    t_s: Array
    """(m,) from 0 on, rising; the motion after the jump holds from there on."""
    angle_rad: Array
    """(m, 3) jumps of the angles, between poses at rest."""
    rate_rad_s: Array
    """(m, 3) jumps of the rates."""


class Windows(NamedTuple):
    """Corners of one axis: at an acceleration a, what lies about them lasts ``p / a + s / sqrt(a)``."""

    t_s: Array  # (m,) of the corners
    before: Array  # (m,) p of what lies before the corner
    after: Array  # (m,) p of what lies after it
    move: Array  # (m,) s, all of it after the corner


def no_corners() -> Corners:
    """Corners of a smooth motion."""
    return Corners(np.empty(0), np.empty((0, 3)), np.empty((0, 3)))


def rounded(sharp: Array, t: Array, start_rad_s: Array, corners: Corners, acceleration: float) -> Array:
    """Motion with its corners rounded.

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
        What is added to the acceleration of `sharp` within a window, up or down.

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
    """Smallest acceleration at which no window reaches into another, or to before the start.

    Parameters
    ----------
    start_rad_s : (3,) array, rad/s
        Rates with which the motion begins.
    corners : Corners
        Its jumps.

    Returns
    -------
    float, rad/s²
        0 where there is nothing to round, infinite where no acceleration is enough.
    """
    return max(_least(_windows(start_rad_s[axis], corners, axis)) for axis in range(3))


def told(acceleration: float) -> str:
    """A smallest acceleration in a few digits, of which none is too small."""
    return f"{UP.create_decimal(str(acceleration)):g}"


def _pieces(start: float, corners: Corners, axis: int, acceleration: float) -> tuple[Array, Array]:
    """Correction of one axis: times at which its pieces begin, and angle, rate, acceleration there."""
    kinds = [
        _catching_up(np.array([start]), acceleration),
        _move(*_jumps(corners.t_s, corners.angle_rad[:, axis]), acceleration),
        _blend(*_jumps(corners.t_s, corners.rate_rad_s[:, axis]), acceleration),
    ]
    begins = np.concatenate([begin for begin, _ in kinds])  # (m, 3)
    motion = np.concatenate([motion for _, motion in kinds])  # (m, 3, 3)
    order = np.argsort(begins[:, 0], kind="stable")
    # Where windows just touch, rounding may part them by less than nothing.
    return np.maximum.accumulate(begins[order].ravel()), motion[order].reshape(-1, 3)


def _catching_up(rate: Array, a: float) -> tuple[Array, Array]:
    """From rest at 0 s to what moves away at a rate: pushed beyond that rate, then back to it."""
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
    """From rest to rest: pushed half of the way, braked the other half."""
    half, push, zero = np.sqrt(np.abs(jump) / a), a * np.sign(jump), np.zeros_like(jump)
    return _three((t, -jump, zero, push), (t + half, -jump / 2, push * half, -push), t + 2 * half)


def _blend(t: Array, jump: Array, a: float) -> tuple[Array, Array]:
    """From rate to rate: pushed from before the corner until as long after it."""
    half, push, zero = np.abs(jump) / (2 * a), a * np.sign(jump), np.zeros_like(jump)
    return _three((t - half, zero, zero, push), (t, jump * half / 4, -jump / 2, push), t + half)


def _three(first: tuple[Array, ...], second: tuple[Array, ...], end: Array) -> tuple[Array, Array]:
    """Times (m, 3) and motion (m, 3, 3) of windows that are two pieces, and rest."""
    begins = np.stack([first[0], second[0], end], axis=1)
    return begins, np.stack(
        [np.stack(first[1:], axis=1), np.stack(second[1:], axis=1), np.zeros((len(end), 3))], axis=1
    )


def _jumps(t: Array, jump: Array) -> tuple[Array, Array]:
    return t[jump != 0], jump[jump != 0]


def _windows(start: float, corners: Corners, axis: int) -> Windows:
    """Windows of one axis in their order; the start is there even without a rate: nothing is before it."""
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
    """Smallest a with ``(after + before of the next) / a + move / sqrt(a)`` no longer than each gap."""
    gap, move = np.diff(windows.t_s), windows.move[:-1]
    steady = windows.after[:-1] + windows.before[1:]
    needed = (steady > 0) | (move > 0)
    gap, move, steady = gap[needed], move[needed], steady[needed]
    with np.errstate(divide="ignore", over="ignore"):  # no gap: no acceleration is enough
        root = (move + np.sqrt(move**2 + 4 * steady * gap)) / (2 * gap)
    return float(np.max(root**2, initial=0.0))


CONFIG = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

# Far beyond any motion of the actuator, and far from where squares of numbers overflow.
LARGEST = 1e4

Bounded = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Triple = tuple[Bounded, Bounded, Bounded]
Time = Annotated[float, Field(ge=0, le=LONGEST_s)]

ZERO: Triple = (0.0, 0.0, 0.0)


# Soon enough that 10 rad/s² of difference move the angle by 2 mrad.
SOON_s = 0.1

# Powers 1 to 5 of the share of the way, (3, 6): an angle, a rate and an acceleration of 1 at the start, each
# alone, and none of the three at the end.
FADING = np.array(
    [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
    ]
)


class Approach(BaseModel):
    """From a stated motion to the shape; before it begins, the pose is held."""

    model_config = CONFIG

    start_s: Time = Field(0.0, description="time at which it begins, s")
    lasts_s: Annotated[float, Field(ge=1e-6, le=LONGEST_s)] = Field(
        1.0, description="how long it takes until the shape is followed, s"
    )
    angle_rad: Triple = Field(ZERO, description="pose at its beginning, rad")
    rate_rad_s: Triple = Field(ZERO, description="rates at its beginning, rad/s")
    acceleration_rad_s2: Triple = Field(ZERO, description="accelerations at its beginning, rad/s²")
    shape_s: Time = Field(0.0, description="time of the shape's own at its beginning, s")

    def join(self, shape: Callable[[Array], Array], t: Array) -> Array:
        """Motion at times `t` (s), as a shape's own: (n, 3, 3)."""
        since = t - self.start_s
        samples = shape(self.shape_s + np.maximum(since, 0.0))
        begun = np.array([self.angle_rad, self.rate_rad_s, self.acceleration_rad_s2])
        samples += faded(begun - shape(np.array([self.shape_s]))[0], np.maximum(since, 0.0), self.lasts_s)
        samples[since < 0] = [begun[0], np.zeros(3), np.zeros(3)]
        return samples


def faded(difference: Array, since: Array, lasts_s: float) -> Array:
    """What is left of a difference of two motions.

    Parameters
    ----------
    difference : (3, 3) array
        Angle, rate, acceleration as rows, at the start.
    since : (n,) array, s
        Times since then.
    lasts_s : float, s
        Time after which nothing is left.

    Returns
    -------
    (n, 3, 3) array
    """
    soon_s = min(lasts_s, SOON_s)
    return _faded(difference[:2], since, lasts_s, 0) + _faded(difference[2:], since, soon_s, 2)


def _faded(rows: Array, since: Array, lasts_s: float, first: int) -> Array:
    """The same of some rows that fade together, which begin with the derivative `first`."""
    share = np.minimum(since / lasts_s, 1.0)
    left = np.zeros((len(since), 3, 3))
    for order, row in enumerate(rows, first):
        polynomial = np.polynomial.Polynomial(FADING[order])
        for derivative in range(3):
            weight = polynomial.deriv(derivative)(share) * lasts_s ** (order - derivative)
            weight[share >= 1.0] = 0.0
            left[:, derivative] += weight[:, None] * row
    return left
