"""Windows of logs: their angles under given parameters from free starts, and the slopes of these.

In each window the plant starts from a state of its own (multiple shooting). The start is eliminated: at its
best value the residuals are orthogonal to their slopes by it, and slopes by parameters count only in their
part that no start can explain (variable projection).

An angle that counts is used where its count changes: between two rows it has passed the edge between the
counts, at a time within the period that is not known. The middle of the two computed angles is compared with
the edge; the difference is uniform within half of the angle that the hinge turns in a period. Within a count
the error of the centre repeats with the motion, which white noise would not do.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import ceil
from typing import NamedTuple

import numpy as np

from spheretwin.electronics.logged_currents import mean_currents
from spheretwin.machine.log import MEASURED, Log, check_numbers
from spheretwin.machine.model import EDGE_SHARE, Model
from spheretwin.machine.parameters import Machine, Parameter, Setup, sensor_angles
from spheretwin.machine.state_estimation import Shadow, hold_last_value
from spheretwin.models.base.arrays import Array, Booleans
from spheretwin.models.base.errors import InputError
from spheretwin.models.coil_group import PerGroup, of_each_group
from spheretwin.plant.learned_torque import learned_torques
from spheretwin.plant.plants import Plants

# Rows may be this share of their distance from where they should be; the plant step assumes equal distances.
_JITTER = 0.2

# Differences for the slopes by the start.
START_STEP = np.repeat([1e-5, 1e-4], 3)  # rad, rad/s

# Of the size of a parameter.
STEP_SHARE = 1e-3

# Coulomb friction acts around each step: with 1 ms, angles were wrong by up to 90 µrad after a reversal, and
# inertia had a bias of half of its standard deviation; with half of it they are within 5 µrad of MuJoCo's.
LONGEST_STEP_s = 5e-4

_START_ITERATIONS = 4

# Of the deviation that the noise gives: a start that moves less has arrived.
_ARRIVED = 1e-2


class Window(NamedTuple):
    """Part of a log without gaps."""

    log: Log
    machine: Machine
    first: int
    """Row of the start."""
    rows: int
    """Rows after the start."""
    start: Array
    """(6,) angles and rates at the start as the shadow estimates them."""
    rate_rad_s: Array
    """(rows, 3) rates after the start, estimated by the shadow; of `observed` alone."""

    @property
    def period_s(self) -> float:
        """Mean time between two rows."""
        times = self.log.t_s[self.first : self.first + self.rows + 1]
        return float(times[-1] - times[0]) / self.rows

    def observed(self) -> tuple[Array, Array]:
        """Return measured angles and the standard deviations of their errors, (rows, 3), rad.

        NaN where none was measured. One that counts is an edge between counts; in a window without an edge,
        the count is used once.
        """
        measured, is_count = self.measured()
        rates_rad_s = np.vstack([self.start[3:], self.rate_rad_s])
        turned_rad = 0.5 * np.abs(rates_rad_s[1:] + rates_rad_s[:-1]) * self.period_s
        return measured, angle_deviation(self.machine.model, turned_rad, is_count)

    def measured(self) -> tuple[Array, Booleans]:
        """Return measured angles (rows, 3), rad, and where a count is used for lack of an edge."""
        model, rows = self.machine.model, self.log.angle_rad[self.first : self.first + self.rows + 1]
        measured, is_count = rows[1:].copy(), np.zeros((self.rows, 3), bool)
        for i in np.flatnonzero(model.half_count_rad):
            measured[:, i] = np.where(rows[:-1, i] == rows[1:, i], np.nan, 0.5 * (rows[:-1, i] + rows[1:, i]))
            if not np.any(np.isfinite(measured[:, i])):
                measured[self.rows // 2, i] = rows[self.rows // 2, i]
                is_count[:, i] = True
        return measured, is_count

    def currents(self, delay_s: float, lag_s: PerGroup) -> Array:
        """Return the mean currents between the rows, (rows, groups)."""
        log, measured = self.log, self.log.currents == MEASURED
        # Some rows before and after: for delays, for shifted clocks, and until the lag has forgotten its
        # start.
        first = max(self.first - _ROWS_BEFORE, 0)
        last = min(self.first + self.rows + 1 + _ROWS_BEFORE, len(log))
        samples = hold_last_value(log.current_A[first:last])
        edges = log.t_s[first : self.first + self.rows + 1]
        means = np.empty((len(edges) - 1, samples.shape[1]))
        if measured:  # behind the drive
            delay_s, lag_s = delay_s - self.machine.model.delay_s, 0.0
        lags_s = np.maximum(of_each_group(lag_s, samples.shape[1]), 0.0)
        mean_currents(
            log.t_s[first:last], samples, edges, delay_s, lags_s, measured, samples[0].copy(), means
        )
        return means[self.first - first :]

    def reported_angles(self, setups: Sequence[Setup], plants: Plants, starts: Array) -> Array:
        """Return what sensors report at starts and at the rows after them, (setups, rows + 1, 3).

        Parameters
        ----------
        setups : sequence of Setup
        plants : Plants
            Theirs; left at the end of the window.
        starts : (setups, 6) array
        """
        plants.set_state(starts[:, :3], starts[:, 3:])
        means = {times: self.currents(*times) for times in {(one.delay_s, one.lag_s) for one in setups}}
        currents = np.stack([means[one.delay_s, one.lag_s] + one.current_offset_A for one in setups], axis=1)
        angles_rad = self._roll_out(plants, currents)
        reached = np.concatenate([starts[None, :, :3], angles_rad])
        first = self.log.angle_rad[self.first]
        return np.stack([sensor_angles(setup, reached[:, lane], first) for lane, setup in enumerate(setups)])

    def _roll_out(self, plants: Plants, currents: Array) -> Array:
        """Return the angles that plants reach under currents (rows, setups, groups)."""
        model, steps = self.machine.model, ceil(self.period_s / LONGEST_STEP_s - 0.05)
        step_s = self.period_s / steps
        if not model.learned["on"][0]:
            return plants.roll_out(currents, np.zeros(3), step_s, steps)
        angles_rad, size = [], max(round(_HELD_s / self.period_s), 1)
        for first in range(0, len(currents), size):  # the learned torque of the middle of some rows is held
            rows, qdot = currents[first : first + size], plants.qdot_rad_s
            middle = plants.q_rad + 0.5 * len(rows) * self.period_s * qdot
            mean_A = rows[:, 0].mean(axis=0)
            torque_Nm = learned_torques(model.learned, model.parameters, middle, qdot, mean_A)
            angles_rad.append(plants.roll_out(rows, -torque_Nm, step_s, steps))
        return np.concatenate(angles_rad)


_ROWS_BEFORE = 20

# The rotor hardly moves meanwhile.
_HELD_s = 0.005


def angle_deviation(model: Model, turned_rad: Array, is_count: Booleans) -> Array:
    """Return the standard deviations of the errors of angles (rows, 3), rad.

    Parameters
    ----------
    model : Model
    turned_rad : (rows, 3) array
        Angle that each hinge turns until each row: an edge has passed at some time within it.
    is_count : (rows, 3) array of bool
        Where a count is used for lack of an edge.
    """
    count_rad = 2 * model.half_count_rad
    spread_rad = np.clip(np.where(is_count, np.inf, turned_rad), EDGE_SHARE * count_rad, count_rad)
    return np.hypot(model.noise_rad, spread_rad / np.sqrt(12))


def comparable_angles(model: Model, angles: Array) -> Array:
    """Return computed angles (lanes, rows, 3) for comparison with measured ones, from (lanes, rows + 1, 3).

    Of an angle that counts it is the mean of two rows, which is compared with the edge between counts.
    """
    return np.where(model.half_count_rad > 0, 0.5 * (angles[:, 1:] + angles[:, :-1]), angles[:, 1:])


class Part(NamedTuple):
    """Window under given parameters, with the best start."""

    residual: Array
    """(rows, 3) angles, measured minus computed over the deviation of the error; 0 if not measured."""
    information: Array
    """(p, p): JᵀJ of the slopes J of the residuals that no start explains."""
    gradient: Array
    """(p,): Jᵀ times the residuals."""
    squares: float
    """Sum of the squares of the residuals."""
    used: int
    """Angles that were measured, less the six numbers of a free start."""


def windows_of(log: Log, machine: Machine, window_s: float) -> list[Window]:
    """Cut a log into windows.

    Raises
    ------
    InputError
        No part of the log without gaps is as long as a window, or a window has too few rows.
    """
    check_numbers(log)
    period_s = float(np.median(np.diff(log.t_s)))
    if period_s <= 0:
        raise InputError(f"log {log.name}: expected rising times, received a period of {period_s:g} s")
    rows = round(window_s / period_s)
    if rows < 10:
        raise InputError(
            f"log {log.name}: expected windows of at least ten rows, {10 * period_s:.3g} s, received"
            f" {window_s:.3g} s"
        )
    even = np.abs(np.diff(log.t_s) - period_s) < _JITTER * period_s
    ends = np.concatenate([[-1], np.flatnonzero(~even), [len(even)]])
    firsts = [
        int(first) for before, until in pairwise(ends) for first in range(before + 1, until - rows + 1, rows)
    ]
    if not firsts:
        raise InputError(
            f"log {log.name}: expected {window_s:.3g} s without gaps, received at most"
            f" {period_s * (np.max(np.diff(ends)) - 1):.3g} s"
        )
    estimated = Shadow(machine.model).advance(log)
    q_rad, qdot_rad_s = estimated["q_estimated_rad"], estimated["qdot_estimated_rad_s"]
    return [
        Window(
            log,
            machine,
            first,
            rows,
            np.concatenate([q_rad[first], qdot_rad_s[first]]),
            qdot_rad_s[first + 1 : first + rows + 1],
        )
        for first in firsts
    ]


class Shooting:
    """All windows, with their starts, which follow the parameters.

    Parameters
    ----------
    windows : sequence of Window
    parameters : sequence of Parameter
    """

    def __init__(self, windows: Sequence[Window], parameters: Sequence[Parameter]) -> None:
        self.windows, self._parameters = list(windows), list(parameters)
        self._starts = [window.start for window in self.windows]
        self.observed = [window.observed() for window in self.windows]

    def parts(self, values: Array, *, slopes: bool) -> list[Part]:
        """Return all windows under some values of the parameters, at their best starts.

        Parameters
        ----------
        values : (p,) array
        slopes : bool
            False: without slopes by the parameters.
        """
        steps = STEP_SHARE * np.array([parameter.kind.size for parameter in self._parameters])
        points = [values, *(values + np.diag(steps) if slopes else ())]
        setups = {
            machine: [machine.setup(self._parameters, point) for point in points]
            for machine in {window.machine for window in self.windows}
        }
        return [
            self._part(number, setups[window.machine], steps) for number, window in enumerate(self.windows)
        ]

    def _part(self, number: int, setups: Sequence[Setup], steps: Array) -> Part:
        """Return a window under the first setup, with slopes from the others."""
        setup, *moved = setups
        for _ in range(_START_ITERATIONS):
            residual, by_start = self._shoot(number, setup)
            basis, triangle = np.linalg.qr(by_start)
            move = np.linalg.lstsq(triangle, -basis.T @ residual, rcond=None)[0]
            self._starts[number] = self._starts[number] + move
            if np.linalg.norm(triangle @ move) < _ARRIVED:
                break
        residual = residual - basis @ (basis.T @ residual)
        used = int(np.count_nonzero(np.isfinite(self.observed[number][0]))) - 6
        squares, by_row = float(residual @ residual), residual.reshape(-1, 3)
        if not moved:
            return Part(by_row, np.empty((0, 0)), np.empty(0), squares, used)
        starts = np.tile(self._starts[number], (len(setups), 1))
        residuals = self._residuals(number, self._angles(number, setups, starts))
        columns = (residuals[1:] - residuals[0]).T / steps
        columns -= basis @ (basis.T @ columns)
        return Part(by_row, columns.T @ columns, columns.T @ residual, squares, used)

    def _shoot(self, number: int, setup: Setup) -> tuple[Array, Array]:
        """Return residuals from the present start, and their slopes by it."""
        start = self._starts[number]
        moved = np.vstack([start, start + np.diag(START_STEP)])
        computed = self._angles(number, [setup] * len(moved), moved)
        residuals = self._residuals(number, computed)
        return residuals[0], (residuals[1:] - residuals[0]).T / START_STEP

    def _angles(self, number: int, setups: Sequence[Setup], starts: Array) -> Array:
        """Return what the sensors report at each start and after it, (lanes, rows + 1, 3)."""
        plants = Plants([setup.plant for setup in setups])
        return self.windows[number].reported_angles(setups, plants, starts)

    def _residuals(self, number: int, angles: Array) -> Array:
        measured, deviation = self.observed[number]
        computed = comparable_angles(self.windows[number].machine.model, angles)
        difference = (measured - computed) / deviation
        return np.where(np.isnan(difference), 0.0, difference).reshape(len(computed), -1)


def normal_equations(parts: Sequence[Part]) -> tuple[Array, Array]:
    """Return information and gradient of all windows."""
    information: Array = np.sum([part.information for part in parts], axis=0)
    gradient: Array = np.sum([part.gradient for part in parts], axis=0)
    return information, gradient
