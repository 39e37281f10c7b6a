"""Private APIs of numba and MuJoCo exist and do what this package needs; a failure names the API."""

import ctypes
import subprocess
import sys

import mujoco
import numba
import numpy as np
import pytest

from spheretwin.models.base import cache, mujoco_library
from spheretwin.models.base.compiled import allocation_free, compiled, inlined
from spheretwin.models.base.errors import EngineError
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


@needs_compiled_functions
def test_a_compiled_function_reads_the_cache_of_this_package(monkeypatch):
    @compiled
    def double(x):
        return 2 * x

    signatures = []
    monkeypatch.setattr(double._cache, "load_overload", lambda sig, context: signatures.append(sig))
    assert double(1.5) == 3.0
    assert len(signatures) == 1, f"numba {numba.__version__} does not ask Dispatcher._cache for machine code"


def has_machine_code(result):
    return result.library._codegen._engine.is_symbol_defined(result.fndesc.llvm_func_name)


@needs_compiled_functions
def test_a_function_has_machine_code_only_for_calls_from_python(monkeypatch):
    monkeypatch.setattr(cache, "cache_folder", lambda: None)  # every function is compiled

    @allocation_free
    def half(x):
        return 0.5 * x

    @allocation_free
    def of_both(x, y):
        return half(x) - half(y)

    assert of_both(3.0, 1.0) == 1.0
    assert not half.overloads
    (part,) = half.part.overloads.values()
    assert not has_machine_code(part), f"numba {numba.__version__} makes machine code in spite of no_compile"
    assert has_machine_code(*of_both.overloads.values())
    assert half(3.0) == 1.5
    assert half(np.float32(2.0)) == 1.0
    assert len(half.overloads) == 2
    assert of_both(5.0, 1.0) == 2.0
    assert len(half.part.overloads) == 1


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
        function.py_func.__name__: [part.fndesc.inline for part in function.part.overloads.values()]
        for function in (half, quarter)
    }
    assert is_inlined == {"half": [False], "quarter": [True]}


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


NAMES = """
import numpy as np
from numba import from_dtype
from numba.core.itanium_mangler import mangle
from spheretwin.models.base import numba_internals

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
