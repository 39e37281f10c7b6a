"""What comes from outside a loop: reference and disturbance, made block by block for as long as it runs.

Blocks have a fixed length and begin at its multiples, whatever the chunks in which a session advances, and
each tick has its own draw of the random stream: neither chunks nor changes on the way move a single bit of
what they do not concern.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.errors import InputError
from spheretwin.twin.loop import Inputs
from spheretwin.twin.scenario import Scenario

BLOCK_TICKS = 1000


class Exogenous:
    """Reference and disturbance of a scenario.

    Parameters
    ----------
    scenario : Scenario
        Trajectory, disturbance, control period and seed.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._generator = np.random.default_rng(scenario.seed)
        self._before: dict[str, Any] = self._generator.bit_generator.state
        self._first = -BLOCK_TICKS  # tick at which the present block begins
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
            Reference or disturbance is beyond what a number can hold.
        """
        while tick >= self._first + BLOCK_TICKS:
            self._before = self._generator.bit_generator.state
            self._draws = self._generator.random(BLOCK_TICKS)
            self._first += BLOCK_TICKS
            self._block = None
        if self._block is None:
            ticks = np.arange(self._first, self._first + BLOCK_TICKS, dtype=np.float64)
            self._block = self._sampled(ticks, self._draws)
        first = tick - self._first
        rows = slice(first, min(first + most, BLOCK_TICKS))
        block = Inputs(*(values[rows] for values in self._block))
        self._check(block)
        return block

    def check_horizon(self, tick: int) -> None:
        """Refuse before a run what would only be found out at its end.

        Raises
        ------
        InputError
            Reference or disturbance is beyond what a number can hold at a tick to come.
        """
        self._check(self._sampled(np.array([tick], dtype=np.float64), np.ones(1)))

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

    def _sampled(self, ticks: NDArray[np.float64], draws: NDArray[np.float64]) -> Inputs:
        scenario = self._scenario
        t = scenario.controller.period_s * ticks
        reference = np.ascontiguousarray(scenario.trajectory.sample(t))
        return Inputs(t, reference, scenario.disturbance.sample(t, draws))

    def _check(self, rows: Inputs) -> None:
        for name, samples in (("trajectory", rows.reference), ("disturbance", rows.disturbance)):
            lost = np.flatnonzero(~np.isfinite(samples.reshape(len(rows.t), -1)).all(axis=1))
            if len(lost):
                raise InputError(
                    f"scenario {self._scenario.name}: expected a finite {name},"
                    f" received infinity at {rows.t[lost[0]]:g} s"
                )
