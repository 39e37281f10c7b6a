"""Stages of a tick that are compiled alone: the loop calls them by address, with the addresses of their data.

The loop is compiled once for a controller; another engine, drive, sensor or channel compiles only its stage.
The stages of many runs have the same functions, and addresses for each run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from spheretwin.electronics.hall_array import sense_pose
from spheretwin.electronics.sensor_chain import sense
from spheretwin.electronics.transducers import sense_currents
from spheretwin.loop.channels import TelemetryChannel, logged_channels
from spheretwin.models.base.addresses import caller_of
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import (
    COMPILES,
    allocation_free,
    copy_into,
    part_of_its_caller,
    stage_address,
    uncompiled,
)
from spheretwin.models.base.record import Rows
from spheretwin.models.magnetics import Tables
from spheretwin.models.telemetry.signals import Signal
from spheretwin.plant.plant_tick import PlantOutput, TickInput, engine_step, plant_tick

_ROW, _ROWS, _FIELD = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_TABLES = types.NamedTuple((_ROWS, _FIELD), Tables)
_GIVEN = types.NamedTuple((_ROW, _ROW, _ROW, types.int64), TickInput)
_OUTPUT = types.NamedUniTuple(_ROW, 3, PlantOutput)
_SENSE = types.boolean(types.intp, types.intp, _ROW, _ROW, _ROWS, _ROW, _ROW)
_ADVANCE = types.int64(types.intp, _TABLES, types.intp, _GIVEN, _OUTPUT)
_WRITE = types.void(types.intp, types.intp, _ROW)

call_sense, call_advance, call_write = caller_of(_SENSE), caller_of(_ADVANCE), caller_of(_WRITE)


class Stages(NamedTuple):
    """Stages as the loop calls them, and the part of the plant that the loop itself reads.

    Functions and their data, which are the first arguments, are addresses in compiled code. In Python they
    are functions and records. Those of many runs have arrays with an entry for each run in place of the data.
    """

    sense: Any  # (sensors, plant, noise, draws, measurement, fresh, measured_A): true if it is finite
    sensors: Any
    advance: Any  # (plant, tables, step, given, output): code of a status
    plant: Any
    tables: Tables  # of the true magnetics
    step: Any  # of the engine
    writers: Any  # (part, second part, row), one for each channel of the run
    parts: Any  # data of the writers
    second_parts: Any
    columns: NDArray[np.intp]  # first columns of these channels
    rotor: Any  # RotorData


@part_of_its_caller
def stages_of(stages: Stages, run: int) -> Stages:
    """Return the stages of one of many runs."""
    return Stages(
        stages.sense,
        stages.sensors[run],
        stages.advance,
        stages.plant[run],
        stages.tables,
        stages.step,
        stages.writers,
        stages.parts[run],
        stages.second_parts[run],
        stages.columns,
        stages.rotor[run],
    )


class PlantStage(NamedTuple):
    """Stage of a plant: function and first three arguments of `call_advance`; data as in `Stages`."""

    advance: Any
    plant: Any
    tables: Tables
    step: Any


def plant_stage(plant: Rows, tables: Tables, engine: str) -> PlantStage:
    """Compile the stage of a plant.

    Parameters
    ----------
    plant : array of Plant
        It must exist as long as the stage is called.
    tables : Tables
        Of the magnetics of all of them.
    engine : str
        Name of their engine.
    """
    step = engine_step(engine)
    return PlantStage(
        _function(_ADVANCE, uncompiled(advance_stage), plant),
        _data(plant),
        tables,
        getattr(step, "address", step),
    )


def compiled_stages(parts: Mapping[str, Rows], plant: PlantStage, signals: tuple[Signal, ...]) -> Stages:
    """Compile the stages of some runs.

    Parameters
    ----------
    parts : mapping of str to array of records
        `controller`, `sensors` and `plant`, and `hall` of runs with a Hall array, which then senses the
        angles; they must exist as long as the stages are called.
    plant : PlantStage
    signals : tuple of Signal
        Columns of the runs: their channels are among them.
    """
    logged = dict(logged_channels(signals))
    reads = [channel.parts for channel in logged]
    writers = [
        _function(_WRITE, _writer(channel), *(parts[name] for name in channel.parts)) for channel in logged
    ]
    runs = len(parts["plant"])
    sense_angles, sensors = (
        (sense_hall_stage, parts["hall"]) if "hall" in parts else (sense_stage, parts["sensors"])
    )
    return Stages(
        _function(_SENSE, uncompiled(sense_angles), sensors, parts["plant"]),
        _data(sensors),
        *plant,
        np.array(writers, np.intp) if COMPILES else writers,
        _table([_data(parts[names[0]]) for names in reads], runs),
        _table([_data(parts[names[-1]]) for names in reads], runs),
        np.array(list(logged.values()), np.intp),
        parts["plant"]["rotor"],
    )


def _function(signature: Any, function: Callable[..., Any], *parts: Any) -> Any:
    return stage_address(signature, function, *parts) if COMPILES else function


def _data(rows: Rows) -> Any:
    """Return what a stage gets of the record of each run."""
    return rows.ctypes.data + rows.strides[0] * np.arange(len(rows)) if COMPILES else rows


def _table(columns: Sequence[Any], runs: int) -> Any:
    """Return the data of all channels for each run."""
    if COMPILES:
        return np.array(columns, np.intp).reshape(-1, runs).T.copy()
    return [[column[run] for column in columns] for run in range(runs)]


@allocation_free
def sense_stage(
    sensors: Any, plant: Any, noise: Array, draws: Array, measurement: Array, fresh: Array, measured_A: Array
) -> bool:
    """Measure angles and currents; return whether they are finite."""
    is_finite = sense(sensors, plant.joint_q, plant.rotor.qdot, noise, draws, measurement)
    currents = plant.current_sensors
    copy_into(fresh, 0, sensors.fresh, fresh.shape[0])
    if currents.on:
        sense_currents(currents, plant.current, draws)
        copy_into(measured_A, 0, currents.measured_A, measured_A.shape[0])
    return bool(is_finite)


@allocation_free
def sense_hall_stage(
    hall: Any, plant: Any, noise: Array, draws: Array, measurement: Array, fresh: Array, measured_A: Array
) -> bool:
    """Measure currents, field and pose as `sense_stage`; every angle is new."""
    currents = plant.current_sensors
    sense_currents(currents, plant.current, draws)
    copy_into(measured_A, 0, currents.measured_A, measured_A.shape[0])
    for i in range(fresh.shape[0]):
        fresh[i] = 1.0
    return bool(sense_pose(hall, plant, noise, measurement))


@allocation_free
def advance_stage(plant: Any, tables: Tables, step: Any, given: TickInput, output: PlantOutput) -> int:
    """Advance the plant by a control period, `plant_tick`."""
    return plant_tick(plant, tables, step, given, output)


@cache
def _writer(channel: TelemetryChannel) -> Callable[..., None]:
    write = channel.write

    def of_one(part: Any, _: Any, row: Array) -> None:
        write(row, part)

    def of_two(part: Any, second: Any, row: Array) -> None:
        write(row, part, second)

    return of_two if len(channel.parts) == 2 else of_one
