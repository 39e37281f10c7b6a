"""Stages of a tick that are compiled alone: the loop calls them by address, with the addresses of their data.

The loop is compiled once for a controller; another engine, drive, sensor or channel compiles only its stage.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from spheretwin.channels import CHANNELS, Channel
from spheretwin.electronics.sensor_chain import sense
from spheretwin.models.base.addresses import caller_of
from spheretwin.models.base.compiled import COMPILES, stage_address
from spheretwin.models.base.record import Rows
from spheretwin.models.magnetics import Tables
from spheretwin.models.telemetry.signals import Signal, offsets
from spheretwin.plant.plant_tick import PlantOutput, TickInput, engine_step, plant_tick

Array = NDArray[np.float64]

_ROW, _ROWS, _FIELD = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_TABLES = types.NamedTuple((_ROWS, _FIELD), Tables)
_GIVEN = types.NamedTuple((_ROW, _ROW, _ROW, types.int64), TickInput)
_OUTPUT = types.NamedUniTuple(_ROW, 3, PlantOutput)
_SENSE = types.boolean(types.intp, _ROW, _ROW, _ROW, _ROW, _ROWS)
_ADVANCE = types.int64(types.intp, _TABLES, types.intp, _GIVEN, _OUTPUT)
_WRITE = types.void(types.intp, types.intp, _ROW)

call_sense, call_advance, call_write = caller_of(_SENSE), caller_of(_ADVANCE), caller_of(_WRITE)


class Stages(NamedTuple):
    """Stages as the loop calls them, and the parts of the plant that the loop itself reads.

    Functions and their data, which are the first arguments, are addresses in compiled code. In Python they
    are functions and records.
    """

    sense: Any  # (sensors, q, qdot, noise, draws, measurement): true if the measurement is finite
    sensors: Any
    advance: Any  # (plant, tables, step, given, output): code of a status
    plant: Any
    tables: Tables  # of the true magnetics
    step: Any  # of the engine
    writers: Any  # (part, second part, row), one for each channel of the run
    parts: Any  # data of the writers
    second_parts: Any
    columns: NDArray[np.intp]  # first columns of these channels
    joint_q: Array  # (3,) rad, which the sensors measure
    q: Array  # (3,) rad
    qdot: Array  # (3,) rad/s
    current: Array  # (n,) A
    current_sensors: Rows  # array of one CurrentSensors


class PlantStage(NamedTuple):
    """Stage of a plant: function and first three arguments of `call_advance`."""

    advance: Any
    plant: Any
    tables: Tables
    step: Any


def plant_stage(plant: Rows, tables: Tables, engine: str) -> PlantStage:
    """Compile the stage of a plant.

    Parameters
    ----------
    plant : array of one Plant
        It must exist as long as the stage is called.
    tables : Tables
        Of its magnetics.
    engine : str
        Name of its engine.
    """
    step = engine_step(engine)
    return PlantStage(
        _function(_ADVANCE, _advance, plant), _data(plant), tables, getattr(step, "address", step)
    )


def compiled_stages(parts: Mapping[str, Rows], plant: PlantStage, signals: tuple[Signal, ...]) -> Stages:
    """Compile the stages of a run.

    Parameters
    ----------
    parts : mapping of str to array of one record
        `controller`, `sensors` and `plant`; they must exist as long as the stages are called.
    plant : PlantStage
    signals : tuple of Signal
        Columns of the run: its channels are among them.
    """
    first = offsets(signals)
    logged = {channel: name for channel in CHANNELS if (name := channel.signals(1)[0].name) in first}
    reads = [channel.parts for channel in logged]
    writers = [
        _function(_WRITE, _writer(channel), *(parts[name] for name in channel.parts)) for channel in logged
    ]
    sequence: Callable[[list[Any]], Any] = (lambda values: np.array(values, np.intp)) if COMPILES else list
    true = parts["plant"]
    return Stages(
        _function(_SENSE, _sense, parts["sensors"]),
        _data(parts["sensors"]),
        *plant,
        sequence(writers),
        sequence([_data(parts[names[0]]) for names in reads]),
        sequence([_data(parts[names[-1]]) for names in reads]),
        np.array([first[name] for name in logged.values()], np.intp),
        true["joint_q"][0],
        true["rotor"]["q"][0],
        true["rotor"]["qdot"][0],
        true["current"][0],
        true["current_sensors"],
    )


def _function(signature: Any, function: Callable[..., Any], *parts: Any) -> Any:
    return stage_address(signature, function, *parts) if COMPILES else function


def _data(rows: Rows) -> Any:
    """Return what a stage gets of an array of one record."""
    return rows.ctypes.data if COMPILES else rows[0]


def _sense(sensors: Any, q: Array, qdot: Array, noise: Array, draws: Array, measurement: Array) -> bool:
    return bool(sense(sensors, q, qdot, noise, draws, measurement))


def _advance(plant: Any, tables: Tables, step: Any, given: TickInput, output: PlantOutput) -> int:
    return plant_tick(plant, tables, step, given, output)


@cache
def _writer(channel: Channel) -> Callable[..., None]:
    write = channel.write

    def of_one(part: Any, _: Any, row: Array) -> None:
        write(row, part)

    def of_two(part: Any, second: Any, row: Array) -> None:
        write(row, part, second)

    return of_two if len(channel.parts) == 2 else of_one
