"""Registration of the plugin: C callbacks of MuJoCo, one context for each instance in each `mjData`.

The callbacks of a step are compiled: the engine calls them from any thread, without Python. `init` is Python,
as it reads files and compiles `respond` for the kind of magnetics. It writes the address of a context into
`mjData.plugin_data`: words with the address of `respond`, that of the record of the coils, and a mark that
`destroy` clears. A later `init` releases the memory of cleared contexts.
"""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numba import types
from numpy.typing import NDArray

from spheretwin.models import actuator
from spheretwin.models.base import mujoco_library as library
from spheretwin.models.base.addresses import caller_of
from spheretwin.models.base.compiled import COMPILES, compiled_callback, stage_address, uncompiled
from spheretwin.models.base.errors import EngineError, SpheretwinError, exception_text
from spheretwin.models.base.record import Rows
from spheretwin.mujoco_plugin.coils import ACT_DOT, FORCE, SENSORS, coils_of, respond
from spheretwin.mujoco_plugin.configuration import PLUGIN, TORQUE, Attributes, Parts, quantity_of, read

RESPOND, COILS, EXISTS = 0, 1, 2
"""Words of a context."""

ARRAYS = {name: name for name in ("qpos", "qvel", "ctrl", "act", "act_dot", "sensordata")} | {
    "force": "actuator_force",
    "moment": "actuator_moment",
    "moment_row": "moment_rowadr",
}
"""Arrays of `mjData`, by the field of `Coils` with their address."""


class Context(NamedTuple):
    """Memory of one instance in one `mjData`."""

    words: NDArray[np.intp]
    coils: Rows  # array of one Coils, to which a word refers


_CONTEXTS: dict[int, Context] = {}
"""By the address of their words."""

_INVALID = Context(np.zeros(3, np.intp), np.zeros(0))
"""Of an instance that `init` has refused; `destroy` may be called for it."""

_WORDS = types.CPointer(types.intp)
_DATA = types.CPointer(types.CPointer(_WORDS))  # word of mjData, instance, word of the context
_PLUGIN_DATA = library.data_offset("plugin_data") // 8
_RESPOND = types.void(types.intp, types.intp)
_call_respond: Any = caller_of(_RESPOND)


def register() -> None:
    """Register the plugin in this process.

    Raises
    ------
    EngineError
        Functions are not compiled, or the layout of MuJoCo's structs is not the expected one.
    """
    if not COMPILES:
        raise EngineError(f"plugin {PLUGIN}: expected compiled functions, received NUMBA_DISABLE_JIT")
    actuator.load()  # inside `init` it would compile a model within the compilation of another
    bits = mujoco.mjtPluginCapabilityBit
    library.register_plugin(
        PLUGIN,
        tuple(Attributes.model_fields),
        int(bits.mjPLUGIN_ACTUATOR) | int(bits.mjPLUGIN_SENSOR),
        int(mujoco.mjtStage.mjSTAGE_ACC),
        {
            **{name: compiled_callback(*callback).address for name, callback in _COMPILED.items()},
            **{name: ctypes.cast(callback, ctypes.c_void_p).value or 0 for name, callback in _PYTHON.items()},
        },
    )


def _compute(model: int, data: Any, instance: int, capability: int) -> None:
    context = data[_PLUGIN_DATA][instance]
    _call_respond(context[RESPOND], context[COILS], SENSORS if capability == _SENSOR else FORCE)


def _act_dot(model: int, data: Any, instance: int) -> None:
    context = data[_PLUGIN_DATA][instance]
    _call_respond(context[RESPOND], context[COILS], ACT_DOT)


def _destroy(data: Any, instance: int) -> None:
    data[_PLUGIN_DATA][instance][EXISTS] = 0


def _reset(model: int, state: int, data: int, instance: int) -> None:
    """Do nothing: currents are activations, which the engine resets."""


def _nstate(model: int, instance: int) -> int:
    return 0


_SENSOR = int(mujoco.mjtPluginCapabilityBit.mjPLUGIN_SENSOR)
_COMPILED: dict[str, tuple[Any, Any]] = {
    "compute": (types.void(types.intp, _DATA, types.intc, types.intc), _compute),
    "actuator_act_dot": (types.void(types.intp, _DATA, types.intc), _act_dot),
    "destroy": (types.void(_DATA, types.intc), _destroy),
    "reset": (types.void(types.intp, types.intp, types.intp, types.intc), _reset),
    "nstate": (types.intc(types.intp, types.intc), _nstate),
}


def _init(model_address: int, data_address: int, instance: int) -> int:
    entries = library.data_array(data_address, "plugin_data", instance + 1, np.intp)
    entries[instance] = _INVALID.words.ctypes.data
    for address in [key for key, context in _CONTEXTS.items() if not context.words[EXISTS]]:
        del _CONTEXTS[address]
    try:
        context = _context(_parts(model_address, instance), data_address)
    except SpheretwinError as error:
        return _refuse(f"{error}")
    except Exception as error:  # the engine cannot receive an exception
        return _refuse(exception_text(error))
    _CONTEXTS[context.words.ctypes.data] = context
    entries[instance] = context.words.ctypes.data
    return 0


def _nsensordata(model_address: int, instance: int, sensor: int) -> int:
    """Return the number of entries of a sensor; 0 for an invalid name, which `init` refuses."""
    try:
        model = library.copy_of_model(model_address)
        is_torque = quantity_of(model, sensor) == TORQUE
        return 3 if is_torque else int(np.sum(model.actuator_plugin == instance))
    except Exception:
        return 0


_PYTHON = {
    "init": ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)(_init),
    "nsensordata": ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int, ctypes.c_int)(_nsensordata),
}


def _refuse(message: str) -> int:
    library.report_from_plugin(f"{PLUGIN}: {message.removeprefix('model: ')}")
    return -1


def _parts(model_address: int, instance: int) -> Parts:
    model = library.copy_of_model(model_address)
    texts = {name: library.plugin_config(model, instance, name) for name in Attributes.model_fields}
    return read(model, instance, texts)


def _context(parts: Parts, data_address: int) -> Context:
    addresses = {field: library.array_address(data_address, name) for field, name in ARRAYS.items()}
    coils = coils_of(parts, addresses)
    respond_address = stage_address(_RESPOND, uncompiled(respond), coils)
    return Context(np.array([respond_address, coils.ctypes.data, 1], np.intp), coils)
