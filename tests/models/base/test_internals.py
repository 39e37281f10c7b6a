"""Private APIs of numba and MuJoCo exist and do what this package needs; a failure names the API."""

import contextlib
import ctypes
import importlib
import pkgutil
import subprocess
import sys
from collections import Counter
from typing import NamedTuple

import mujoco
import numba
import numpy as np
import pytest
from numba import types
from numba.core import event

import spheretwin
from spheretwin.models.base import cache, mujoco_library
from spheretwin.models.base.compiled import allocation_free, compilable, compiled, inlined
from spheretwin.models.base.errors import EngineError
from spheretwin.models.base.numba_internals import addresses, functions, machine_code
from spheretwin.models.base.numba_internals.functions import NO_ALLOCATION
from tests.requirements import needs_compiled_functions

MODEL = "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"


@needs_compiled_functions
def test_the_option_nrt_switches_allocation_off():
    @compiled
    def allocate():
        return np.zeros(3)

    @allocation_free
    def allocate_without():
        return np.zeros(3)

    assert allocate().shape == (3,)
    with pytest.raises(numba.TypingError):
        allocate_without()


class Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray


def sum_of_larger(pair, other, count):
    """Use tuples that are assigned once, in a branch, in a loop, or again after their first use."""
    total, chosen, inner = 0.0, pair, (pair, other)
    for i in range(count):
        if pair.first[i] < other.first[i]:
            chosen = other
        elif i % 3 == 0:
            chosen = inner[0]
        outer = (chosen, other)
        for _ in range(2):
            total += outer[0].second[i] - 0.25 * outer[1].first[i]
            if total > 3.0:
                total -= inner[1].second[i]
    return total


@needs_compiled_functions
def test_a_tuple_that_is_assigned_once_is_a_value(monkeypatch):
    values = set()

    def record(lower):
        find(lower)
        values.update(lower._singly_assigned_vars)

    find = functions._TupleLower._find_singly_assigned_variable
    monkeypatch.setattr(functions._TupleLower, "_find_singly_assigned_variable", record)
    random = np.random.default_rng(5)
    pairs = Pair(*random.random((2, 40))), Pair(*random.random((2, 40)))
    function = numba.njit(sum_of_larger, _nrt=False, pipeline_class=functions.TupleCompiler)
    # The same operations in the same order.
    assert function(*pairs, 40) == sum_of_larger(*pairs, 40)
    assert {"pair", "other", "inner"} <= values, (
        f"numba {numba.__version__} asks other functions than _TupleLower in models/base/numba_internals"
    )


@needs_compiled_functions
def test_a_compiled_function_reads_the_cache_of_this_package(monkeypatch):
    @compiled
    def double(x):
        return 2 * x

    signatures = []
    monkeypatch.setattr(double._cache, "load_overload", lambda sig, context: signatures.append(sig))
    assert double(1.5) == 3.0
    assert len(signatures) == 1, f"numba {numba.__version__} does not ask Dispatcher._cache for machine code"


@needs_compiled_functions
def test_a_function_for_compiled_callers_is_compiled_again_for_python(monkeypatch):
    monkeypatch.setattr(cache, "cache_folder", lambda: None)  # every function is compiled

    @allocation_free
    def half(x):
        return 0.5 * x

    @allocation_free
    def of_both(x, y):
        return half(x) - half(y)

    assert of_both(3.0, 1.0) == 1.0
    (part,) = half.overloads.values()
    assert not functions._is_callable(part), (
        f"numba {numba.__version__} compiles the conversion of arguments in spite of no_cpython_wrapper"
    )
    assert half(3.0) == 1.5
    (complete,) = half.overloads.values()
    assert functions._is_callable(complete)
    assert half(np.float32(2.0)) == 1.0  # other types are compiled for Python at once
    assert of_both(5.0, 1.0) == 2.0


@needs_compiled_functions
def test_a_function_does_not_take_the_inlining_of_its_first_caller(monkeypatch):
    monkeypatch.setattr(cache, "cache_folder", lambda: None)  # every function is compiled

    @allocation_free
    def half(x):
        return 0.5 * x

    @inlined
    def quarter(x):
        return half(half(x))

    @allocation_free
    def eighth(x):
        return quarter(half(x))

    assert eighth(16.0) == 2.0
    is_inlined = {
        function.py_func.__name__: [part.fndesc.inline for part in function.overloads.values()]
        for function in (half, quarter, eighth)
    }
    assert is_inlined == {"half": [False], "quarter": [True], "eighth": [False]}


@needs_compiled_functions
def test_a_stored_function_for_compiled_callers_is_not_taken_for_python(monkeypatch, tmp_path):
    monkeypatch.setattr(cache, "cache_folder", lambda: tmp_path)

    def build(factor):
        @allocation_free
        def third(x):
            return x / 3.0

        @allocation_free
        def of_sum(x, y):  # each factor is another caller, which is compiled
            return factor * third(x + y)

        return third, of_sum

    for factor, hits in ((1.0, 0), (2.0, 1)):  # callers include it: only that for Python is stored
        third, of_sum = build(factor)
        assert of_sum(2.0, 4.0) == 2.0 * factor
        assert third(3.0) == 1.0
        assert sum(third.stats.cache_hits.values()) == hits


def test_the_addresses_of_mujoco_are_those_that_mj_step_takes():
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    step = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(mujoco_library.step_address())
    step(*mujoco_library.addresses(model, data))
    assert data.time == model.opt.timestep


def test_timers_stop_and_run_again():
    clock = ctypes.c_void_p.in_dll(mujoco_library.library(), "mjcb_time")
    before = clock.value
    with mujoco_library.timers_stopped():
        assert clock.value is None
    assert clock.value == before


@pytest.mark.parametrize(
    ("field", "kind"),
    [("qpos", np.float64), ("ctrl", np.float64), ("xpos", np.float64), ("plugin", np.int32)],
)
def test_mjdata_has_the_layout_that_its_package_declares(field, kind):
    model = mujoco.MjModel.from_xml_string(MODEL.replace("</worldbody>", "</worldbody><actuator/>"))
    data = mujoco.MjData(model)
    array = getattr(data, field)
    view = mujoco_library.data_array(data._address, field, array.size, kind)
    assert array.size == 0 or view.ctypes.data == array.ctypes.data, (
        f"MuJoCo {mujoco.__version__} has {field} elsewhere in mjData: see mujoco_library.py"
    )


def test_another_layout_of_mjdata_is_refused_before_a_plugin_is_registered(monkeypatch):
    offset = mujoco_library.data_offset
    wrong = {"qpos": "qvel"}
    monkeypatch.setattr(mujoco_library, "data_offset", lambda field: offset(wrong.get(field, field)))
    with pytest.raises(EngineError, match="expected qpos at"):
        mujoco_library.register_plugin("never", (), 0, 0, {})


def test_a_copied_model_is_owned_by_python():
    model = mujoco.MjModel.from_xml_string(MODEL)
    copy = mujoco_library.copy_of_model(model._address)
    assert copy._address != model._address
    assert copy.nbody == model.nbody


@needs_compiled_functions
def test_compiled_code_reads_a_tuple_from_memory():
    """Numbers of each kind, next to nested tuples of numbers that need no alignment."""
    pair = Pair(np.arange(3.0), np.arange(4.0))
    value = True, (False, np.True_), pair, 7.5, None, ((True, np.int64(3)), ()), np.ones((2, 5), np.bool_)

    @numba.cfunc(types.float64(types.CPointer(numba.typeof(value))), **NO_ALLOCATION)
    def read(memory):
        content = memory[0]
        numbers = content[2].first[2] + 10 * content[2].second[3] + 100 * content[3] + 1000 * content[5][0][1]
        logical = (
            content[0] + 2 * content[1][0] + 4 * content[1][1] + 8 * content[5][0][0] + 16 * content[6][1, 4]
        )
        return numbers + 1e5 * logical + 1e7 * content[6].shape[1]

    memory = addresses.in_memory(value)
    assert read.ctypes(ctypes.c_void_p(memory.ctypes.data)) == 2 + 30 + 750 + 3000 + 29e5 + 5e7
    with pytest.raises(TypeError, match="numbers of eight bytes"):
        addresses.in_memory((np.float32(1.0),))


@needs_compiled_functions
def test_an_inlined_implementation_has_no_machine_code(monkeypatch):
    """Numba reports each function that it compiles: here only the caller."""
    monkeypatch.setattr(cache, "load_entry", lambda name: None)
    compiled_functions = []

    class Listener(event.Listener):
        def on_start(self, started):
            compiled_functions.append(started.data["dispatcher"].py_func.__name__)

        def on_end(self, ended):
            pass

    @compilable
    def doubled(x):
        return 2.0 * x

    @allocation_free
    def caller(x):
        return doubled(x) + 1.0

    with event.install_listener("numba:compile", Listener()):
        assert caller(3.0) == 7.0
    assert compiled_functions == ["caller"]


class Other(NamedTuple):
    first: np.ndarray
    second: np.ndarray


def test_values_with_one_fingerprint_have_one_type():
    one, two = np.zeros(3), np.zeros((3, 3))
    locked = np.zeros(3)
    locked.flags.writeable = False
    unaligned = np.zeros(25, dtype=np.uint8)[1:].view(np.float64)
    scalars = (1, 1.0, True, None, np.int64(1), (), (1,), (1, 1), (1.0,))
    values = [
        *(Pair(array, one) for array in (one, two, two.T, two[:, 0], locked, unaligned)),
        *(Pair(one.astype(kind), one) for kind in (np.int64, np.float32, np.bool_, np.uint64)),
        *(Pair(each, one) for each in scalars),
        *(Other(one, one), (one, one), (Pair(one, one),), (Pair(one, one), Pair(one, one))),
    ]
    by_key = {}
    for value in values:
        by_key.setdefault(fingerprint(value), set()).add(numba.typeof(value))
    assert all(len(kinds) == 1 for kinds in by_key.values())
    assert fingerprint(Pair(np.ones(5), np.ones(7))) == fingerprint(values[0])


def fingerprint(*values):
    return machine_code.fingerprint_of_types(values)


def test_no_two_named_tuples_of_the_package_have_one_fingerprint():
    modules = [name for name in sys.modules if name.startswith("spheretwin.")]
    for found in pkgutil.walk_packages(spheretwin.__path__, "spheretwin."):
        if found.name not in modules and not found.name.endswith("__main__"):
            with contextlib.suppress(ImportError):  # of a library that is not installed
                importlib.import_module(found.name)
    classes = {
        each
        for name, module in list(sys.modules.items())
        if name.startswith("spheretwin.")
        for each in vars(module).values()
        if isinstance(each, type) and issubclass(each, tuple) and hasattr(each, "_fields")
    }
    assert len(classes) > 200
    names = Counter((each.__name__, each._fields) for each in classes)
    assert [name for name, count in names.items() if count > 1] == []


NAMES = """
import numpy as np
from numba import from_dtype
from numba.core.itanium_mangler import mangle
from spheretwin.models.base.numba_internals import machine_code

for count in range({others}):  # types that a process counts before
    from_dtype(np.dtype([("x", "f8", (9 + count,))]))
for length in (1, 2):
    print(mangle("f", [from_dtype(np.dtype([("x", "f8", (length,))]))]))
"""


def test_names_of_records_in_machine_code_are_those_of_any_process():
    one, other = (
        subprocess.run(
            [sys.executable, "-c", NAMES.format(others=others)], capture_output=True, check=True, text=True
        ).stdout.split()
        for others in (0, 3)
    )
    assert one == other
    assert one[0] != one[1]
