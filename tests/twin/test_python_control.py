"""Systems of python-control as laws and as linear models."""

import sys
from types import ModuleType

import numpy as np
import pytest

import control
from spheretwin import scenario
from spheretwin.control.law import Law
from spheretwin.linear import linearise
from spheretwin.models.base.errors import InputError
from spheretwin.simulation import simulate

generator = np.random.default_rng(3)
ERRORS = generator.uniform(-1, 1, (40, 2, 3))  # tick, row, axis
AXES = [ERRORS[:, 0, axis : axis + 1] for axis in range(3)]
PART, LATE = control.tf([1.0, 0.2], [1.0, -0.5], 1e-3), control.tf([1.0], [1.0, -0.1, 0.2], 1e-3)
NONE = control.tf([0.0], [1.0], 1e-3)
POLYNOMIALS = [[PART, NONE, LATE], [NONE, PART, NONE], [LATE, NONE, PART]]


def stable_system(states, inputs):
    """A stable system of as many outputs as inputs."""
    A = np.diag(generator.uniform(-0.9, 0.9, states))
    B, C = generator.uniform(-1, 1, (states, inputs)), generator.uniform(-1, 1, (inputs, states))
    return control.ss(A, B, C, generator.uniform(-1, 1, (inputs, inputs)), 1e-3)


def response(system, inputs):
    outputs = control.forced_response(system, inputs=inputs.T, squeeze=False).outputs
    return outputs.T.reshape(len(ERRORS), -1)


def torques(law):
    parameters, state, torque = law.parameters.copy(), law.state.copy(), np.empty((len(ERRORS), 3))
    for tick, rows in enumerate(ERRORS):
        reference = np.vstack([rows, np.zeros(3)])
        law.step(0.0, reference, np.zeros((3, 3)), parameters, state, torque[tick])
    return torque


@pytest.mark.parametrize(
    ("system", "inputs"),
    [
        (control.tf([2.0, -1.5], [1.0, -0.7, 0.2], 1e-3), AXES),
        (control.sample_system(control.tf([0.05, 2.0], [0.002, 1.0]), 1e-3, "bilinear"), AXES),
        (control.zpk([0.3], [0.5, -0.2], 2.0, dt=1e-3), AXES),
        (stable_system(2, 1), AXES),
        (control.ss([], [], [], generator.uniform(-1, 1, (3, 6)), 1e-3), [ERRORS.reshape(40, 6)]),
        (stable_system(4, 3), [ERRORS[:, 0]]),
    ],
    ids=["polynomials", "sampled", "poles", "each axis", "gains", "all axes"],
)
def test_a_law_of_a_system_has_its_response(system, inputs):
    expected = np.hstack([response(system, each) for each in inputs])
    # Sums of a dozen products of numbers below 4.
    np.testing.assert_allclose(torques(Law.from_lti(system)), expected, rtol=0, atol=1e-12)


def test_a_matrix_of_polynomials_has_the_sum_of_their_responses():
    law = Law.from_lti(control.combine_tf(POLYNOMIALS))
    expected = [
        sum(response(system, inputs)[:, 0] for system, inputs in zip(row, AXES, strict=True))
        for row in POLYNOMIALS
    ]
    np.testing.assert_allclose(torques(law), np.transpose(expected), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("system", "part"),
    [
        (control.ss([], [], [], np.eye(3)), "received one with dt none"),
        (control.tf([1.0, 0.0, 0.0], [1.0, 0.1], 1e-3), "a proper transfer function"),
        (control.frd([1.0], [1.0], dt=1e-3), "a state space, or a proper transfer function"),
    ],
)
def test_a_system_that_is_no_law_is_refused(system, part):
    with pytest.raises(InputError, match=part):
        Law.from_lti(system)


@pytest.mark.release("0.7 s; changes with python-control")
def test_a_regulator_designed_on_the_linear_model_reaches_the_pose():
    still = {"disturbance.load": 0.0, "plant.engine": "lagrangian", "plant.payload_kg": 0.05}
    hold = scenario.load("hold", still)
    model, plain = linearise(hold, [0.0] * 3, kind="control"), linearise(hold, [0.0] * 3)
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(model.system, name), getattr(plain.system, name))
    assert model.system.isctime(strict=True)
    assert tuple(model.system.state_labels) == model.states
    assert tuple(model.system.input_labels) == model.inputs
    assert tuple(model.system.output_labels) == model.outputs
    weights = np.diag([1e4] * 3 + [1.0] * 3)
    gain, _, poles = control.dlqr(control.sample_system(model.system, 1e-3), weights, 10 * np.eye(3))
    assert np.all(np.abs(poles) < 1)
    law = Law.from_lti(control.ss([], [], [], gain, 1e-3), constant_torque_Nm=model.input_at_rest)
    run = simulate(hold, law=law)
    assert run.status == "completed"
    # Upright, gravity pulls away in proportion to the angle: a proportional gain goes past, by 0.17 %.
    np.testing.assert_allclose(run.telemetry["q_rad"][-1], [0.2, -0.1, 0.3], rtol=0.01)


@pytest.mark.parametrize("result", [None, ModuleType("control")], ids=["nothing", "a folder of its name"])
def test_where_it_is_not_to_be_had_it_is_told_in_one_line(result, monkeypatch):
    monkeypatch.setitem(sys.modules, "control", result)
    message = "expected python-control for kind control, which the extra control installs"
    with pytest.raises(InputError, match=message):
        linearise(scenario.load("hold"), kind="control")
