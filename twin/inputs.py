"""Inputs of the loop: reference, disturbance and noise, generated block by block while a session runs.

Blocks have a fixed length and begin at its multiples, independent of the chunks in which a session advances.
Each tick has its own number of each random stream. So neither chunks nor changes during a run alter a bit of
other inputs.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.manual_currents import sample_currents
from spheretwin.disturbances import Draws, term_draws
from spheretwin.electronics.random_streams import noise_table
from spheretwin.electronics.sensor_chain import noise_streams
from spheretwin.hardware_assembly import fault_streams
from spheretwin.loop import Inputs
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.sections import Scenario
from spheretwin.trajectories.trajectory import Sampled, checked

BLOCK_TICKS = 1000


class _ReferenceBlock(NamedTuple):
    """Reference at some ticks."""

    t: NDArray[np.float64]  # (n,) s
    samples: NDArray[np.float64]  # (n, 3, 3)
    finite: NDArray[np.bool_]  # (n,) true if all numbers are finite


class _NoiseFreeInputs(NamedTuple):
    """Inputs at some ticks without noise."""

    t: NDArray[np.float64]  # (n,) s
    reference: NDArray[np.float64]  # (n, 3, 3)
    disturbance: NDArray[np.float64]  # (n, 3) N·m
    finite: NDArray[np.bool_]  # (n,) true if both are finite


class InputGenerator:
    """Generator of reference, disturbance and noise of a scenario.

    Parameters
    ----------
    scenario : Scenario
        Trajectory, disturbance, control period and seed.
    trajectory : Sampled, optional
        Replaces the trajectory of the scenario, also of later scenarios.
    groups : int
        Coil groups; each may have separate noise.

    Raises
    ------
    InputError
        The trajectory has no ``sample(t)``, or its motion at the start is not finite.
    """

    def __init__(self, scenario: Scenario, trajectory: Sampled | None = None, groups: int = 0) -> None:
        self._groups = groups
        self._user_trajectory = None if trajectory is None else checked(trajectory)
        self._generator = np.random.default_rng(scenario.seed)
        self._before: Mapping[str, Any] = self._generator.bit_generator.state
        self._first = -BLOCK_TICKS  # first tick of the present block
        self._finite_rows = BLOCK_TICKS  # leading rows of the block that are finite
        self._draws: NDArray[np.float64] = np.empty(0)
        self.scenario = scenario

    @property
    def scenario(self) -> Scenario:
        """Active scenario; a new one is effective from the next requested tick."""
        return self._scenario

    @scenario.setter
    def scenario(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._block: Inputs | None = None

    def rows(self, tick: int, most: int) -> Inputs:
        """Return the inputs from a tick on, at least one row and at most `most`; ticks must be in order.

        Raises
        ------
        InputError
            Reference or disturbance is not finite at this tick; earlier rows do not depend on the number of
            requested rows. Or a user trajectory failed in the block.
        """
        while tick >= self._first + BLOCK_TICKS:
            self._before = self._generator.bit_generator.state
            self._draws = self._generator.random(BLOCK_TICKS)
            self._first += BLOCK_TICKS
            self._block = None
        if self._block is None:
            inputs = self._noise_free(self._first, BLOCK_TICKS, Draws(self._draws, self._draws_of_term))
            self._block = self._with_noise(inputs)
            self._finite_rows = BLOCK_TICKS if inputs.finite.all() else int(np.argmin(inputs.finite))
        first = tick - self._first
        last = min(first + most, BLOCK_TICKS)
        block = self._block
        if last > self._finite_rows:
            if first >= self._finite_rows:
                self._refuse(block, first)
            last = self._finite_rows
        return Inputs(*(column[first:last] for column in block))

    def check_horizon(self, tick: int) -> None:
        """Check before a run that reference and disturbance are finite at its end.

        Raises
        ------
        InputError
            Reference or disturbance is not finite at a future tick.
        """
        end = self._noise_free(tick, 1, Draws(np.ones(1), lambda _: np.ones(1)))
        if not end.finite.all():
            self._refuse(end, 0)

    def state(self) -> dict[str, Any]:
        """Return the random stream at the start of the present block, and the tick of this start."""
        return {"first": self._first, "generator": self._before}

    def restore(self, state: dict[str, Any]) -> None:
        """Restore a state."""
        self._generator.bit_generator.state = self._before = state["generator"]
        self._first = state["first"]
        if self._first >= 0:
            self._draws = self._generator.random(BLOCK_TICKS)
        self._block = None

    def _draws_of_term(self, place: int) -> NDArray[np.float64]:
        """Return the random numbers of a disturbance term in the present block."""
        return term_draws(self._scenario.seed, self._first, BLOCK_TICKS, place)

    def _noise_free(self, first: int, count: int, draws: Draws) -> _NoiseFreeInputs:
        """Return reference and disturbance at some ticks."""
        scenario = self._scenario
        period_s, trajectory = scenario.controller.period_s, scenario.trajectory
        if self._user_trajectory is None:
            t, reference, finite = _sampled_once(
                trajectory, trajectory.model_dump_json(), period_s, first, count
            )
        else:
            t, reference, finite = _sampled(self._user_trajectory, period_s, first, count)
        disturbance = scenario.disturbance.sample(t, draws)
        return _NoiseFreeInputs(t, reference, disturbance, finite & np.isfinite(disturbance).all(axis=1))

    def _with_noise(self, inputs: _NoiseFreeInputs) -> Inputs:
        seed, first, count = self._scenario.seed, self._first, len(inputs.t)
        noise = noise_table(seed, first, count, noise_streams(self._scenario.sensors))
        fault_noise = noise_table(seed, first, count, fault_streams(self._scenario, self._groups))
        manual_A = sample_currents(self._scenario.manual, inputs.t)
        return Inputs(inputs.t, inputs.reference, inputs.disturbance, noise, fault_noise, manual_A)

    def _refuse(self, rows: Inputs | _NoiseFreeInputs, row: int) -> NoReturn:
        name = "disturbance" if np.isfinite(rows.reference[row]).all() else "trajectory"
        lost = np.isnan(rows.reference[row]).any() or np.isnan(rows.disturbance[row]).any()
        raise InputError(
            f"scenario {self._scenario.name}: expected a finite {name},"
            f" received {'NaN' if lost else 'infinity'} at {rows.t[row]:g} s"
        )


def _sampled(trajectory: Sampled, period_s: float, first: int, count: int) -> _ReferenceBlock:
    t = period_s * np.arange(first, first + count, dtype=np.float64)
    samples = np.ascontiguousarray(trajectory.sample(t))
    return _ReferenceBlock(t, samples, np.all(np.isfinite(samples), axis=(1, 2)))


@lru_cache(maxsize=32)
def _sampled_once(trajectory: Any, key: str, period_s: float, first: int, count: int) -> _ReferenceBlock:
    """Return `_sampled` from a cache: the rows of a study follow one trajectory and share its samples.

    `key` is the text of the trajectory: 0 and -0 are equal as numbers, but give different bits.
    """
    block = _sampled(trajectory, period_s, first, count)
    for column in block:
        column.flags.writeable = False
    return block
