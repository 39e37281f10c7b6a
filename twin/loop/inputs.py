"""Inputs of the loop: reference, disturbance and noise, generated block by block while a session runs.

Blocks have a fixed length and begin at its multiples, independent of the chunks in which a session advances.
Each tick has its own number of each random stream. So neither chunks nor changes during a run alter a bit of
other inputs, and the inputs of many runs are those of each run alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.manual_currents import sample_currents
from spheretwin.electronics.random_streams import noise_table
from spheretwin.electronics.sensor_chain import noise_streams
from spheretwin.loop.closed_loop import Inputs
from spheretwin.loop.hardware_assembly import fault_streams
from spheretwin.models.base.columns import Columns
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.sections import Scenario
from spheretwin.trajectories.disturbances import Draws, term_draws
from spheretwin.trajectories.trajectory import Sampled, checked

BLOCK_TICKS = 1000


class InputBlock(NamedTuple):
    """Inputs of some runs at the ticks of a block."""

    first: int
    """Tick of the first row."""
    inputs: Inputs
    """With a first index of the run, of length 1 for what all runs share."""
    finite_rows: NDArray[np.int64]
    """(runs,) leading rows in which reference and disturbance are finite."""


class InputGenerator:
    """Generator of reference, disturbance and noise of one run, or of many.

    It has no state: every number depends only on scenario and tick.

    Parameters
    ----------
    scenario : Scenario, or Columns of scenarios
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
        self.scenario = scenario

    @property
    def scenario(self) -> Scenario:
        """Active scenario; a new one is effective from the next requested tick."""
        return self._scenario

    @scenario.setter
    def scenario(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._block: InputBlock | None = None

    def rows(self, tick: int, most: int) -> Inputs:
        """Return the inputs of the only run from a tick on, at least one row and at most `most`.

        Raises
        ------
        InputError
            Reference or disturbance is not finite at this tick; earlier rows do not depend on the number of
            requested rows. Or a user trajectory failed in the block.
        """
        block = self.block(tick)
        first = tick - block.first
        if first >= block.finite_rows[0]:
            self._refuse(block.inputs, first)
        last = min(first + most, int(block.finite_rows[0]))
        t, *columns = block.inputs
        return Inputs(t[first:last], *(column[0, first:last] for column in columns))

    def block(self, tick: int) -> InputBlock:
        """Return the inputs of all runs in the block that contains a tick.

        Raises
        ------
        InputError
            A user trajectory failed in the block.
        """
        first = tick - tick % BLOCK_TICKS
        if self._block is None or self._block.first != first:
            motion = self._noise_free(first, BLOCK_TICKS, self._draws_of)
            rows = np.where(motion.finite.all(axis=1), BLOCK_TICKS, np.argmin(motion.finite, axis=1))
            self._block = InputBlock(first, self._with_noise(motion, first), rows)
        return self._block

    def stays_finite(self, tick: int) -> NDArray[np.bool_]:
        """Return whether reference and disturbance of each run, or of all of them, are finite at a tick."""
        if not np.any(self._scenario.disturbance.grows):
            period_s = self._scenario.controller.period_s
            trajectories = _each(self._scenario.trajectory)
            return np.array([self._reference(own, period_s, tick, 1).finite[0] for own in trajectories])
        return self._end(tick).finite[:, 0]

    def check_horizon(self, tick: int) -> None:
        """Check before the only run that reference and disturbance are finite at its end.

        Raises
        ------
        InputError
            Reference or disturbance is not finite at a future tick.
        """
        if not (end := self._end(tick)).finite.all():
            self._refuse(end, 0)

    def _end(self, tick: int) -> _NoiseFree:
        return self._noise_free(tick, 1, lambda *_: Draws(lambda: np.ones(1), lambda _: np.ones(1)))

    def _noise_free(self, first: int, count: int, draws_of: Callable[[int, int], Draws]) -> _NoiseFree:
        """Return reference and disturbance of all runs at some ticks."""
        period_s = self._scenario.controller.period_s
        trajectories = _each(self._scenario.trajectory)
        references = [self._reference(own, period_s, first, count) for own in trajectories]
        t, disturbance = references[0].t, self._disturbance(references[0].t, first, draws_of)
        finite = np.array([reference.finite for reference in references])
        samples = _stacked([reference.samples for reference in references])
        return _NoiseFree(t, samples, disturbance, finite & np.isfinite(disturbance).all(axis=2))

    def _with_noise(self, motion: _NoiseFree, first: int) -> Inputs:
        scenario, ticks = self._scenario, len(motion.t)
        streams = noise_streams(scenario.sensors), fault_streams(scenario, self._groups)
        noise, fault_noise = (noise_table(scenario.seed, first, ticks, own) for own in streams)
        manual_A = [sample_currents(section, motion.t) for section in _each(scenario.manual)]
        return Inputs(*motion[:3], _of_runs(noise), _of_runs(fault_noise), _stacked(manual_A))

    def _reference(self, trajectory: Any, period_s: float, first: int, count: int) -> _Reference:
        if self._user_trajectory is not None:
            return _sampled(self._user_trajectory, period_s, first, count)
        return _sampled_once(trajectory, trajectory.model_dump_json(), period_s, first, count)

    def _disturbance(
        self, t: NDArray[np.float64], first: int, draws_of: Callable[[int, int], Draws]
    ) -> NDArray[np.float64]:
        """Return the disturbance of each run, or of all of them."""
        section, seeds = self._scenario.disturbance, np.ravel(self._scenario.seed).tolist()
        if isinstance(section, Columns):
            seeds = np.broadcast_to(seeds, len(section)).tolist()
        elif not section.is_random:
            seeds = seeds[:1]
        sections: Any = section if isinstance(section, Columns) else [section] * len(seeds)
        return _stacked(
            [own.sample(t, draws_of(seed, first)) for own, seed in zip(sections, seeds, strict=True)]
        )

    def _draws_of(self, seed: int, first: int) -> Draws:
        """Return the random numbers of the disturbance of a run in the block that begins at a tick."""

        def paper() -> NDArray[np.float64]:
            bits = np.random.PCG64(seed)
            return np.random.Generator(bits.advance(first)).random(BLOCK_TICKS)

        return Draws(paper, partial(term_draws, seed, first, BLOCK_TICKS))

    def _refuse(self, rows: Inputs | _NoiseFree, row: int) -> NoReturn:
        reference, disturbance = rows.reference[0, row], rows.disturbance[0, row]
        name = "disturbance" if np.isfinite(reference).all() else "trajectory"
        lost = np.isnan(reference).any() or np.isnan(disturbance).any()
        raise InputError(
            f"scenario {self._scenario.name}: expected a finite {name},"
            f" received {'NaN' if lost else 'infinity'} at {rows.t[row]:g} s"
        )


class _NoiseFree(NamedTuple):
    """Reference and disturbance at some ticks, of each run or of all of them."""

    t: NDArray[np.float64]  # (n,) s
    reference: NDArray[np.float64]  # (runs or 1, n, 3, 3)
    disturbance: NDArray[np.float64]  # (runs or 1, n, 3) N·m
    finite: NDArray[np.bool_]  # (runs or 1, n) true if both are finite


def _each(section: Any) -> Sequence[Any]:
    """Return the section of each run, or the only one that all runs share."""
    return list(section) if isinstance(section, Columns) else [section]


def _stacked(parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    return np.stack(parts) if len(parts) > 1 else parts[0][None]


def _of_runs(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return noise with the index of the run first, also of one seed."""
    return table if table.ndim == 3 else table[None]


class _Reference(NamedTuple):
    """Reference at some ticks."""

    t: NDArray[np.float64]  # (n,) s
    samples: NDArray[np.float64]  # (n, 3, 3)
    finite: NDArray[np.bool_]  # (n,) true if all numbers are finite


def _sampled(trajectory: Sampled, period_s: float, first: int, count: int) -> _Reference:
    t = period_s * np.arange(first, first + count, dtype=np.float64)
    samples = np.ascontiguousarray(trajectory.sample(t))
    return _Reference(t, samples, np.all(np.isfinite(samples), axis=(1, 2)))


@lru_cache(maxsize=32)
def _sampled_once(trajectory: Any, key: str, period_s: float, first: int, count: int) -> _Reference:
    """Return `_sampled` from a cache: the rows of a study follow one trajectory and share its samples.

    `key` is the text of the trajectory: 0 and -0 are equal as numbers, but give different bits.
    """
    reference = _sampled(trajectory, period_s, first, count)
    for column in reference:
        column.flags.writeable = False
    return reference
