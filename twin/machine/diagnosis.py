"""Diagnosis of a log: the readings of its columns under which its currents explain its motion.

A reading states order and sign of the axes and of the groups, a clock offset and factors of units. The
diagnosis starts from the reading as logged. It goes on to another reading only if that leaves at most a
quarter of the unexplained torque: over 40 correct logs, the best wrong reading leaves 0.62 of it or more.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import cached_property
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from spheretwin.machine import group_order
from spheretwin.machine.group_order import Assignment
from spheretwin.machine.torque_balance import Motion, TorqueBalance, effective_windows, unexplained_share
from spheretwin.models.base.arrays import Array

MARGIN = 4.0
"""Factor by which another reading must reduce the unexplained share of the torque."""

TIE = 1.5
"""Factor between shares of readings that explain a log equally well."""

MOST_UNEXPLAINED = 0.5
"""Share of the torque that may be unexplained; 0.24 at most in 40 correct logs, with unknown disturbances."""

MOST_UNEXPLAINED_BY_GROUPS = 0.25
"""The same for another order of the groups: among so many, one explains 0.64 of random currents in 1.5 s."""

FEWEST_WINDOWS = 20
"""Windows among which the torque must be spread: a few transients fit wrong readings by chance."""

DEGREE = math.pi / 180
LARGEST_OFFSET_s, OFFSET_STEP_s, SMALLEST_OFFSET_s = 0.2, 0.01, 5e-3

AXES = tuple(product(permutations(range(3)), product((1, -1), repeat=3)))
"""Order and signs of the axes, as logged first."""


class Reading(NamedTuple):
    """One reading of the columns of a log."""

    order: tuple[int, ...]
    """Logged angle of each hinge."""
    signs: tuple[int, ...]
    groups: Assignment
    offset_s: float
    """Time after which a current acts."""
    angle_factor: float = 1.0
    current_factor: float = 1.0


class Diagnosis:
    """Readings of a log.

    Parameters
    ----------
    balance : TorqueBalance
    delay_s : float
        Time after which a current acts in the machine of the scenario.

    Attributes
    ----------
    logged, best : Reading
        As logged, and the one that explains the log.
    unexplained : float
        Share of the torque that the best reading does not explain.
    spread : float
        Windows among which the torque is spread, 0 for a log of noise alone; with fewer than
        `FEWEST_WINDOWS` no other reading is tried.
    """

    def __init__(self, balance: TorqueBalance, delay_s: float) -> None:
        self._balance, self._delay_s = balance, delay_s
        self._motions: dict[tuple, Motion] = {}
        self._shares: dict[tuple, float] = {}
        groups = balance.currents().shape[1]
        self.logged = self.best = Reading(*AXES[0], group_order.in_order(groups), delay_s)
        self.unexplained = 1.0
        self.spread = self._spread() if balance.windows and balance.moves() else 0.0
        if self.spread >= FEWEST_WINDOWS:
            self._improve()

    def _spread(self) -> float:
        """Return the largest spread of needed or applied torque, in windows.

        A payload that the scenario lacks is in the latter alone. In degrees, all of the needed torque may be
        where the angles come near the singular pose.
        """
        in_degrees = self.logged._replace(angle_factor=DEGREE)
        needed = (self._motion(unit).need_Nm for unit in (self.logged, in_degrees))
        return max(map(effective_windows, (self._applied(self.logged), *needed)))

    @property
    def decided(self) -> bool:
        """True if the log has enough torque and the best reading explains it."""
        return self.spread >= FEWEST_WINDOWS and self.unexplained <= MOST_UNEXPLAINED

    @cached_property
    def unverified_axes(self) -> tuple[list[int], list[tuple[int, int]]]:
        """Return the hinges whose sign, and the pairs whose order, the log does not determine."""
        shares = {(r.order, r.signs): self._share(r) for r in self._axes(self.best)}
        signs, pairs = [], []
        for hinge in range(3):
            flipped = tuple(-s if i == hinge else s for i, s in enumerate(self.best.signs))
            if self._is_near(shares[self.best.order, flipped]):
                signs.append(hinge)
        for i, j in ((0, 1), (0, 2), (1, 2)):
            order = list(self.best.order)
            order[i], order[j] = order[j], order[i]
            if self._is_near(min(shares[tuple(order), signs_] for _, signs_ in AXES[:8])):
                pairs.append((i, j))
        return signs, pairs

    def unverified_groups(self) -> list[int]:
        """Return the groups whose sign the log does not determine."""
        currents = self._currents(self.best)
        residual = group_order.quadratic(self._balance, self._motion(self.best), currents)
        groups = currents.shape[1]
        least = MARGIN * residual.value(np.eye(groups))
        return np.flatnonzero(group_order.flips(residual, groups) < least).tolist()

    def _is_near(self, share: float) -> bool:
        return share < MARGIN * self.unexplained

    def _improve(self) -> None:
        """Go on to better readings, one kind of error at a time; at last axes and groups together."""
        self.unexplained = self._share(self.best)
        while self._accept(self._single_errors(self.best)):
            pass
        if self.unexplained > MOST_UNEXPLAINED:
            self._accept(self._with_groups(reading) for reading in self._axes(self.best))

    def _accept(self, readings: Iterable[Reading]) -> bool:
        """Go on to the first of the best readings if it is better by the margin; return True if it is."""
        shares = [(self._share(reading), reading) for reading in readings]
        least = min(share for share, _ in shares)
        share, reading = next(entry for entry in shares if entry[0] <= TIE * least)
        most = MOST_UNEXPLAINED if reading.groups is self.best.groups else MOST_UNEXPLAINED_BY_GROUPS
        if MARGIN * share > self.unexplained or share > most:
            return False
        self.best, self.unexplained = reading, share
        return True

    def _single_errors(self, reading: Reading) -> Iterator[Reading]:
        """Yield the best reading with each kind of error, the simplest kind first.

        The actuator has symmetries: two changed signs of axes equal another order of the groups.
        """
        yield reading._replace(angle_factor=DEGREE)
        yield reading._replace(current_factor=1e-3)
        yield min(self._axes(reading), key=self._share)
        offset_s = self._offset(reading)
        if abs(offset_s - self._delay_s) > SMALLEST_OFFSET_s:
            yield reading._replace(offset_s=offset_s)
        yield self._with_groups(reading)

    def _axes(self, reading: Reading) -> Iterator[Reading]:
        return (reading._replace(order=order, signs=signs) for order, signs in AXES)

    def _with_groups(self, reading: Reading) -> Reading:
        """Return the reading with the order and the signs of the groups that explain most."""
        logged = self._currents(reading._replace(groups=self.logged.groups))
        residual = group_order.quadratic(self._balance, self._motion(reading), logged)
        return reading._replace(groups=group_order.search(residual, logged.shape[1]))

    def _offset(self, reading: Reading) -> float:
        """Return the time after which currents act that explains most: a scan, then parabolas."""

        def share(offset_s: float) -> float:
            return self._share(reading._replace(offset_s=offset_s))

        count = round(LARGEST_OFFSET_s / OFFSET_STEP_s)
        best = min((place * OFFSET_STEP_s for place in range(-count, count + 1)), key=share)
        for step_s in (OFFSET_STEP_s / 2, OFFSET_STEP_s / 10):
            before, here, after = share(best - step_s), share(best), share(best + step_s)
            if (curvature := before - 2 * here + after) > 0:
                best += step_s * min(max((before - after) / (2 * curvature), -1.0), 1.0)
        return best

    def _motion(self, reading: Reading) -> Motion:
        key = reading.order, reading.signs, reading.angle_factor
        if key not in self._motions:
            self._motions[key] = self._balance.motion(*key)
        return self._motions[key]

    def _currents(self, reading: Reading) -> Array:
        currents = reading.current_factor * self._balance.currents(reading.offset_s)
        return currents @ reading.groups.matrix().T

    def _applied(self, reading: Reading) -> Array:
        return self._balance.applied(self._motion(reading), self._currents(reading))

    def _share(self, reading: Reading) -> float:
        order, signs, groups, *others = reading
        key = order, signs, *map(tuple, groups), *others
        if key not in self._shares:
            self._shares[key] = unexplained_share(self._motion(reading), self._applied(reading))
        return self._shares[key]
