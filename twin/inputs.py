"""What comes from outside a loop: reference and disturbance, made block by block for as long as it runs.

Blocks have a fixed length and begin at its multiples, whatever the chunks in which a session advances, and
each tick has its own draw of each random stream: neither chunks nor changes on the way move a single bit of
what they do not concern.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from spheretwin.disturbances import Draws, term_draws
from spheretwin.electronics.random_streams import noise_table
from spheretwin.electronics.sensor_chain import noise_streams
from spheretwin.loop import Inputs
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.sections import Scenario
from spheretwin.shared_buffers import fault_streams
from spheretwin.trajectories.trajectory import Sampled, checked

BLOCK_TICKS = 1000


class _Reference(NamedTuple):
    """What a trajectory asks for at some ticks."""

    t: NDArray[np.float64]  # (n,) s
    samples: NDArray[np.float64]  # (n, 3, 3)
    finite: NDArray[np.bool_]  # (n,) whether they are numbers


class _Known(NamedTuple):
    """What is known beforehand of some ticks: all but noise."""

    t: NDArray[np.float64]  # (n,) s
    reference: NDArray[np.float64]  # (n, 3, 3)
    disturbance: NDArray[np.float64]  # (n, 3) N·m
    finite: NDArray[np.bool_]  # (n,) whether both are numbers


class InputGenerator:
    """Reference and disturbance of a scenario.

    Parameters
    ----------
    scenario : Scenario
        Trajectory, disturbance, control period and seed.
    trajectory : Sampled, optional
        Followed instead of the trajectory that the scenario names, whatever scenario is in force.
    groups : int
        Coil groups, each of which may have noise of its own.

    Raises
    ------
    InputError
        The trajectory has no ``sample(t)``, or what that gives at the start is no finite motion.
    """

    def __init__(self, scenario: Scenario, trajectory: Sampled | None = None, groups: int = 0) -> None:
        self._groups = groups
        self._own = None if trajectory is None else checked(trajectory)
        self._generator = np.random.default_rng(scenario.seed)
        self._before: Mapping[str, Any] = self._generator.bit_generator.state
        self._first = -BLOCK_TICKS  # tick at which the present block begins
        self._numbers = BLOCK_TICKS  # rows of it that are numbers
        self._draws: NDArray[np.float64] = np.empty(0)
        self.scenario = scenario

    @property
    def scenario(self) -> Scenario:
        """Scenario in force; a new one holds from the next tick asked for."""
        return self._scenario

    @scenario.setter
    def scenario(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._block: Inputs | None = None

    def rows(self, tick: int, most: int) -> Inputs:
        """Inputs from a tick on, at most `most` rows and at least one; ticks are asked for in order.

        Raises
        ------
        InputError
            Reference or disturbance is beyond what a number can hold at that very tick: what comes before
            does not depend on how many rows are asked for. Or a trajectory of the user's failed somewhere in
            the block.
        """
        while tick >= self._first + BLOCK_TICKS:
            self._before = self._generator.bit_generator.state
            self._draws = self._generator.random(BLOCK_TICKS)
            self._first += BLOCK_TICKS
            self._block = None
        if self._block is None:
            known = self._known(self._first, BLOCK_TICKS, Draws(self._draws, self._draws_of_term))
            self._block = self._with_noise(known)
            self._numbers = BLOCK_TICKS if known.finite.all() else int(np.argmin(known.finite))
        first = tick - self._first
        last = min(first + most, BLOCK_TICKS)
        block = self._block
        if last > self._numbers:
            if first >= self._numbers:
                self._refuse(block, first)
            last = self._numbers
        return Inputs(*(column[first:last] for column in block))

    def check_horizon(self, tick: int) -> None:
        """Refuse before a run what would only be found out at its end.

        Raises
        ------
        InputError
            Reference or disturbance is beyond what a number can hold at a tick to come.
        """
        end = self._known(tick, 1, Draws(np.ones(1), lambda _: np.ones(1)))
        if not end.finite.all():
            self._refuse(end, 0)

    def state(self) -> dict[str, Any]:
        """The random stream where the present block begins, and that tick."""
        return {"first": self._first, "generator": self._before}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        self._generator.bit_generator.state = self._before = state["generator"]
        self._first = state["first"]
        if self._first >= 0:
            self._draws = self._generator.random(BLOCK_TICKS)
        self._block = None

    def _draws_of_term(self, place: int) -> NDArray[np.float64]:
        """Draws of a term of the disturbance in the present block."""
        return term_draws(self._scenario.seed, self._first, BLOCK_TICKS, place)

    def _known(self, first: int, count: int, draws: Draws) -> _Known:
        """Reference and disturbance at some ticks."""
        scenario = self._scenario
        period_s, trajectory = scenario.controller.period_s, scenario.trajectory
        if self._own is None:
            t, reference, finite = _sampled_once(
                trajectory, trajectory.model_dump_json(), period_s, first, count
            )
        else:
            t, reference, finite = _sampled(self._own, period_s, first, count)
        disturbance = scenario.disturbance.sample(t, draws)
        return _Known(t, reference, disturbance, finite & np.isfinite(disturbance).all(axis=1))

    def _with_noise(self, known: _Known) -> Inputs:
        seed, first, count = self._scenario.seed, self._first, len(known.t)
        noise = noise_table(seed, first, count, noise_streams(self._scenario.sensors))
        of_faults = noise_table(seed, first, count, fault_streams(self._scenario, self._groups))
        return Inputs(known.t, known.reference, known.disturbance, noise, of_faults)

    def _refuse(self, rows: Inputs | _Known, row: int) -> NoReturn:
        name = "disturbance" if np.isfinite(rows.reference[row]).all() else "trajectory"
        lost = np.isnan(rows.reference[row]).any() or np.isnan(rows.disturbance[row]).any()
        raise InputError(
            f"scenario {self._scenario.name}: expected a finite {name},"
            f" received {'NaN' if lost else 'infinity'} at {rows.t[row]:g} s"
        )


def _sampled(followed: Sampled, period_s: float, first: int, count: int) -> _Reference:
    t = period_s * np.arange(first, first + count, dtype=np.float64)
    samples = np.ascontiguousarray(followed.sample(t))
    return _Reference(t, samples, np.all(np.isfinite(samples), axis=(1, 2)))


@lru_cache(maxsize=32)
def _sampled_once(trajectory: Any, told: str, period_s: float, first: int, count: int) -> _Reference:
    """As `_sampled`, kept: the rows of a study follow one trajectory, and share what it says.

    `told` is what the trajectory says of itself: 0 and -0 are equal, but do not give the same bits.
    """
    found = _sampled(trajectory, period_s, first, count)
    for column in found:
        column.flags.writeable = False
    return found
