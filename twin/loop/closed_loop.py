"""Closed loop: in each tick measure, control, advance the plant, log a row. Compiled, or in Python.

The controller or the plant can be outside of this process: the loop then calls a function in its place.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import is_jitted
from numpy.typing import NDArray

from spheretwin.control import allocation as allocations
from spheretwin.control import law as laws
from spheretwin.control.compensators.prediction import MEASURED
from spheretwin.control.controller import NO_TORQUE, Controller, ControllerData, control_tick
from spheretwin.control.estimators import estimator as estimators
from spheretwin.control.law import Law
from spheretwin.control.supervision.watchdog import GO, Reason, count_rundown, replace_invalid, trip
from spheretwin.loop.stages import Stages, call_advance, call_sense, call_write
from spheretwin.models.base.addresses import caller_of
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.callback_errors import report_error
from spheretwin.models.base.compiled import (
    COMPILES,
    allocation_free,
    compile_error,
    compiled_callback,
    copy_into,
    copy_rows,
    inlined,
    uncompiled,
)
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.function_identity import is_of_package
from spheretwin.models.base.vectors import WIDTH, load, total, vector
from spheretwin.models.telemetry.signals import MOTION_SIGNALS, offsets, width
from spheretwin.plant.plant_tick import (
    DIVERGED,
    FAILSAFE,
    GOING,
    LEFT_WORKSPACE,
    PlantOutput,
    TickInput,
)

_OFFSETS = offsets(MOTION_SIGNALS)
TIME, ANGLE, RATE = _OFFSETS["t_s"], _OFFSETS["q_rad"], _OFFSETS["qdot_rad_s"]
ANGLE_REF, RATE_REF, ERROR = _OFFSETS["q_ref_rad"], _OFFSETS["qdot_ref_rad_s"], _OFFSETS["error_rad"]
TORQUE_COMMAND, TORQUE = _OFFSETS["torque_command_Nm"], _OFFSETS["torque_Nm"]
_TEMPERATURE = int(Reason.TEMPERATURE)
INTERRUPTED = 4
DISTURBANCE, CURRENT_COMMAND = _OFFSETS["disturbance_Nm"], width(MOTION_SIGNALS)


class Inputs(NamedTuple):
    """External inputs of the loop, one row for each tick.

    Those of many runs have a further first index, of a run, in all but the times: of length 1 if all runs
    share an input.
    """

    t: NDArray[np.float64]  # (n,) s
    reference: NDArray[np.float64]  # (n, 3, 3) angle, rate, acceleration as rows
    disturbance: NDArray[np.float64]  # (n, 3) N·m, generalised, subtracted in (1)
    noise: NDArray[np.float64]  # (n, k) standard normal numbers of the sensors
    fault_noise: NDArray[np.float64]  # (n, m) of faults, and of the sensors of currents
    manual_A: NDArray[np.float64]  # (n, groups) manual currents; (n, 0) without


@inlined
def inputs_of(inputs: Inputs, run: int, row: int) -> Inputs:
    """Return the inputs of one of many runs, from a row on."""
    return Inputs(
        inputs.t[row:],
        inputs.reference[min(run, inputs.reference.shape[0] - 1), row:],
        inputs.disturbance[min(run, inputs.disturbance.shape[0] - 1), row:],
        inputs.noise[min(run, inputs.noise.shape[0] - 1), row:],
        inputs.fault_noise[min(run, inputs.fault_noise.shape[0] - 1), row:],
        inputs.manual_A[min(run, inputs.manual_A.shape[0] - 1), row:],
    )


EXTERNAL_SIGNATURE = types.int64(types.float64)
"""Time of the tick, s; returns the code of a status, `GOING` as a rule."""

call_external = caller_of(EXTERNAL_SIGNATURE)


class External(NamedTuple):
    """Functions of `EXTERNAL_SIGNATURE` for parts outside of this process; 0 for a simulated part.

    In compiled code they are addresses.
    """

    controller: Any  # reads the measurement, writes the manual currents
    plant: Any  # reads `command`, writes the next pose and currents of the plant, and `torque_S`
    command: NDArray[np.float64]  # (n,) A, of this tick, for the plant
    torque_S: NDArray[np.float64]  # (3,) N·m of these currents


NO_EXTERNAL = External(0, 0, np.zeros(0), np.zeros(3))


@allocation_free
def loop(
    inputs: Inputs,
    law: Any,
    allocate: Any,
    estimate: Any,
    controller: Controller,
    stages: Stages,
    law_signals: int,
    external: External,
    log: Array,
) -> tuple[int, int]:
    """Run one control tick for each row of `log`.

    Parameters
    ----------
    inputs : Inputs
        At least as many rows as `log`.
    law, allocate, estimate : address, or callable if nothing is compiled
        Functions of `control.law.SIGNATURE`, `control.allocation.SIGNATURE` and
        `control.estimators.estimator.SIGNATURE`.
    controller : Controller
        Changed in place, like the plant; neither accesses the other.
    stages : Stages
        Sensors, plant and channels.
    law_signals : int
        First column of the law's signals.
    external : External
        Parts outside of this process.
    log : (ticks, width) array
        Telemetry; each tick writes its row.

    Returns
    -------
    tuple of int
        Rows written, and `GOING`, `LEFT_WORKSPACE`, `DIVERGED`, `FAILSAFE` or `INTERRUPTED`.
    """
    data, rotor, manual_currents = controller.data, stages.rotor, inputs.manual_A.shape[1]
    reference, measurement = data.reference[:], data.measurement[: measured_rows(data)]
    watchdog, measured_A = data.supervision.watchdog, data.supervision.detector.measured_A[:]
    groups, fresh = measured_A.shape[0], data.fresh[:]
    first_current, scale = CURRENT_COMMAND + groups, CURRENT_COMMAND + 3 * groups
    first_mean = first_current + groups
    for tick in range(log.shape[0]):
        row, t, disturbance = log[tick], inputs.t[tick], inputs.disturbance[tick]
        draws = inputs.fault_noise[tick]
        is_finite = call_sense(
            stages.sense,
            stages.sensors,
            stages.plant,
            inputs.noise[tick],
            draws,
            measurement,
            fresh,
            measured_A,
        )
        copy_rows(inputs.reference[tick], reference)
        # Logged before the law is called, because the law may overwrite its arguments.
        write_motion(row, t, reference, rotor.q, rotor.qdot, disturbance)
        if not (is_finite or replace_invalid(watchdog, measurement)):
            return tick, DIVERGED
        copy_into(data.manual.current_A, 0, inputs.manual_A[tick], manual_currents)
        if external.controller != 0:
            code = call_external(external.controller, t)
            if code != GOING:
                return tick, code
        command = row[CURRENT_COMMAND:first_current]
        share = control_tick(controller, law, allocate, estimate, t, reference, measurement, command)
        if share == NO_TORQUE:
            return tick, DIVERGED
        row[scale] = share
        copy_into(row, TORQUE_COMMAND, data.torque_q, 3)
        copy_into(row, law_signals, controller.memory, data.logged)
        current, mean_current = row[first_current:first_mean], row[first_mean:scale]
        torque_S = row[TORQUE : TORQUE + 3]
        if external.plant == 0:
            given = TickInput(command, disturbance, draws, watchdog.halt)
            output = PlantOutput(current, mean_current, torque_S)
            status = call_advance(stages.advance, stages.plant, stages.tables, stages.step, given, output)
        else:
            copy_into(external.command, 0, command, groups)
            status = call_external(external.plant, t)
            copy_into(current, 0, command, groups)
            copy_into(mean_current, 0, command, groups)
            copy_into(torque_S, 0, external.torque_S, 3)
        if status == FAILSAFE and watchdog.reason == 0:
            trip(watchdog, _TEMPERATURE)
        for channel in range(stages.columns.shape[0]):
            call_write(
                stages.writers[channel],
                stages.parts[channel],
                stages.second_parts[channel],
                row[stages.columns[channel] :],
            )
        if not all_finite(row):  # the state cannot be continued either
            return tick, DIVERGED
        if status == FAILSAFE and watchdog.on:
            status = GOING  # the currents run down first
        if count_rundown(watchdog) or (status == LEFT_WORKSPACE and watchdog.halt != GO):
            status = FAILSAFE
        if status != GOING:
            return tick + 1, status
    return log.shape[0], GOING


@allocation_free
def measured_rows(data: ControllerData) -> int:
    """Return the rows of a measurement that the law receives."""
    return 2 * MEASURED if data.compensators.prediction.on else MEASURED


@allocation_free
def all_finite(row: Array) -> bool:
    """True if all numbers of a row are finite: zero times any other is NaN."""
    width = row.shape[0]
    left = width % (2 * WIDTH)
    even = odd = vector(0.0, 0.0, 0.0, 0.0)
    for column in range(0, width - left, 2 * WIDTH):
        even, odd = even + 0.0 * load(row, column), odd + 0.0 * load(row, column + WIDTH)
    rest = total(even + odd)
    for column in range(width - left, width):
        rest += 0.0 * row[column]
    return rest == 0.0


@allocation_free
def write_motion(row: Array, t: float, reference: Array, q: Array, qdot: Array, disturbance: Array) -> None:
    """Write the actual and the desired motion into a telemetry row."""
    row[TIME] = t
    for i in range(3):
        row[ANGLE + i], row[RATE + i] = q[i], qdot[i]
        row[ANGLE_REF + i], row[RATE_REF + i] = reference[0, i], reference[1, i]
        row[ERROR + i], row[DISTURBANCE + i] = q[i] - reference[0, i], disturbance[i]


class Functions(NamedTuple):
    """Callback functions of the loop: addresses in compiled code, otherwise functions."""

    law: Any
    """0 if it is in plain Python and the loop is compiled."""
    allocate: Any
    estimate: Any
    """0 if no rates are estimated."""
    callbacks: tuple[Any, ...]
    """Kept because compiled code holds only their addresses."""


def dispatch(
    law: Law,
    allocate: Callable[..., float],
    estimate: Callable[..., None] | None = None,
    *,
    check_bounds: bool = False,
) -> Functions:
    """Return the callbacks for a law, an allocation and an estimator of rates.

    Parameters
    ----------
    law : Law
    allocate, estimate : callable
    check_bounds : bool
        Compile the law with bounds checks; in Python, NumPy checks them.

    Raises
    ------
    InputError
        numba cannot compile the law.
    """
    if not COMPILES:
        step = step_that_writes(law) if is_user_law(law) else law.step
        return Functions(step, allocate, estimate or 0, ())
    callbacks = (
        None if is_python_law(law) else _law_callback(law, check_bounds),
        compiled_callback(allocations.SIGNATURE, allocate),
        compiled_callback(estimators.SIGNATURE, estimate) if estimate else None,
    )
    of_law, of_allocation, of_estimator = (callback.address if callback else 0 for callback in callbacks)
    return Functions(of_law, of_allocation, of_estimator, callbacks)


def _law_callback(law: Law, check_bounds: bool) -> Any:
    try:
        return compiled_callback(laws.SIGNATURE, law.step, check_bounds=check_bounds)
    except Exception as error:  # numba also raises errors of other kinds, such as AttributeError
        if not is_user_law(law):
            raise
        raise InputError(
            f"law {law.name}: expected a function of (t, reference, measurement, parameters, state,"
            f" torque) that numba compiles, received {compile_error(error, law.step)}"
        ) from error


def step_that_writes(law: Law) -> Callable[..., None]:
    """Return the step of a law in plain Python, whose exceptions end the run as those of compiled code.

    A returned value, or no torque, is an exception.
    """
    step = uncompiled(law.step)

    def call(
        t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
    ) -> None:
        try:
            returned = step(t, reference, measurement, parameters, state, torque)
            if returned is not None or np.all(np.isnan(torque)):
                received = "no torque" if returned is None else "a returned value, which is not used"
                raise ValueError(f"{received}: write the torque into the last argument, torque[:] = …")
        except BaseException as error:  # the user's code may raise anything
            if not report_error(error):
                raise

    return call


def is_user_law(law: Law) -> bool:
    """True if a law is a user law, not one of this package."""
    return not is_of_package(law.step)


def is_python_law(law: Law) -> bool:
    """True if a law is a user law in plain Python."""
    return is_user_law(law) and not is_jitted(law.step)
