"""Private APIs of MuJoCo and pointers into its shared library, all in this file.

*Addresses of models and data* (`MjModel._address`, `MjData._address`) and of `mj_step`. Reason: compiled code
steps the engine without Python. Consequence of a change: an exception at the start of a session, and after
a change of the C function an invalid access to memory.

*Pointers of the library* (`mjcb_time`, `mju_user_warning`). Reason: `mujoco` has no function for them that
Python can call. Consequence of a change: an exception at the first model or command.

*Structs of plugins and of `mjData`* (`mjpPlugin`, `mujoco.introspect`, `MjModel._from_model_ptr`). Reason:
the Python package has no function that registers a plugin, and a plugin receives addresses alone. Consequence
of a change: `register_plugin` raises an exception, as it compares the layout with a model first.

`tests/models/base/test_internals.py` checks each of them; `pyproject.toml` bounds the versions.
"""

import ctypes
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import EngineError


@cache
def library() -> ctypes.CDLL:
    """Return the library that the `mujoco` package has loaded."""
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so.*", "libmujoco.*.dylib", "mujoco.dll"):
        for path in folder.glob(pattern):
            return ctypes.CDLL(str(path))
    raise EngineError(f"engine: expected MuJoCo's shared library in {folder}, found none")


def addresses(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[int, int]:
    """Return the addresses of a model and of its data; they are valid as long as both objects exist."""
    return model._address, data._address


def step_address() -> int:
    """Return the address of `mj_step`, a C function of the addresses of a model and of its data."""
    return ctypes.cast(library().mj_step, ctypes.c_void_p).value or 0


def _ignore(_: bytes) -> None:
    """Ignore a warning; MuJoCo counts it in `mjData.warning`, which a run reads."""


_quiet = ctypes.CFUNCTYPE(None, ctypes.c_char_p)(_ignore)


@contextmanager
def timers_stopped() -> Iterator[None]:
    """Run MuJoCo without its profiling timers (`mjData.timer`), which take half of the step of a small model.

    They read the clock 98 times a step of RK4. The switch is global to the process, so that a program sets
    it, not a library: `mujoco` has no function for it that Python can call.
    """
    clock = ctypes.c_void_p.in_dll(library(), "mjcb_time")
    before, clock.value = clock.value, None
    try:
        yield
    finally:
        clock.value = before


_COMPILING = Lock()  # Python's warnings are one list for all threads


@contextmanager
def compiler_warnings() -> Iterator[list[str]]:
    """Yield a list of the warnings of MuJoCo's compiler during the block: one line each, without repetition.

    The Python package raises them as warnings of several lines each, again at each compilation.
    """
    lines: list[str] = []
    with _COMPILING, warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        yield lines
        lines += dict.fromkeys(" ".join(str(warning.message).split()) for warning in raised)


def silence_warnings() -> None:
    """Suppress MuJoCo's warnings on stderr and in a log file in the current folder."""
    handler = ctypes.c_void_p.in_dll(library(), "mju_user_warning")
    handler.value = ctypes.cast(_quiet, ctypes.c_void_p).value


_CALLBACKS = (
    "nstate", "nsensordata", "init", "destroy", "copy", "reset", "compute", "advance", "visualize",
    "actuator_act_dot", "sdf_distance", "sdf_gradient", "sdf_staticdistance", "sdf_attribute", "sdf_aabb",
)  # fmt: skip


class _Plugin(ctypes.Structure):
    """`mjpPlugin` of mjplugin.h."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("nattribute", ctypes.c_int),
        ("attributes", ctypes.POINTER(ctypes.c_char_p)),
        ("capabilityflags", ctypes.c_int),
        ("needstage", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in _CALLBACKS),
    )


def register_plugin(
    name: str, attributes: Sequence[str], capabilities: int, stage: int, callbacks: Mapping[str, int]
) -> None:
    """Register an engine plugin for the rest of the process.

    Parameters
    ----------
    name : str
        For the attribute ``plugin`` in MJCF.
    attributes : sequence of str
        Keys of its ``config`` elements.
    capabilities : int
        Sum of `mjtPluginCapabilityBit`.
    stage : int
        `mjtStage` in which its sensors are computed.
    callbacks : mapping of str to int
        Addresses of C functions by their field in `mjpPlugin`; they must stay valid.

    Raises
    ------
    EngineError
        The layout of MuJoCo's structs is not the expected one.
    """
    _check_layout()
    texts = (ctypes.c_char_p * len(attributes))(*(text.encode() for text in attributes))
    plugin = _Plugin()
    library().mjp_defaultPlugin(ctypes.byref(plugin))
    plugin.name, plugin.nattribute, plugin.attributes = name.encode(), len(attributes), texts
    plugin.capabilityflags, plugin.needstage = capabilities, stage
    for field, address in callbacks.items():
        setattr(plugin, field, address)
    library().mjp_registerPlugin(ctypes.byref(plugin))  # it copies the struct and the texts


def copy_of_model(address: int) -> mujoco.MjModel:
    """Return a copy of the model at an address."""
    copy = library().mj_copyModel
    copy.restype, copy.argtypes = ctypes.c_void_p, (ctypes.c_void_p, ctypes.c_void_p)
    return mujoco.MjModel._from_model_ptr(copy(None, address))  # it owns the copy


def plugin_config(model: mujoco.MjModel, instance: int, key: str) -> str:
    """Return a config attribute of a plugin instance; an empty text if it is not given."""
    read = library().mj_getPluginConfig
    read.restype, read.argtypes = ctypes.c_char_p, (ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p)
    text: bytes = read(model._address, instance, key.encode()) or b""
    return text.decode(errors="replace")


def report_from_plugin(message: str) -> None:
    """Issue a warning of the engine; during compilation it becomes part of the error."""
    library().mju_warning(b"%s", message.encode())


def data_array(address: int, field: str, size: int, kind: Any = np.float64) -> NDArray[Any]:
    """Return a view of the first entries of an array of the `mjData` at an address, valid while it exists.

    Parameters
    ----------
    address : int
        Of the data.
    field : str
        Name of an array.
    size : int
        Length of the view.
    kind : dtype
        Of its entries; default: `mjtNum`.
    """
    first = array_address(address, field)
    length = size * np.dtype(kind).itemsize
    return np.frombuffer((ctypes.c_byte * length).from_address(first), kind) if first else np.empty(0, kind)


def array_address(address: int, field: str) -> int:
    """Return the address of an array of the `mjData` at an address; 0 if it has no entry."""
    return ctypes.c_void_p.from_address(address + data_offset(field)).value or 0


@cache
def data_offset(field: str) -> int:
    """Return the offset of a field in `mjData`, in bytes."""
    offset: int = getattr(_data_layout(), field).offset
    return offset


@cache
def _data_layout() -> type[ctypes.Structure]:
    from mujoco.introspect.structs import STRUCTS

    return _struct(STRUCTS["mjData"])


_PRIMITIVES = {
    "int": ctypes.c_int, "mjtNum": ctypes.c_double, "mjtSize": ctypes.c_int64, "mjtBool": ctypes.c_bool,
    "size_t": ctypes.c_size_t, "uintptr_t": ctypes.c_size_t, "uint64_t": ctypes.c_uint64,
    "float": ctypes.c_float,
}  # fmt: skip


def _struct(declaration: Any) -> type[ctypes.Structure]:
    fields = [(field.name, _c_type(field.type)) for field in declaration.fields]
    return type(declaration.name, (ctypes.Structure,), {"_fields_": fields})


def _c_type(declared: Any) -> Any:
    from mujoco.introspect.structs import STRUCTS

    extents = getattr(declared, "extents", None)
    if extents is not None:
        return _c_type(declared.inner_type) * int(np.prod(extents))
    if hasattr(declared, "inner_type"):
        return ctypes.c_void_p
    return _PRIMITIVES.get(declared.name) or _struct(STRUCTS[declared.name])


def _check_layout() -> None:
    """Compare the layout of `mjData` with arrays that Python sees."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(mass=1, inertia=[1, 1, 1])
    body.add_joint()
    model = spec.compile()
    data = mujoco.MjData(model)
    for field in ("qpos", "qvel", "qacc", "xpos", "qfrc_actuator"):
        if data_array(data._address, field, 1).ctypes.data != getattr(data, field).ctypes.data:
            raise EngineError(
                f"engine: expected {field} at {data_offset(field)} bytes of mjData, received another layout;"
                f" MuJoCo {mujoco.__version__}"
            )
