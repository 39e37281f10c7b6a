"""Torque balance of a log: torque that the motion needs against the torque that the logged currents apply.

Both sides pass through the same Gaussian kernel, whose derivatives give rates and accelerations. The model of
the machine is `spheretwin.plant`; the fit leaves unknown what a machine may have besides it: inertia within a
factor, friction, a payload, a constant torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from spheretwin import plant
from spheretwin.machine.row_order import Integral
from spheretwin.models.base.arrays import Array, Integers
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.lagrangian import gravity_torque

# Standard deviation of the kernel: it leaves 0.1 mN·m of potentiometer noise of 0.02 degrees at 1 kHz, and
# half of a sine of 7.5 Hz. The rotor turns little within a block.
SMOOTHING_s, BLOCK_s, REACH = 0.025, 0.008, 4.0

# Windows of one log: more of them take longer and decide nothing.
RUNS, RUN_WINDOWS = 10, 40

# Factor of the machine's inertia over that of its scenario, also of the scenario's torque over the machine's.
LEAST_SCALE, MOST_SCALE = 0.3, 3.0
FRICTION_RATE_rad_s = 0.05
STEP_s = 1e-4
NOISE_MARGIN = 3.0


class Motion(NamedTuple):
    """Motion of a log under one reading of its angles."""

    need_Nm: Array
    """Torque on the hinges (windows, 3) for the accelerations, without friction."""
    columns_Nm_A: Array
    """Torque on the hinges of one ampere in each group (blocks, 3, groups)."""
    unknown_Nm: Array
    """Torques of unit unknowns (windows, 3, 7): Coulomb and viscous friction of each hinge, weight moment."""


class TorqueBalance:
    """Windows of a log, with the model of its machine.

    Parameters
    ----------
    angle_s, angle_rad : (n,) and (n, 3) arrays
        Rising times of the angles, and the angles; all finite.
    current_s, current_A : (m,) and (m, groups) arrays
        The same of the currents.
    zero_order_hold : bool
        True for currents that hold until the next row, False for samples of a continuous current.
    parameters : plant.Parameters
        Model; its friction is not used.
    gaps : sequence of (start, end), s
        Intervals without samples.
    """

    def __init__(
        self,
        angle_s: Array,
        angle_rad: Array,
        current_s: Array,
        current_A: Array,
        zero_order_hold: bool,
        parameters: plant.Parameters,
        gaps: Sequence[tuple[float, float]] = (),
    ) -> None:
        self._current = Integral(current_s, current_A, zero_order_hold)
        none = np.zeros(3)
        self._parameters = parameters._replace(coulomb_Nm=none, viscous_Nm_s=none)
        period_s = float(np.median(np.diff(angle_s)))
        block_s = max(1, round(BLOCK_s / period_s)) * period_s
        first_s, last_s = max(angle_s[0], current_s[0]), min(angle_s[-1], current_s[-1])
        edges = first_s + block_s * np.arange(max(0, int((last_s - first_s) / block_s + 1e-9)) + 1)
        places, self._kernels = _kernels(block_s)
        reach = places[-1]
        centres = np.arange(reach, len(edges) - 1 - reach, max(1, round(SMOOTHING_s / block_s)))
        for start_s, end_s in gaps:
            lost = (edges[centres + reach + 1] > start_s) & (edges[centres - reach] < end_s)
            centres = centres[~lost]
        if len(centres) > RUNS * RUN_WINDOWS:
            starts = np.linspace(0, len(centres) - RUN_WINDOWS, RUNS).astype(int)
            centres = centres[np.unique(starts[:, None] + np.arange(RUN_WINDOWS))]
        blocks, windows = np.unique(centres[:, None] + places, return_inverse=True)
        self._windows = windows.reshape(len(centres), len(places))
        self._starts, self._ends = edges[blocks], edges[blocks + 1] if len(blocks) else edges[:0]
        self._angle_rad = Integral(angle_s, angle_rad, zero_order_hold=False).mean(self._starts, self._ends)
        self.windows = len(centres)

    def currents(self, offset_s: float = 0.0) -> Array:
        """Return the mean currents (blocks, groups), A; they act `offset_s` after their time."""
        return self._current.mean(self._starts - offset_s, self._ends - offset_s)

    def motion(
        self, order: Sequence[int] = (0, 1, 2), signs: Sequence[int] = (1, 1, 1), factor: float = 1.0
    ) -> Motion:
        """Return the motion if hinge i has the angle ``factor * signs[i] * angle[order[i]]``."""
        angles = factor * self._angle_rad[:, list(order)] * np.array(signs)
        q, qdot, qddot = (self._filtered(angles, kernel) for kernel in self._kernels)
        columns = [rate_jacobian(pose).T @ plant.torque_matrix(pose, self._parameters) for pose in angles]
        unknown = np.zeros((len(q), 3, 7))
        for hinge in range(3):
            unknown[:, hinge, hinge] = np.tanh(qdot[:, hinge] / FRICTION_RATE_rad_s)
            unknown[:, hinge, 3 + hinge] = qdot[:, hinge]
        unknown[:, :, 6] = [gravity_torque(pose, 1.0) for pose in q]
        return Motion(self._need(q, qdot, qddot), np.array(columns), unknown)

    def moves(self) -> bool:
        """True if the accelerations of any angle exceed those that white noise of the sensors would have."""
        third = np.diff(self._angle_rad, 3, axis=0)[self._windows[:, 0]]
        noise_rad = np.sqrt(np.mean(third**2, axis=0) / 20)  # of a third difference: 1 + 9 + 9 + 1
        second = self._kernels[2]
        rms = np.sqrt(np.mean(self._filtered(self._angle_rad, second) ** 2, axis=0))
        return bool(np.any(rms > NOISE_MARGIN * np.linalg.norm(second) * noise_rad))

    def _need(self, q: Array, qdot: Array, qddot: Array) -> Array:
        """Return the torques on the hinges for accelerations (windows, 3), from the plant's step."""
        idle, torques = np.zeros(len(self._parameters.torque_gain)), np.eye(4, 3, -1)
        after = [
            [
                plant.step(plant.State(*state), idle, -torque, self._parameters, STEP_s).qdot_rad_s
                for torque in torques
            ]
            for state in zip(q, qdot, strict=True)
        ]
        accelerations = (np.reshape(after, (-1, 4, 3)) - qdot[:, None]) / STEP_s
        free = accelerations[:, 0]
        inverse_inertia = np.swapaxes(accelerations[:, 1:] - free[:, None], 1, 2)
        try:
            need = np.linalg.solve(inverse_inertia, (qddot - free)[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError:
            return np.full_like(q, np.nan)
        return need.astype(np.float64, copy=False)

    def applied(self, motion: Motion, currents: Array) -> Array:
        """Return the torque of currents on the hinges, (windows, 3), N·m."""
        torques = np.einsum("bij,bj->bi", motion.columns_Nm_A, currents)
        return self._filtered(torques, self._kernels[0])

    def group_torques(self, motion: Motion, currents: Array) -> Array:
        """Return the torque of each logged current in each group, (windows, 3, groups, logged), N·m."""
        weights = self._kernels[0][:, None, None]
        torques = [
            np.tensordot(weights * motion.columns_Nm_A[window], currents[window], (0, 0))
            for window in self._windows
        ]
        return np.array(torques)

    def _filtered(self, blocks: Array, kernel: Array) -> Array:
        return np.einsum("ewi,w->ei", blocks[self._windows], kernel)


def unexplained_share(motion: Motion, applied_Nm: Array) -> float:
    """Return the share of applied torques (windows, 3) that needed ones do not explain.

    What may be unknown is fitted within its bounds. Angles in a wrong unit pass the singular pose, where no
    torque is finite: they explain nothing.
    """
    if not np.all(np.isfinite(motion.need_Nm)):
        return 1.0
    target = _centred(applied_Nm[:, :, None])[:, 0]
    regressors = _centred(np.concatenate([motion.need_Nm[:, :, None], motion.unknown_Nm], axis=2))
    size = np.maximum(np.linalg.norm(regressors, axis=0), 1e-9)
    orthogonal, triangle = np.linalg.qr(regressors / size)
    coordinates = orthogonal.T @ target
    low = np.array([LEAST_SCALE, *[0.0] * 6, -np.inf]) * size
    high = np.array([MOST_SCALE, *[np.inf] * 7]) * size
    solution = lsq_linear(triangle, coordinates, (low, high), method="bvls")
    total = float(target @ target)
    outside = max(0.0, total - float(coordinates @ coordinates))
    return (outside + 2 * float(solution.cost)) / total if total > 0 else 1.0


def _centred(values: Array) -> Array:
    """Return (windows, 3, k) values less their mean for each hinge, as (3 windows, k)."""
    return (values - values.mean(axis=0)).reshape(-1, values.shape[2])


def effective_windows(torque_Nm: Array) -> float:
    """Return the number of windows among which the energy of a torque (windows, 3) is spread; 0 for NaN."""
    energy = np.sum((torque_Nm - torque_Nm.mean(axis=0)) ** 2, axis=1)
    largest = float(np.max(energy))
    if not 0 < largest < np.inf:
        return 0.0
    return float(np.sum(energy / largest) ** 2 / np.sum((energy / largest) ** 2))


def _kernels(block_s: float) -> tuple[Integers, tuple[Array, Array, Array]]:
    """Return the places of a kernel about its centre, and Gaussian kernels of value, rate and acceleration.

    They are exact for parabolas.
    """
    reach = int(np.ceil(REACH * SMOOTHING_s / block_s))
    places = np.arange(-reach, reach + 1)
    u = places * block_s
    smooth = np.exp(-((u / SMOOTHING_s) ** 2) / 2)
    smooth /= smooth.sum()
    first = smooth * u / np.sum(smooth * u * u)
    second = smooth * (u * u - np.sum(smooth * u * u))
    return places, (smooth, first, second / np.sum(second * u * u / 2))
