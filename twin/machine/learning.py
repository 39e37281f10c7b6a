"""Learning of the torque that a model lacks, from logs: ridge regression on the balance of torques.

Angles pass a Gaussian kernel, whose derivatives give rates and accelerations. The torque that these need,
less that of the model, which passes the same kernel, is what the model lacks. It is fitted by the form of
`plant.learned_torque`, whose features pass the kernel too, so that the kernel has no bias. Lengths and ridge
are those with the least error in a third of the training windows; the held-out windows of `identify` decide.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from spheretwin.machine.log import Log
from spheretwin.machine.model import Model
from spheretwin.machine.parameters import Machine
from spheretwin.machine.windows import windows_of
from spheretwin.models.base.arrays import Array, Booleans, Integers
from spheretwin.models.base.errors import InputError
from spheretwin.models.joint_chain import torque_on_hinges
from spheretwin.plant.learned_torque import FEATURES, MOST_CENTRES
from spheretwin.plant.plant_step import State, step, torque_matrix

# The kernel leaves 0.1 mN·m of a potentiometer's noise at 1 kHz, and half of a sine of 7.5 Hz.
SMOOTHING_s, REACH = 0.025, 4.0

# Rows of the balance, between which a rotor hardly moves; the plant step of an acceleration.
SPACING_s, STEP_s = 0.004, 1e-4

# Distance from held-out rows beyond which the kernel does not matter.
MARGIN_s = 2.5 * SMOOTHING_s

LENGTHS_rad, RIDGES = (0.12, 0.25, 0.5), (1e-3, 1e-4, 1e-2, 1e-1)

LEAST_GAIN, SURE = 0.1, 3.0
"""Least decrease of the held-out mean square of a hinge, and its number of standard errors."""


class Samples(NamedTuple):
    """Balance of torques of a log, smoothed."""

    q_rad: Array
    """(n, 3), as `qdot_rad_s` and `coil_Nm`, the torque of the coils on the hinges."""
    qdot_rad_s: Array
    coil_Nm: Array
    lacking_Nm: Array
    """(n, 3) torque on the hinges that the model lacks, through the kernel."""
    window: Integers
    """(n,) number of the window."""
    held_out: Booleans
    """(n,) in held-out windows, without any training row within the kernel."""
    train: Booleans
    kernel: Array


class Learned(NamedTuple):
    """Result of `learn`."""

    accepted: bool
    gain: Array
    """(3,) relative decrease of the held-out mean square on each hinge."""
    gain_deviation: Array
    """(3,) its standard deviation, from the differences between windows."""
    used: Booleans
    """(3,) whether the gain of a hinge is large and sure; the others have no learned torque."""
    rms_Nm: Array
    """(3,) rms of the learned torque over the logs."""
    half_width_Nm: Array
    """(3,) rms half width of its 95 % intervals over the logs."""
    arrays: dict[str, Array]
    """Of `plant.learned_torque`, and `root_Nm`, the root of the covariance of the weights of each hinge."""

    def text(self) -> str:
        """Return the result as a line."""
        hinges = ", ".join(
            f"{name} {gain:.0%} ± {1.96 * deviation:.0%}{'' if used else ' (not used)'}"
            for name, gain, deviation, used in zip(
                ("alpha", "beta", "gamma"), self.gain, self.gain_deviation, self.used, strict=True
            )
        )
        return f"learned torque: held-out mean square of the lacking torque smaller by {hinges}"

    def interval(self, q: Array, qdot: Array, coil_Nm: Array) -> tuple[Array, Array]:
        """Return torque and half widths of its 95 % intervals, (n, 3) N·m, within the range of the logs.

        Parameters
        ----------
        q, qdot, coil_Nm : (n, 3) arrays, rad, rad/s, N·m
            `coil_Nm` is the torque of the coils on the hinges.
        """
        centres, lengths = self.arrays["centre_rad"], self.arrays["length_rad"]
        scales = self.arrays["rate_rad_s"], self.arrays["torque_Nm"]
        torque, half = np.empty_like(q), np.empty_like(q)
        for i in range(3):
            columns = _features(q, qdot[:, i] / scales[0][i], coil_Nm[:, i] / scales[1][i], centres, lengths)
            torque[:, i] = columns @ self.arrays["weight_Nm"][:, :, i].ravel()
            half[:, i] = 1.96 * np.linalg.norm(columns @ self.arrays["root_Nm"][i], axis=1)
        return torque, half


def learn(logs: Sequence[Log], machines: Sequence[Machine], window_s: float, turn: int) -> Learned:
    """Learn the torque that a model lacks.

    Parameters
    ----------
    logs : sequence of Log
    machines : sequence of Machine
        Of each log, with the identified values.
    window_s : float, s
        Length of the windows of the identification.
    turn : int
        The last one of this number of windows is held out.

    Raises
    ------
    InputError
        A log has gaps, or is too short.
    """
    samples = [
        samples_of(log, one.model, one, window_s, turn) for log, one in zip(logs, machines, strict=True)
    ]
    if not any(one.held_out.any() for one in samples):
        raise InputError(
            "learned torque: expected logs with held-out windows of at least 0.15 s, received others"
        )
    lengths = min(product(LENGTHS_rad, repeat=3), key=lambda one: _trial(samples, np.array(one), RIDGES[0]))
    ridge = min(RIDGES, key=lambda one: _trial(samples, np.array(lengths), one))
    return _judged(samples, np.array(lengths), ridge)


def samples_of(log: Log, model: Model, machine: Machine, window_s: float, turn: int) -> Samples:
    """Return the balance of torques of a log without gaps."""
    period_s = float(np.median(np.diff(log.t_s)))
    window, *others = windows_of(log, machine, period_s * (len(log) - 1))
    rows, every = window.rows, max(round(SPACING_s / period_s), 1)
    if others or rows < len(log) - 1:
        raise InputError(f"learned torque: expected log {log.name} without gaps, received one with some")
    kernel, rate, acceleration = _kernels(every * period_s)
    current_A = window.currents(model.delay_s, model.lag_s)
    count = rows // every
    current_A = current_A[: count * every].reshape(count, every, -1).mean(axis=1)
    # Angles at the middle of the intervals of these currents, as means over the intervals.
    angle_rad = log.angle_rad[1 : count * every + 1] - model.offset_rad
    angle_rad = _through(angle_rad, np.full(every, 1 / every))[: (count - 1) * every + 1 : every]
    q, v, a = (_through(angle_rad, one) for one in (kernel, rate, acceleration))
    reach = (len(angle_rad) - len(q)) // 2
    current_A = current_A[reach : reach + len(q)]
    need, given, coil = np.empty_like(q), np.empty_like(q), np.empty_like(q)
    for row in range(len(q)):
        need[row], given[row], coil[row] = _balance(model, q[row], v[row], a[row], current_A[row])
    inner = slice(reach, len(q) - reach)
    times = np.arange(count) * every
    number = (times // max(round(window_s / period_s), 1))[reach:][: len(q)]
    held = (number % turn == turn - 1).astype(float)
    margin = max(round(MARGIN_s / (every * period_s)), 1)
    near = np.convolve(held, np.full(2 * margin + 1, 1 / (2 * margin + 1)), "same")[inner]
    lacking = need[inner] - _through(given, kernel)
    return Samples(q, v, coil, lacking, number[inner], near > 1 - 1e-9, near < 1e-9, kernel)


def _kernels(period_s: float) -> tuple[Array, Array, Array]:
    """Return the kernel, and those of the first and the second derivative, for `np.convolve`."""
    reach = round(REACH * SMOOTHING_s / period_s)
    t = period_s * np.arange(-reach, reach + 1)
    kernel = np.exp(-0.5 * (t / SMOOTHING_s) ** 2)
    kernel /= kernel.sum()
    rate = -t / SMOOTHING_s**2 * kernel
    rate /= -(rate @ t)
    curved = (t**2 / SMOOTHING_s**4 - 1 / SMOOTHING_s**2) * kernel
    curved -= kernel * curved.sum()
    return kernel, rate, curved * 2 / (curved @ t**2)


def _through(values: Array, kernel: Array) -> Array:
    """Return columns through a kernel, where it fits."""
    return np.stack([np.convolve(column, kernel, "valid") for column in values.T], axis=1)


def _balance(model: Model, q: Array, v: Array, a: Array, current_A: Array) -> tuple[Array, Array, Array]:
    """Return on the hinges: inertial torque, the model's torque, and that of the coils in it."""
    parameters, coil = model.parameters, np.empty(3)
    state, none = State(q, v), np.zeros(3)

    def accelerated(torque: Array) -> Array:
        after = step(state, current_A, -torque, parameters, STEP_s)
        return (after.qdot_rad_s - v) / STEP_s

    free = accelerated(none)
    response = np.stack([accelerated(unit) - free for unit in 0.01 * np.eye(3)], axis=1) / 0.01
    inertia = np.linalg.inv(response)
    torque_on_hinges(parameters.joint[0], q, torque_matrix(q, parameters) @ current_A, coil)
    return inertia @ a, inertia @ free, coil


def _features(q: Array, rate: Array, torque: Array, centres: Array, lengths: Array) -> Array:
    """Return the features of one hinge, (n, centres * FEATURES)."""
    squares = (((q[:, None] - centres) / lengths) ** 2).sum(axis=2)
    factors = np.stack([np.ones(len(q)), rate, torque], axis=1)
    return (np.exp(-0.5 * squares)[:, :, None] * factors[:, None]).reshape(len(q), -1)


def _centres(q: Array, lengths: Array) -> tuple[Array, float]:
    """Return poses that are far from each other, and the largest distance of a pose from them."""
    chosen = [int(np.argmin((((q - q.mean(axis=0)) / lengths) ** 2).sum(axis=1)))]
    distance = np.full(len(q), np.inf)
    while True:
        distance = np.minimum(distance, np.linalg.norm((q - q[chosen[-1]]) / lengths, axis=1))
        if len(chosen) == MOST_CENTRES or distance.max() < 0.5:
            return q[chosen], max(float(distance.max()), 0.5)
        chosen.append(int(np.argmax(distance)))


class _Ridge(NamedTuple):
    """Regression of all hinges on chosen rows."""

    centres: Array
    reach: float
    scales: tuple[Array, Array]
    columns: list[list[Array]]
    """By hinge and log, of all rows."""
    inverse: list[Array]
    weights: list[Array]


def _ridge(samples: Sequence[Samples], chosen: Sequence[Booleans], lengths: Array, ridge: float) -> _Ridge:
    inner = [(len(one.q_rad) - len(one.window)) // 2 for one in samples]
    poses = [
        one.q_rad[cut : len(one.q_rad) - cut][use]
        for one, cut, use in zip(samples, inner, chosen, strict=True)
    ]
    centres, reach = _centres(np.vstack(poses), lengths)
    rate_rad_s, torque_Nm = (
        np.max([np.abs(getattr(one, name)).max(axis=0) for one in samples], axis=0)
        for name in ("qdot_rad_s", "coil_Nm")
    )
    scales: tuple[Array, Array] = rate_rad_s, torque_Nm
    columns: list[list[Array]] = []
    inverse: list[Array] = []
    weights: list[Array] = []
    for i in range(3):
        columns.append([
            _through(
                _features(one.q_rad, one.qdot_rad_s[:, i] / scales[0][i], one.coil_Nm[:, i] / scales[1][i],
                          centres, lengths),
                one.kernel,
            )
            for one in samples
        ])  # fmt: skip
        A = np.vstack([rows[use] for rows, use in zip(columns[i], chosen, strict=True)])
        y = np.concatenate([one.lacking_Nm[use, i] for one, use in zip(samples, chosen, strict=True)])
        normal = A.T @ A + ridge * len(A) * np.eye(A.shape[1])
        inverse.append(np.asarray(np.linalg.inv(normal), np.float64))
        weights.append(inverse[i] @ (A.T @ y))
    return _Ridge(centres, reach, scales, columns, inverse, weights)


def _errors(samples: Sequence[Samples], fit: _Ridge, chosen: Sequence[Booleans]) -> tuple[Array, Array]:
    """Return lacking torques (n, 3), without and with the learned one."""
    before = [one.lacking_Nm[use] for one, use in zip(samples, chosen, strict=True)]
    learned = [
        np.stack([fit.columns[i][log][use] @ fit.weights[i] for i in range(3)], axis=1)
        for log, use in enumerate(chosen)
    ]
    return np.vstack(before), np.vstack(before) - np.vstack(learned)


def _trial(samples: Sequence[Samples], lengths: Array, ridge: float) -> float:
    """Return the mean square of a third of the training windows over that without a learned torque."""
    later = [one.train & (one.window // 4 % 3 == 2) for one in samples]
    fit = _ridge(samples, [one.train & ~use for one, use in zip(samples, later, strict=True)], lengths, ridge)
    before, after = _errors(samples, fit, later)
    return float(np.sum(np.mean(after**2, axis=0) / np.mean(before**2, axis=0)))


def _judged(samples: Sequence[Samples], lengths: Array, ridge: float) -> Learned:
    """Return the fit of all training windows, judged by the held-out ones."""
    fit = _ridge(samples, [one.train for one in samples], lengths, ridge)
    before, after = _errors(samples, fit, [one.held_out for one in samples])
    window = np.concatenate([1000 * log + one.window[one.held_out] for log, one in enumerate(samples)])
    means = np.array([
        np.stack([before[window == number] ** 2, after[window == number] ** 2]).mean(axis=1)
        for number in np.unique(window)
    ])  # fmt: skip
    total = means.sum(axis=0)
    gain = 1 - total[1] / total[0]
    without = total - means  # jackknife: each window left out
    spread = 1 - without[:, 1] / without[:, 0] - gain
    deviation = np.sqrt((len(means) - 1) / len(means) * np.sum(spread**2, axis=0))
    used = (gain > LEAST_GAIN) & (gain > SURE * deviation)
    # Rows share the noise within the kernel.
    shared = np.sqrt(4 * np.pi) * SMOOTHING_s / SPACING_s
    deviations = np.sqrt(shared * means[:, 1].mean(axis=0))
    roots = [deviations[i] * np.linalg.cholesky(fit.inverse[i]) for i in range(3)]
    weights = np.stack([fit.weights[i] * used[i] for i in range(3)], axis=1)
    arrays = {
        "centre_rad": fit.centres, "length_rad": lengths, "reach": np.array(fit.reach),
        "rate_rad_s": fit.scales[0], "torque_Nm": fit.scales[1],
        "weight_Nm": weights.reshape(len(fit.centres), FEATURES, 3), "root_Nm": np.stack(roots),
    }  # fmt: skip
    learned = Learned(bool(used.any()), gain, deviation, used, np.zeros(3), np.zeros(3), arrays)
    torque, half = learned.interval(
        *(np.vstack([getattr(one, name) for one in samples]) for name in ("q_rad", "qdot_rad_s", "coil_Nm"))
    )
    return learned._replace(
        rms_Nm=np.sqrt(np.mean(torque**2, axis=0)), half_width_Nm=np.sqrt(np.mean(half**2, axis=0))
    )
