"""Runs of a block on a GPU: one thread a run, the same Python functions as on the processor.

The kernel is compiled for a law, an estimator, an allocation and the channels of the telemetry: it contains
them, as a GPU calls nothing by address. Random numbers, references and disturbances come from the processor,
those of a block of ticks at a time.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numba.extending import is_jitted
from numpy.typing import NDArray

from spheretwin.control.allocation import ALLOCATIONS
from spheretwin.control.controller import Controller
from spheretwin.loop.assembly import estimator_of
from spheretwin.loop.block import RunBlock, RunEnding
from spheretwin.loop.channels import TelemetryChannel, logged_channels
from spheretwin.loop.closed_loop import External, Inputs, inputs_of, is_user_law, loop
from spheretwin.loop.stages import Stages, advance_stage, sense_stage
from spheretwin.models.base import cuda
from spheretwin.models.base.compiled import allocation_free, compile_error
from spheretwin.models.base.errors import InputError, LawError
from spheretwin.models.magnetics import Tables
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.status import Status
from spheretwin.plant.plant_tick import ENGINES, GOING
from spheretwin.scenario.files import Files
from spheretwin.scenario.sections import ResolvedScenario

ENGINE = "lagrangian"


class CudaBlock(RunBlock):
    """`RunBlock` on a GPU.

    Its figures are those of the processor within rounding: sines, exponentials and sums differ in their last
    bits, which a law that switches enlarges.

    Raises
    ------
    InputError
        As `RunBlock`; or there is no GPU, or it cannot run the engine or the law.
    MixedRowsError
    """

    takes_user_laws = True
    arithmetic: ClassVar[dict[str, str]] = {"block": "cuda"}

    def __init__(self, scenarios: Sequence[ResolvedScenario], files: Files, metrics: Iterable[str]) -> None:
        first = scenarios[0]
        check_gpu_runs(
            first.plant.engine, check_bounds=first.controller.check_bounds, hall=first.sensors.hall.on
        )
        super().__init__(scenarios, files, metrics)
        own = self._assembly
        estimator, columns, signals = estimator_of(first), self._reduction.arguments[0], own.signals
        body = _body_of(
            _direct(own.law.step),
            _direct(ALLOCATIONS[first.allocation]),
            _direct(estimator.step) if estimator else _no_estimate,
            _direct(ENGINES[ENGINE].step),
            _writer_of(tuple(logged_channels(signals))),
            self._reduction.function,
            own.law_signals,
            columns,
        )
        self._kernel = _kernel_of(body, own.rows.dtype, width(signals))
        records = own.rows.view(np.int64).reshape(len(own.rows), -1)
        states = self._reduction.arguments[1]
        self._host = records, own.controllers._replace(data=records[:0]), states, self._codes, self._done
        self._fixed = cuda.on_device(_Fixed(own.tables, np.zeros(1, np.int64), np.zeros(3)))
        self._device: Any = None

    def advance(self, inputs: Inputs, row: int, tick: int, ticks: int) -> None:
        """Run the loops of all runs for some ticks, from a row of their inputs on."""
        if self._device is None:
            self._device = cuda.on_device(self._host)
        codes = self._device[3]
        cuda.send(self._codes, codes)
        given = cuda.on_device(_inputs_between(inputs, row, row + ticks))
        try:
            cuda.launch(self._kernel, len(self._codes), (*self._device, self._fixed, given, tick))
        except Exception as error:  # numba also raises KeyError, for a function that GPUs lack
            law = self._assembly.law
            if tick or not is_user_law(law):  # it is compiled for the first ticks: later errors are the GPU's
                raise
            raise LawError(
                f"law {law.name}: expected a function that numba compiles for a GPU,"
                f" received {compile_error(error, law.step)}"
            ) from error
        cuda.fetch(codes, self._codes)
        if self._injectors:  # faults write into the records
            self.collect()

    def run(self) -> list[RunEnding | None]:
        """Return the end of each run; None for one that runs alone, as a law of the user may have raised."""
        endings = super().run()
        if not is_user_law(self._assembly.law):
            return endings
        return [None if ending and ending.status == Status.DIVERGED else ending for ending in endings]

    def collect(self) -> None:
        """Copy records and figures from the GPU."""
        if self._device is not None:
            cuda.fetch(self._device, self._host)
        self._device = None


class _Fixed(NamedTuple):
    """What no thread changes."""

    tables: Tables
    first_column: NDArray[np.int64]
    unused: NDArray[np.float64]


def check_gpu_runs(engine: str, *, check_bounds: bool, hall: bool) -> None:
    """Check that there is a GPU, and that it can run scenarios of a plant.

    Raises
    ------
    InputError
        There is no GPU, or it is another engine, or the law checks bounds, or there is a Hall array.
    """
    cuda.check_gpu()
    if engine != ENGINE:
        raise InputError(f"cuda: expected plant.engine {ENGINE}, received {engine}, which runs on processors")
    if check_bounds:
        raise InputError("cuda: expected controller.check_bounds = false, received true")
    if hall:
        raise InputError("cuda: expected no sensors.hall, received a Hall array, which runs on processors")


def _inputs_between(inputs: Inputs, first: int, last: int) -> Inputs:
    return Inputs(inputs.t[first:last], *(column[:, first:last] for column in inputs[1:]))


_kernel_of = cache(cuda.kernel_of)


@cache
def _direct(function: Any) -> Any:
    """Return a function that compiled code calls by name."""
    return function if is_jitted(function) else allocation_free(function)


@allocation_free
def _no_estimate(angle: Any, parameters: Any, state: Any, rate: Any) -> None:
    pass


@allocation_free
def _write_nothing(run: Any, same: Any, row: Any) -> None:
    pass


@cache
def _writer_of(channels: tuple[tuple[TelemetryChannel, int], ...]) -> Any:
    """Return one function that writes all channels of a run, without a loop over functions."""
    if not channels:
        return _write_nothing
    (channel, column), *others = channels
    write, write_others = channel.write, _writer_of(tuple(others))
    first, last = channel.parts[0], channel.parts[-1]

    @allocation_free
    def write_one(run: Any, same: Any, row: Any) -> None:
        write(row[column:], run[first])
        write_others(run, same, row)

    @allocation_free
    def write_two(run: Any, same: Any, row: Any) -> None:
        write(row[column:], run[first], run[last])
        write_others(run, same, row)

    return write_one if len(channel.parts) == 1 else write_two


@cache
def _body_of(
    law: Any, allocate: Any, estimate: Any, step: Any, write: Any, reduce: Any, law_signals: int, columns: Any
) -> Any:
    """Return the function that runs the loop of a run and reduces its telemetry, for `cuda.kernel_of`.

    Parameters
    ----------
    law, allocate, estimate, step : compiled functions
    write : compiled function
        Of `_writer_of`.
    reduce : compiled function
    law_signals : int
        First column of the signals of the law.
    columns : tuple
        Of `reduction.Reduction`, as `reduce`.
    """

    def run_loop(run: Any, data: Any, log: Any, arguments: Any) -> None:
        _, controllers, states, codes, done, fixed, inputs, tick = arguments
        if codes[run] != GOING:
            return
        controller = Controller(
            data.controller,
            controllers.parameters[run],
            controllers.memory[run],
            controllers.estimator_parameters[run],
            controllers.estimator_memory[run],
            controllers.tables,
        )
        stages = Stages(
            sense_stage,
            data.sensors,
            advance_stage,
            data.plant,
            fixed.tables,
            step,
            (write,),
            (data,),
            (data,),
            fixed.first_column,
            data.plant.rotor,
        )
        external = External(0, 0, fixed.unused, fixed.unused)
        for row in range(inputs.t.shape[0]):
            own = inputs_of(inputs, run, row)
            rows, code = loop(own, law, allocate, estimate, controller, stages, law_signals, external, log)
            done[run] += rows
            if rows > 0:
                reduce(log, tick + row, columns, states, run)
            if code != GOING:
                codes[run] = code
                return

    return run_loop
