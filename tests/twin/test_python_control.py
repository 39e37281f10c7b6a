"""Systems of python-control as laws and as linear models, in a process in the root of the repository.

Its name is that of a folder there, which Python finds first unless it leaves out the working folder (``-P``).
"""

import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from spheretwin import scenario
from spheretwin.linear import linearise
from spheretwin.models.base.errors import InputError

ROOT = Path(__file__).parents[2]

SCRIPT = """
import control
import numpy as np

from spheretwin.control.law import Law
from spheretwin.models.base.errors import InputError
from spheretwin import scenario
from spheretwin.linear import linearise
from spheretwin.simulation import simulate

np.random.seed(3)  # of the systems of control.rss, which may have any gain and memory
generator = np.random.default_rng(3)
errors = generator.uniform(-1, 1, (40, 2, 3))  # tick, row, axis


def torques(law):
    parameters, state, asked = law.parameters.copy(), law.state.copy(), np.empty((40, 3))
    for tick, rows in enumerate(errors):
        reference = np.vstack([rows, np.zeros(3)])
        law.step(0.0, reference, np.zeros((3, 3)), parameters, state, asked[tick])
    return asked


def same(system, inputs):
    found = control.forced_response(system, inputs=inputs.T, squeeze=False).outputs.T
    return found.reshape(40, -1)


def check(system, inputs):
    expected = np.hstack([same(system, each) for each in inputs])
    # Rounding is relative to the largest torque of a run: the memory of a system keeps what it once rounded.
    size = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(torques(Law.from_lti(system)), expected, rtol=0, atol=1e-12 * size)


each_axis = [errors[:, 0, axis : axis + 1] for axis in range(3)]
check(control.tf([2.0, -1.5], [1.0, -0.7, 0.2], 1e-3), each_axis)
check(control.sample_system(control.tf([0.05, 2.0], [0.002, 1.0]), 1e-3, "bilinear"), each_axis)
check(control.zpk([0.3], [0.5, -0.2], 2.0, dt=1e-3), each_axis)
check(control.rss(2, 1, 1, dt=1e-3), each_axis)
check(control.ss([], [], [], generator.uniform(-1, 1, (3, 6)), 1e-3), [errors.reshape(40, 6)])
several = control.rss(4, 3, 3, dt=1e-3)
check(several, [errors[:, 0]])
part = control.tf([1.0, 0.2], [1.0, -0.5], 1e-3)
none = control.tf([0.0], [1.0], 1e-3)
late = control.tf([1.0], [1.0, -0.1, 0.2], 1e-3)
polynomials = control.combine_tf([[part, none, late], [none, part, none], [late, none, part]])
by_entry = np.column_stack(
    [sum(same(polynomials[i, j], errors[:, 0, j : j + 1])[:, 0] for j in range(3)) for i in range(3)]
)
np.testing.assert_allclose(torques(Law.from_lti(polynomials)), by_entry, rtol=0, atol=1e-12)

for system, part in [
    (control.tf([1.0], [1.0, 1.0]), "received one with dt 0"),
    (control.tf([1.0], [1.0, 0.1], True), "received one with dt true"),
    (control.ss([], [], [], np.eye(3)), "received one with dt none"),
    (control.tf([1.0, 0.0, 0.0], [1.0, 0.1], 1e-3), "a proper transfer function"),
    (control.frd([1.0], [1.0], dt=1e-3), "a state space, or a proper transfer function"),
]:
    try:
        Law.from_lti(system)
    except InputError as error:
        assert part in str(error), error
    else:
        raise AssertionError(part)

told = {"disturbance.load": 0.0, "plant.engine": "lagrangian", "plant.payload_kg": 0.05}
still = scenario.load("hold", told)
model = linearise(still, [0.0, 0.0, 0.0], kind="control")
plain = linearise(still, [0.0, 0.0, 0.0])
for name in "ABCD":
    np.testing.assert_array_equal(getattr(model.system, name), getattr(plain.system, name))
assert model.system.isctime(strict=True)
assert tuple(model.system.state_labels) == model.states
assert tuple(model.system.input_labels) == model.inputs
assert tuple(model.system.output_labels) == model.outputs

plant = control.sample_system(model.system, 1e-3)
gain, _, poles = control.dlqr(plant, np.diag([1e4] * 3 + [1.0] * 3), 10 * np.eye(3))
assert np.all(np.abs(poles) < 1)
law = Law.from_lti(control.ss([], [], [], gain, 1e-3), constant_torque_Nm=model.input_at_rest)
run = simulate(still, law=law)
assert run.status == "completed"
# Upright, gravity pulls away in proportion to the angle: a proportional gain goes past, by 0.17 %.
np.testing.assert_allclose(run.telemetry["q_rad"][-1], [0.2, -0.1, 0.3], rtol=0.01)
"""


@pytest.mark.release("2 s; changes with python-control")
def test_its_systems_are_laws_and_its_designs_run():
    done = subprocess.run([sys.executable, "-P", "-c", SCRIPT], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("result", [None, ModuleType("control")], ids=["nothing", "a folder of its name"])
def test_where_it_is_not_to_be_had_it_is_told_in_one_line(result, monkeypatch):
    monkeypatch.setitem(sys.modules, "control", result)
    with pytest.raises(
        InputError, match="expected python-control for kind control, which the extra control installs"
    ):
        linearise(scenario.load("hold"), kind="control")
