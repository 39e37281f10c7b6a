"""What comes from outside a loop: reference and disturbance, made block by block for as long as it runs.

Blocks have a fixed length and begin at its multiples, whatever the chunks in which a session advances, and
each tick has its own draw of each random stream: neither chunks nor changes on the way move a single bit of
what they do not concern.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError
from spheretwin.twin.disturbances.draws import Draws, term_draws
from spheretwin.twin.electronics.sensing.chain import noise_width
from spheretwin.twin.electronics.sensing.noise import FAULTS, noise_rows
from spheretwin.twin.faults.plan import draws_width
from spheretwin.twin.loop import Inputs
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.trajectories.trajectory import Sampled, checked

BLOCK_TICKS = 1000


class Exogenous:
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
            ticks = np.arange(self._first, self._first + BLOCK_TICKS, dtype=np.float64)
            self._block = self._sampled(ticks, Draws(self._draws, self._draws_of_term))
            self._numbers = (
                BLOCK_TICKS if _finite(self._block).all() else int(np.argmin(_finite(self._block)))
            )
        first = tick - self._first
        last = min(first + most, BLOCK_TICKS)
        block = self._block
        if last > self._numbers:
            if first >= self._numbers:
                self._refuse(self._block, first)
            last = self._numbers
        return Inputs(*(column[first:last] for column in block))

    def check_horizon(self, tick: int) -> None:
        """Refuse before a run what would only be found out at its end.

        Raises
        ------
        InputError
            Reference or disturbance is beyond what a number can hold at a tick to come.
        """
        end = self._sampled(np.array([tick], dtype=np.float64), Draws(np.ones(1), lambda _: np.ones(1)))
        if not _finite(end).all():
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

    def _sampled(self, ticks: NDArray[np.float64], draws: Draws) -> Inputs:
        scenario = self._scenario
        t = scenario.controller.period_s * ticks
        followed: Sampled = scenario.trajectory if self._own is None else self._own
        reference = np.ascontiguousarray(followed.sample(t))
        first, count, seed = int(ticks[0]), len(ticks), scenario.seed
        noise = noise_rows(seed, first, count, noise_width(scenario.sensors))
        of_faults = noise_rows(seed, first, count, self._width_of_faults(), FAULTS)
        return Inputs(t, reference, scenario.disturbance.sample(t, draws), noise, of_faults)

    def _width_of_faults(self) -> int:
        return draws_width(self._groups) if self._scenario.draws_for_faults else 0

    def _refuse(self, rows: Inputs, row: int) -> NoReturn:
        name = "disturbance" if np.isfinite(rows.reference[row]).all() else "trajectory"
        lost = np.isnan(rows.reference[row]).any() or np.isnan(rows.disturbance[row]).any()
        raise InputError(
            f"scenario {self._scenario.name}: expected a finite {name},"
            f" received {'NaN' if lost else 'infinity'} at {rows.t[row]:g} s"
        )


def _finite(rows: Inputs) -> NDArray[np.bool_]:
    """Whether each row holds numbers alone."""
    every = np.concatenate([rows.reference.reshape(len(rows.t), 9), rows.disturbance], axis=1)
    finite: NDArray[np.bool_] = np.isfinite(every).all(axis=1)
    return finite
