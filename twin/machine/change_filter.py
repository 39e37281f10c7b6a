"""Filter for changes: residuals of a log that are independent and normal if nothing has changed.

A log is used in blocks of 10 ms. In each the plant starts from the estimate, and its angles depend linearly
on the errors of the start, on those of the twin's parameters, and on a torque that no parameter explains,
which is constant within a block and independent from block to block. A Kalman filter over the blocks makes
residuals of unit variance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.machine.parameters import Machine, Parameter
from spheretwin.machine.windows import START_STEP, STEP_SHARE, Window, angle_deviation, comparable_angles
from spheretwin.models.base.arrays import Array, Booleans, Integers
from spheretwin.plant.plants import Plants

BLOCK_s = 0.01

MEMORY_s = 100.0
"""Time within which errors of the twin may drift by their tolerated size."""


class BlockRows(NamedTuple):
    """Some rows of a log, with what was measured in them."""

    window: Window
    measured: Array
    is_count: Booleans

    def part(self, first: int, last: int) -> BlockRows:
        """Return some of these rows, counted from the first of them."""
        window = self.window._replace(first=self.window.first + first, rows=last - first)
        return BlockRows(window, self.measured[first:last], self.is_count[first:last])

    def blocks(self) -> Iterator[BlockRows]:
        """Yield parts of the length of a block."""
        size = max(round(BLOCK_s / self.window.period_s), 1)
        for first in range(0, self.window.rows, size):
            yield self.part(first, min(first + size, self.window.rows))


class LinearBlock(NamedTuple):
    """Block of a log, linear in the errors of the state (6) and of the parameters (p)."""

    rows: BlockRows
    start: Array
    """(6,) state about which it is linear: angles and rates."""
    t_s: Array
    """(rows,) times of the rows."""
    period_s: float
    residual: Array
    """(m,) measured minus computed angles over their deviation, of those that were measured."""
    slopes: Array
    """(m, 6 + p) of the computed angles over their deviation."""
    row: Integers
    """(m,) row of each."""
    half: Booleans
    """(m,) True for the mean of two rows."""
    log_deviation: float
    """Sum of the logarithms of the deviations."""
    reached: Array
    """(6,) computed state at the end."""
    transition: Array
    """(6, 6 + p) its slopes."""

    @property
    def length_s(self) -> float:
        """Length of the block."""
        return self.period_s * len(self.t_s)


class FilterEstimate(NamedTuple):
    """Estimate of the filter; its arrays are not changed in place."""

    state: Array
    """(6,) angles and rates."""
    errors: Array
    """(p,) of the parameters."""
    covariance: Array
    """(6 + p, 6 + p)"""


class FilterStep(NamedTuple):
    """Block after the filter has used it."""

    block: LinearBlock
    whitened: Array
    """(m,) residuals of unit variance."""
    cost: float
    """Negative logarithm of the likelihood, less a constant."""
    whitener: Array
    """(m, m) inverse of the root of the covariance."""
    gain: Array
    """(6 + p, m) of the filter."""
    before: FilterEstimate

    @property
    def squares(self) -> float:
        """Sum of the squares of the residuals."""
        return float(self.whitened @ self.whitened)


class Linearisation:
    """Blocks of a machine about given states.

    Parameters
    ----------
    machine : Machine
    parameters : sequence of Parameter
        Those whose errors count.
    values : (p,) array
        Of the parameters.
    variance : float
        Of the errors of angles over that of the model.
    """

    def __init__(
        self, machine: Machine, parameters: Sequence[Parameter], values: Array, variance: float
    ) -> None:
        self._machine, self._parameters, self._values, self.variance = machine, parameters, values, variance
        steps = STEP_SHARE * np.array([parameter.kind.size for parameter in parameters])
        setup, *others = [machine.setup(parameters, point) for point in [values, *(values + np.diag(steps))]]
        self._setups = [setup] * 7 + others
        self._plants = Plants([setup.plant for setup in self._setups])
        self._scale = np.concatenate([START_STEP, steps])

    def changed(self, change: Array) -> Linearisation:
        """Return that of the machine with a change (p,) of the parameters."""
        return Linearisation(self._machine, self._parameters, self._values + change, self.variance)

    def block(self, rows: BlockRows, state: Array) -> LinearBlock:
        """Return some rows from a state before them."""
        window, used = rows.window, np.isfinite(rows.measured)
        starts = np.tile(state, (len(self._setups), 1))
        starts[1:7] += np.diag(START_STEP)
        path = window.reported_angles(self._setups, self._plants, starts)
        ends = np.hstack([self._plants.q_rad, self._plants.qdot_rad_s])
        turned_rad = np.abs(np.diff(path[0], axis=0))
        deviation_rad = angle_deviation(self._machine.model, turned_rad, rows.is_count)[used]
        deviation_rad *= np.sqrt(self.variance)
        row, hinge = np.nonzero(used)
        angles_rad = comparable_angles(self._machine.model, path)[:, row, hinge].T.copy()
        return LinearBlock(
            rows,
            state,
            window.log.t_s[window.first + 1 : window.first + window.rows + 1],
            window.period_s,
            (rows.measured[used] - angles_rad[:, 0]) / deviation_rad,
            (angles_rad[:, 1:] - angles_rad[:, :1]) / self._scale / deviation_rad[:, None],
            row,
            self._machine.model.half_count_rad[hinge] > 0,
            float(np.sum(np.log(deviation_rad))),
            ends[0],
            ((ends[1:] - ends[0]) / self._scale[:, None]).T,
        )


class ChangeFilter:
    """Kalman filter over blocks.

    Parameters
    ----------
    tolerated : (p,) array
        Standard deviations of errors of the twin.
    loads : (3,) sequence of int
        Places of the torques on the hinges among the parameters.
    torque_noise_Nm_s : float
        White torque on each hinge, root of its density, N·m·√s.
    estimate : FilterEstimate, optional
        Unless given, the state is awaited (`start`).
    """

    def __init__(
        self,
        tolerated: Array,
        loads: Sequence[int],
        torque_noise_Nm_s: float,
        estimate: FilterEstimate | None = None,
    ) -> None:
        self._tolerated, self._loads, self.torque_noise_Nm_s = tolerated, np.array(loads), torque_noise_Nm_s
        size = 6 + len(tolerated)
        self.estimate = estimate or FilterEstimate(np.zeros(6), np.zeros(size - 6), np.zeros((size, size)))

    def copy(self, estimate: FilterEstimate) -> ChangeFilter:
        """Return a filter like this one that goes on from an estimate."""
        return ChangeFilter(self._tolerated, self._loads.tolist(), self.torque_noise_Nm_s, estimate)

    def start(self, state: Array, covariance: Array) -> None:
        """Start from an estimate of angles and rates; errors of the twin stay as they are."""
        known = self.estimate.covariance.copy()
        known[:6] = known[:, :6] = 0.0
        known[:6, :6] = covariance
        places = 6 + np.arange(len(self._tolerated))
        known[places, places] = np.maximum(known[places, places], self._tolerated**2)
        self.estimate = FilterEstimate(state.copy(), self.estimate.errors, known)

    def advance(self, block: LinearBlock) -> FilterStep:
        """Use the next block."""
        before, P, C = self.estimate, self.estimate.covariance, block.slopes
        noise, keep = self.torque_noise_Nm_s**2 / block.length_s, remembered(block.length_s)
        error = np.concatenate([before.state - block.start, before.errors])
        load_C, load_A = C[:, 6 + self._loads], block.transition[:, 6 + self._loads]
        whitener = np.linalg.inv(np.linalg.cholesky(np.eye(len(C)) + C @ P @ C.T + noise * load_C @ load_C.T))
        innovation = block.residual - C @ error
        # The end of the block and the residuals depend on the same errors and torques.
        A = np.diag(np.concatenate([np.zeros(6), np.full(len(P) - 6, keep)]))
        A[:6] = block.transition
        cross = A @ P @ C.T
        cross[:6] += noise * load_A @ load_C.T
        scaled = cross @ whitener.T
        gain = scaled @ whitener
        P = A @ P @ A.T - scaled @ scaled.T
        P[:6, :6] += noise * load_A @ load_A.T
        places = np.arange(6, len(P))
        P[places, places] += (1 - keep**2) * self._tolerated**2
        move = gain @ innovation
        self.estimate = FilterEstimate(
            block.reached + block.transition @ error + move[:6],
            keep * before.errors + move[6:],
            0.5 * (P + P.T),
        )
        whitened = whitener @ innovation
        log_root = block.log_deviation - float(np.sum(np.log(np.diag(whitener))))
        return FilterStep(
            block, whitened, 0.5 * float(whitened @ whitened) + log_root, whitener, gain, before
        )


def remembered(length_s: float) -> float:
    """Return the share of an error of the twin that is left after a time."""
    return float(np.exp(-length_s / MEMORY_s))
