"""Private APIs of numba and MuJoCo exist and do what this package needs; a failure names the API."""

import ctypes

import mujoco
import numba
import numpy as np
import pytest
from numba.core import ccallback, compiler, dispatcher
from numba.core.runtime import rtsys

from spheretwin.models.base import mujoco_library
from spheretwin.models.base.compiled import COMPILES, allocation_free, compiled

NUMBA = [
    (compiler.CompileResult, "_rebuild"),
    (compiler.CompileResult, "_reduce"),
    (rtsys, "initialize"),
    (ccallback.CFunc, "compile"),
    (dispatcher.Dispatcher, "enable_caching"),
]
MODEL = "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"


@pytest.mark.parametrize(("owner", "name"), NUMBA)
def test_numba_has_the_private_names(owner, name):
    assert hasattr(owner, name), f"numba {numba.__version__} has no {owner}.{name}: see numba_internals.py"


# With NUMBA_DISABLE_JIT functions stay plain Python: numba's internals are not used then.
needs_compiler = pytest.mark.skipif(not COMPILES, reason="NUMBA_DISABLE_JIT: no function is compiled")


@needs_compiler
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


@needs_compiler
def test_a_compiled_function_reads_the_cache_of_this_package(monkeypatch):
    @compiled
    def double(x):
        return 2 * x

    signatures = []
    monkeypatch.setattr(double._cache, "load_overload", lambda sig, context: signatures.append(sig))
    assert double(1.5) == 3.0
    assert len(signatures) == 1, f"numba {numba.__version__} does not ask Dispatcher._cache for machine code"


def test_the_addresses_of_mujoco_are_those_that_mj_step_takes():
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    step = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(mujoco_library.step_address())
    step(*mujoco_library.addresses(model, data))
    assert data.time == model.opt.timestep


@pytest.mark.parametrize("name", ["mjcb_time", "mju_user_warning"])
def test_mujoco_exports_the_pointers(name):
    assert hasattr(mujoco_library.library(), name), f"MuJoCo {mujoco.__version__} does not export {name}"


def test_timers_stop_and_run_again():
    clock = ctypes.c_void_p.in_dll(mujoco_library.library(), "mjcb_time")
    before = clock.value
    with mujoco_library.timers_stopped():
        assert clock.value is None
    assert clock.value == before
