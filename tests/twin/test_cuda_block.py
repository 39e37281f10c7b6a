"""Runs of a block in the kernel of a GPU: in numba's simulator, against the same runs of the processor."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import fill_defaults
from spheretwin.loop.block import RunBlock
from spheretwin.metrics import METRICS
from spheretwin.models.base import cuda
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.files import files_of
from tests.conftest import ROOT
from tests.twin.test_block import HARDWARE, random_changes

RUNS = 2
SIMULATED = pytest.mark.uncompiled
"""A process in which the simulator runs the kernel, and Python what it calls."""


def runs_of(hardware, duration, **more):
    generator = np.random.default_rng()
    for run in range(RUNS):
        changes = random_changes(generator, run + 1, **HARDWARE[hardware](generator), **more)
        yield scenarios.load(
            "sinusoid", {"hardware": hardware, "plant.engine": "lagrangian", "duration": duration, **changes}
        )


def endings(kind, every):
    files = files_of(every[0])
    return kind([fill_defaults(own, files, None, None) for own in every], files, METRICS).run()


def on_gpu(every):
    from spheretwin.loop.cuda_block import CudaBlock

    return endings(CudaBlock, every)


@SIMULATED
@pytest.mark.parametrize("hardware", HARDWARE)
def test_runs_are_those_of_the_processor(hardware):
    every = list(runs_of(hardware, 0.005))
    assert on_gpu(every) == endings(RunBlock, every)


@SIMULATED
def test_estimator_prediction_detection_and_bounded_allocation_are_in_the_kernel():
    more = {
        "estimator.kind": "differentiator",
        "allocation": "bounded",
        "detector.detect": True,
        "controller.prediction.on": True,
        "controller.governor.acceleration_rad_s2": 5.0,
        "controller.feed_forward.friction": 0.8,
    }
    every = list(runs_of("electronics", 0.004, **more))
    assert on_gpu(every) == endings(RunBlock, every)


@SIMULATED
def test_faults_act_at_their_own_times():
    every = [
        scenarios.load(
            "sinusoid",
            {
                "hardware": "electronics",
                "duration": 0.006,
                "plant.engine": "lagrangian",
                "seed": run,
                "fault": [{"target": "coil.3", "mode": "open", "start_s": start_s, "detection": True}],
            },
        )
        for run, start_s in enumerate((0.002, 0.004))
    ]
    endings_here = on_gpu(every)
    assert endings_here == endings(RunBlock, every)
    assert endings_here[0].figures != endings_here[1].figures


LAW = """
import numpy as np

def step(t, reference, measurement, parameters, state, torque):
    for axis in range(3):
        error = measurement[0, axis] - reference[0, axis]
        torque[axis] = -0.4 * error - 0.02 * (measurement[1, axis] - reference[1, axis])
    {raises}
"""


@SIMULATED
@pytest.mark.parametrize("raises", ["", "if t > 0.002: torque[:] = np.nan"])
def test_a_law_in_plain_python_runs_and_one_that_may_have_raised_is_left_to_its_session(tmp_path, raises):
    (tmp_path / "mine.py").write_text(LAW.format(raises=raises))
    changes = {"controller.law": f"{tmp_path / 'mine.py'}:step", "plant.engine": "lagrangian"}
    every = [scenarios.load("sinusoid", {**changes, "duration": 0.005, "seed": run}) for run in range(RUNS)]
    assert on_gpu(every) == ([None] * RUNS if raises else endings(RunBlock, every))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plant.engine": "mujoco"}, "expected plant.engine lagrangian, received mujoco"),
        ({"controller.check_bounds": True}, "expected controller.check_bounds = false, received true"),
    ],
)
@SIMULATED
def test_refuses_what_a_gpu_does_not_run(changes, message):
    with pytest.raises(InputError, match=message):
        on_gpu([scenarios.load("hold", {"plant.engine": "lagrangian", "duration": 0.002, **changes})])


def test_names_the_extra_that_is_missing(monkeypatch):
    monkeypatch.setattr(cuda, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="cuda: expected numba-cuda, which the extra gpu installs"):
        cuda.check_gpu.__wrapped__()


def test_blocks_of_inputs_have_one_type_for_the_compiler():
    same = np.broadcast_to(np.arange(3.0), (1, 4, 3))[:, :2]  # a reference that no run has of its own
    own = cuda.with_own_strides(same)
    assert own.strides == np.empty(same.shape).strides != same.strides
    np.testing.assert_array_equal(own, same)


COMPARISON = """
import json
from tests.twin.test_cuda_block import RunBlock, endings, on_gpu, runs_of

every = list(runs_of("{hardware}", 0.2))
print(json.dumps([on_gpu(every), endings(RunBlock, every)]))
"""


@pytest.mark.release("compiles the loop with its law, its channels and its metrics, 30 s each")
@pytest.mark.parametrize("hardware", HARDWARE)
def test_compiled_runs_are_those_of_the_processor(hardware):
    """Within the rounding of 200 ticks: what is compiled together fuses other products and sums."""
    environment = {**os.environ, "NUMBA_ENABLE_CUDASIM": "1"}
    program = [sys.executable, "-c", COMPARISON.format(hardware=hardware)]
    done = subprocess.run(program, env=environment, cwd=ROOT, capture_output=True, text=True)
    assert done.stderr == ""
    for own, theirs in zip(*json.loads(done.stdout), strict=True):
        assert own[:2] == theirs[:2]
        for name, figure in theirs[2].items():
            numbers = (np.array(value, float) for value in (own[2][name], figure))  # None: NaN
            np.testing.assert_allclose(*numbers, rtol=1e-9, atol=1e-12, err_msg=name)
