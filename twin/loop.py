"""One control tick after another: the closed loop, compiled, or in Python for a plain Python law."""

from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.allocation import allocate
from spheretwin.control.bounded_allocation import SCRATCH_ROWS, allocate_bounded
from spheretwin.control.sliding import sliding_surface
from spheretwin.models.compiled import compiled
from spheretwin.models.kinematics import cartesian_torque
from spheretwin.models.magnetics import fill_torque_matrix
from spheretwin.models.telemetry import SIGNALS, offsets, width
from spheretwin.twin.plant.drive import advance
from spheretwin.twin.plant.stepping import step

COMPLETED, LEFT_WORKSPACE, DIVERGED = 0, 1, 2

# The rotor's fastest move within the workspace is some hundred rad/s; far above it, and far below the
# engine's own bound of 1e10, the motion is no longer one.
FASTEST_RATE = 1e6

_OFFSETS = offsets(SIGNALS)
TIME, ANGLE, RATE = _OFFSETS["t_s"], _OFFSETS["q_rad"], _OFFSETS["qdot_rad_s"]
ANGLE_REF, RATE_REF, ERROR = _OFFSETS["q_ref_rad"], _OFFSETS["qdot_ref_rad_s"], _OFFSETS["error_rad"]
TORQUE_COMMAND, TORQUE = _OFFSETS["torque_command_Nm"], _OFFSETS["torque_Nm"]
DISTURBANCE, SCALE = _OFFSETS["disturbance_Nm"], _OFFSETS["allocation_scale"]
CURRENT_COMMAND, CURRENT = _OFFSETS["current_command_A"], _OFFSETS["current_A"]
SLIDING, OF_THE_LAW = _OFFSETS["sliding_s"], width(SIGNALS)


class Inputs(NamedTuple):
    """What is known of a run before it starts, one row a tick."""

    t: NDArray[np.float64]  # (n,) s
    reference: NDArray[np.float64]  # (n, 3, 3) angle, rate, acceleration as rows
    disturbance: NDArray[np.float64]  # (n, 3) N·m, generalised, subtracted in (1)


class Settings(NamedTuple):
    """Constants of a run."""

    substeps: int
    hinge_range: NDArray[np.float64]  # (3, 2) rad
    modelling_torque: NDArray[np.float64]  # (3,) N·m, unknown to the controller
    surface_slope: float  # 1/s, of the logged sliding variable
    bounded: bool  # allocate all that the current limit allows, not the scaled least-norm currents


class Memory(NamedTuple):
    """What the loop carries from one chunk of ticks to the next."""

    current: NDArray[np.float64]  # (18,) A
    law: NDArray[np.float64]  # state of the law


@compiled
def loop(  # type: ignore[no-untyped-def]
    first, last, law, parameters, memory, inputs, settings, engine, magnetics, drive, log
):
    """Run the control ticks from `first` up to, not including, `last`.

    Each tick: reference, measurement, law, generalised torque to Cartesian, currents; then, each
    physics step: coil currents, torque on the rotor, engine. One row of `log` a tick.

    Parameters
    ----------
    first, last : int
        Range of ticks.
    law : function of `control.law.SIGNATURE`
        Compiled, or a plain Python function in the uncompiled loop (``loop.py_func``).
    parameters : (n,) array
        Of the law.
    memory : Memory
        Changed in place.
    inputs : Inputs
    settings : Settings
    engine : Engine or Equations
        The plant, changed in place.
    magnetics : TorqueModel
    drive : Drive
    log : (ticks, width) array
        Telemetry; rows are written as they happen.

    Returns
    -------
    tuple of int
        Ticks completed since the start of the run, and `COMPLETED`, `LEFT_WORKSPACE` or `DIVERGED`.
    """
    groups = memory.current.shape[0]
    reference, measurement = np.empty((3, 3)), np.empty((2, 3))
    torque_q, torque_S = np.empty(3), np.empty(3)
    command, current = np.empty(groups), np.empty(groups)
    G, scratch = np.empty((3, groups)), np.empty((SCRATCH_ROWS, groups))
    for tick in range(first, last):
        disturbance, row = inputs.disturbance[tick], log[tick]
        for i in range(3):
            measurement[0, i], measurement[1, i] = engine.q[i], engine.qdot[i]
            for order in range(3):
                reference[order, i] = inputs.reference[tick, order, i]
            torque_q[i] = np.nan  # a law that writes no torque, or raises, must not go unnoticed
        # Logged before the law is called: it may write into all that it is handed.
        write_row(row, inputs.t[tick], reference, measurement, disturbance, settings.surface_slope)
        law(inputs.t[tick], reference, measurement, parameters, memory.law, torque_q)
        if not isfinite(torque_q[0] + torque_q[1] + torque_q[2]):
            return tick, DIVERGED
        cartesian_torque(engine.q, torque_q, torque_S)
        fill_torque_matrix(engine.q, magnetics, G, scratch)
        if settings.bounded:
            scale = allocate_bounded(G, torque_S, drive.current_limit_A, command, scratch)
        else:
            scale = allocate(G, torque_S, drive.current_limit_A, command)
        row[SCALE] = scale
        for substep in range(settings.substeps):
            if substep > 0:
                fill_torque_matrix(engine.q, magnetics, G, scratch)
            advance(drive, command, memory.current, current)
            rotor_torque(G, current, engine.torque_S)
            if substep == 0:
                put(row, TORQUE_COMMAND, torque_q, 3)
                put(row, TORQUE, engine.torque_S, 3)
                put(row, CURRENT_COMMAND, command, groups)
                put(row, CURRENT, current, groups)
                put(row, OF_THE_LAW, memory.law, row.shape[0] - OF_THE_LAW)
                for i in range(3):
                    engine.torque_q[i] = -disturbance[i] - settings.modelling_torque[i]
            step(engine)
            for i in range(3):
                if not abs(engine.qdot[i]) < FASTEST_RATE:  # also where it is not a number
                    return tick + 1, DIVERGED
        for i in range(3):
            if not settings.hinge_range[i, 0] <= engine.q[i] <= settings.hinge_range[i, 1]:
                return tick + 1, LEFT_WORKSPACE
    return last, COMPLETED


@compiled
def rotor_torque(G: NDArray[np.float64], current: NDArray[np.float64], torque_S: NDArray[np.float64]) -> None:
    """``torque_S = G current`` (15)."""
    for i in range(3):
        total = 0.0
        for j in range(current.shape[0]):
            total += G[i, j] * current[j]
        torque_S[i] = total


@compiled
def put(row: NDArray[np.float64], first: int, values: NDArray[np.float64], count: int) -> None:
    """Copy leading values into a row; a slice would be checked for overlap, at twice the time."""
    for i in range(count):
        row[first + i] = values[i]


@compiled
def write_row(row, t, reference, measurement, disturbance, slope):  # type: ignore[no-untyped-def]
    """Write the part of a telemetry row that says where the rotor is and should be."""
    row[TIME] = t
    for i in range(3):
        error, error_rate = measurement[0, i] - reference[0, i], measurement[1, i] - reference[1, i]
        row[ANGLE + i], row[RATE + i] = measurement[0, i], measurement[1, i]
        row[ANGLE_REF + i], row[RATE_REF + i] = reference[0, i], reference[1, i]
        row[ERROR + i], row[DISTURBANCE + i] = error, disturbance[i]
        row[SLIDING + i] = sliding_surface(error, error_rate, slope)
