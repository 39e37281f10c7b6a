"""Stages of a tick that are compiled alone: the loop calls them by address, with the addresses of their data.

The loop is compiled once for a controller; another engine, drive, sensor or channel compiles only its stage.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from spheretwin.channels import CHANNELS, Channel
from spheretwin.control.controller import Controller
from spheretwin.electronics.sensor_chain import sense
from spheretwin.models.base.compiled import COMPILES, stage_address
from spheretwin.models.base.numba_internals.addresses import function_at, in_memory
from spheretwin.models.base.record import Rows
from spheretwin.models.telemetry.signals import Signal, offsets
from spheretwin.plant.plant_tick import Plant, PlantOutput, plant_tick

Array = NDArray[np.float64]

_ROW, _ROWS = types.float64[::1], types.float64[:, ::1]
_SENSE = types.boolean(types.intp, _ROW, _ROW, _ROW, _ROW, _ROWS)
_ADVANCE = types.int64(types.intp, _ROW, _ROW, _ROW, _ROW, _ROW)
_WRITE = types.void(types.intp, types.intp, _ROW)

sense_at, advance_at, write_at = function_at(_SENSE), function_at(_ADVANCE), function_at(_WRITE)


class Stages(NamedTuple):
    """Stages as the loop calls them, and the arrays of the plant that the loop itself reads.

    Functions and their data, which are the first arguments, are addresses in compiled code. In Python they
    are functions and tuples with one entry.
    """

    sense: Any  # (sensors, q, qdot, noise, draws, measurement): true if the measurement is finite
    sensors: Any
    advance: Any  # (plant, command, disturbance, current, mean current, torque): code of a status
    plant: Any
    writers: Any  # (part, second part, row), one for each channel of the run
    parts: Any  # data of the writers
    second_parts: Any
    columns: NDArray[np.intp]  # first columns of these channels
    q: Array  # (3,) rad
    qdot: Array  # (3,) rad/s
    current: Array  # (n,) A
    draws: Array
    current_sensors: Rows  # of CurrentSensors


class Stage(NamedTuple):
    """A stage, and the memory that its address of data refers to."""

    function: Any
    data: Any
    memory: Any


def plant_stage(plant: Plant) -> Stage:
    """Compile the stage of a plant, which `advance_at` calls."""
    memory, data = _data(plant)
    return Stage(_function(_ADVANCE, _advance, plant), data, memory)


def compiled_stages(
    controller: Controller, sensors: Rows, plant: Plant, signals: tuple[Signal, ...]
) -> tuple[Stages, list[Any]]:
    """Compile the stages of a run; return them and the memory that they have addresses of.

    Parameters
    ----------
    controller : Controller
    sensors : array of SensorChain
    plant : Plant
    signals : tuple of Signal
        Columns of the run: its channels are among them.
    """
    parts: dict[str, Any] = {"controller": controller, "sensors": sensors, "plant": plant}
    memories, data = {}, {}
    for name, part in parts.items():
        memories[name], data[name] = _data(part)
    first = offsets(signals)
    logged = {channel: name for channel in CHANNELS if (name := channel.signals(1)[0].name) in first}
    reads = [channel.parts for channel in logged]
    writers = [
        _function(_WRITE, _writer(channel), *(parts[name] for name in channel.parts)) for channel in logged
    ]
    sequence: Callable[[list[Any]], Any] = (lambda values: np.array(values, np.intp)) if COMPILES else list
    stages = Stages(
        _function(_SENSE, _sense, sensors),
        data["sensors"],
        _function(_ADVANCE, _advance, plant),
        data["plant"],
        sequence(writers),
        sequence([data[names[0]] for names in reads]),
        sequence([data[names[-1]] for names in reads]),
        np.array([first[name] for name in logged.values()], np.intp),
        plant.rotor["q"][0],
        plant.rotor["qdot"][0],
        plant.current,
        plant.draws,
        plant.current_sensors,
    )
    return stages, list(memories.values())


def _function(signature: Any, function: Callable[..., Any], *parts: Any) -> Any:
    return stage_address(signature, function, *parts) if COMPILES else function


def _data(part: Any) -> tuple[Any, Any]:
    """Return the memory of a part, and what a stage gets of it."""
    memory = in_memory(part) if COMPILES else (part,)
    return memory, memory.ctypes.data if isinstance(memory, np.ndarray) else memory


def _sense(sensors: Any, q: Array, qdot: Array, noise: Array, draws: Array, measurement: Array) -> bool:
    return bool(sense(sensors[0][0], q, qdot, noise, draws, measurement))


def _advance(
    plant: Any, command: Array, disturbance: Array, current: Array, mean_current: Array, torque_S: Array
) -> int:
    return plant_tick(plant[0], command, disturbance, PlantOutput(current, mean_current, torque_S))


@cache
def _writer(channel: Channel) -> Callable[..., None]:
    write = channel.write

    def of_one(part: Any, _: Any, row: Array) -> None:
        write(row, part[0])

    def of_two(part: Any, second: Any, row: Array) -> None:
        write(row, part[0], second[0])

    return of_two if len(channel.parts) == 2 else of_one
