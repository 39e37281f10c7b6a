"""Runs of a block: many scenarios that differ in numbers, set up together and run in one compiled call.

Set-up fills columns of the records of all runs. One call for each thousand ticks runs the loops of all of
them and reduces their telemetry to figures, without the interpreter lock and without storing the telemetry.
The numbers are those of each run alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache, cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.controller import controller_of
from spheretwin.control.supervision.watchdog import REASONS, Reason
from spheretwin.loop import closed_loop as loops
from spheretwin.loop.assembly import assembled
from spheretwin.loop.closed_loop import Inputs, inputs_of, loop
from spheretwin.loop.hardware_assembly import faults_of
from spheretwin.loop.inputs import BLOCK_TICKS, InputGenerator
from spheretwin.loop.stages import Stages, stages_of
from spheretwin.metrics.figures import Figures
from spheretwin.metrics.reduction import PlannedRun
from spheretwin.models.base.columns import Columns
from spheretwin.models.base.compiled import allocation_free, for_types_of
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.status import BY_CODE, Status
from spheretwin.plant.plant_tick import GOING
from spheretwin.scenario.files import Files
from spheretwin.scenario.sections import ResolvedScenario


class RunEnding(NamedTuple):
    """End of a run of a block."""

    status: Status
    reason: Reason
    figures: dict[str, Any]


class RunBlock:
    """Runs of scenarios that differ in numbers.

    Parameters
    ----------
    scenarios : sequence of ResolvedScenario
        Of the same clocks, law, engine and parts, without events.
    files : Files
        Of all of them.
    metrics : iterable of str
        Names of the figures.

    Raises
    ------
    InputError
        A value of a scenario cannot be used.
    MixedRowsError
        The scenarios differ in something else than numbers.
    """

    takes_user_laws: ClassVar[bool] = False
    """Whether laws of the user run in it: their exceptions are known only in a session."""

    arithmetic: ClassVar[dict[str, str]] = {}
    """Part of the provenance of figures that are not those of a session to the last bit."""

    def __init__(self, scenarios: Sequence[ResolvedScenario], files: Files, metrics: Iterable[str]) -> None:
        runs, (first, *others) = len(scenarios), scenarios
        scenario: Any = Columns(scenarios) if others else first
        self._ticks = scenario.ticks
        self._assembly = assembled(scenario, files)
        rows, signals = self._assembly.rows, self._assembly.signals
        self._inputs = InputGenerator(scenario, None, len(files.actuator.groups))
        self._injectors = [faults_of(own, rows[i : i + 1]) for i, own in enumerate(scenarios) if own.fault]
        self._figures = Figures(PlannedRun(scenario, files.actuator, self._ticks, runs), metrics)
        self._reduction = self._figures.reduction(signals, self._ticks)
        self._log = np.empty((min(BLOCK_TICKS, self._ticks), width(signals)))
        self._codes, self._done = np.full(runs, GOING), np.zeros(runs, np.int64)

    @cached_property
    def _stages(self) -> Stages:
        return self._assembly.stages()

    def run(self) -> list[RunEnding | None]:
        """Return the end of each run; None for one whose inputs do not stay finite, which runs alone."""
        tick, finite = 0, np.ones(len(self._codes), bool) & self._inputs.stays_finite(self._ticks - 1)
        while tick < self._ticks and np.any(self._codes == GOING):
            block = self._inputs.block(tick)
            until = min(
                [self._ticks, block.first + BLOCK_TICKS, *(own.apply(tick) for own in self._injectors)]
            )
            finite &= (self._codes != GOING) | (block.finite_rows >= until - block.first)
            self._codes[~finite] = loops.INTERRUPTED
            self.advance(block.inputs, tick - block.first, tick, until - tick)
            tick = until
        self.collect()
        self._reduction.count(self._done)
        reasons = self._assembly.rows["controller"]["supervision"]["watchdog"]["reason"].tolist()
        ended = zip(self._codes.tolist(), reasons, self._figures.of_each_run(), finite, strict=True)
        return [
            _ending(code, REASONS[reason], figures) if kept else None for code, reason, figures, kept in ended
        ]

    def advance(self, inputs: Inputs, row: int, tick: int, ticks: int) -> None:
        """Run the loops of all runs for some ticks, from a row of their inputs on."""
        own = self._assembly
        parts = (
            *own.functions[:3],
            own.controllers,
            self._stages,
            own.law_signals,
            loops.NO_EXTERNAL,
            *self._reduction.arguments,
            self._log[:ticks],
            self._codes,
            self._done,
        )
        run_rows = for_types_of(_runner_of(self._reduction.function), inputs, row, tick, *parts)
        run_rows(inputs, row, tick, *parts)

    def collect(self) -> None:
        """Take over what `advance` has left elsewhere."""


def _ending(code: int, reason: Reason, figures: dict[str, Any]) -> RunEnding:
    status = Status.FAILSAFE if reason else BY_CODE[code]
    return RunEnding(Status.COMPLETED if status == Status.RUNNING else status, reason, figures)


@cache
def _runner_of(reduce: Any) -> Any:
    """Return the compiled function that runs the loops of a block and reduces their telemetry."""

    @allocation_free
    def run_rows(
        inputs: Inputs,
        row: int,
        tick: int,
        law: Any,
        allocate: Any,
        estimate: Any,
        controllers: Any,
        stages: Any,
        law_signals: int,
        external: Any,
        columns: Any,
        states: Any,
        log: NDArray[np.float64],
        codes: NDArray[np.int64],
        ticks: NDArray[np.int64],
    ) -> None:
        for run in range(codes.shape[0]):
            if codes[run] == GOING:
                done, codes[run] = loop(
                    inputs_of(inputs, run, row),
                    law,
                    allocate,
                    estimate,
                    controller_of(controllers, run),
                    stages_of(stages, run),
                    law_signals,
                    external,
                    log,
                )
                ticks[run] += done
                reduce(log[:done], tick, columns, states, run)

    return run_rows
