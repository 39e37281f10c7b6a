"""Discrete linear systems as laws: the sequences of linear theory, and what is no controller."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.models.base.errors import InputError
from spheretwin.session import Session
from spheretwin.simulation import simulate

PERIOD_S, TICKS = 1e-3, 60
generator = np.random.default_rng(5)


def uniform(*shape):
    return generator.uniform(-1, 1, shape)


def state_space(states, inputs, outputs):
    A, B = uniform(states, states) / max(states, 1), uniform(states, inputs)
    return signal.StateSpace(A, B, uniform(outputs, states), uniform(outputs, inputs), dt=PERIOD_S)


def gain(matrix, dt=PERIOD_S):
    outputs, inputs = np.shape(matrix)
    return signal.StateSpace(
        np.zeros((0, 0)), np.zeros((0, inputs)), np.zeros((outputs, 0)), np.array(matrix), dt=dt
    )


REFERENCE, MEASUREMENT = uniform(TICKS, 3, 3), uniform(TICKS, 3, 3)
ERRORS = REFERENCE - MEASUREMENT  # (ticks, row, axis)


def torques(law):
    """What a law asks for, call by call, from its state at the start."""
    parameters, state, asked = law.parameters.copy(), law.state.copy(), np.full((TICKS, 3), np.nan)
    for tick in range(TICKS):
        law.step(tick * PERIOD_S, REFERENCE[tick], MEASUREMENT[tick], parameters, state, asked[tick])
    return asked


def response(system, inputs):
    return signal.dlsim(system, inputs)[1]


# Sums of a dozen products of numbers below 1, in another order; polynomials are realised in other states.
ROUNDING = {"rtol": 0, "atol": 1e-12}


@pytest.mark.parametrize("states", [0, 1, 5])
@pytest.mark.parametrize("rows", [1, 2])
def test_a_system_of_all_axes_gives_its_own_response(states, rows):
    system = state_space(states, 3 * rows, 3) if states else gain(uniform(3, 3 * rows))
    expected = response(system, ERRORS[:, :rows].reshape(TICKS, -1))
    np.testing.assert_allclose(torques(Law.from_lti(system)), expected, **ROUNDING)


@pytest.mark.parametrize(
    "system",
    [
        signal.TransferFunction([2.0, -1.5, 0.1], [1.0, -0.7, 0.2], dt=PERIOD_S),
        signal.TransferFunction([1.0], [4.0, -0.7, 0.2], dt=PERIOD_S),
        signal.TransferFunction([3.0], [2.0], dt=PERIOD_S),
        signal.dlti([0.5, 0.1], [1.0, -0.9], dt=PERIOD_S),
        signal.ZerosPolesGain([0.3], [0.5, -0.2], 2.0, dt=PERIOD_S),
        signal.ZerosPolesGain([0.3 + 0.1j, 0.3 - 0.1j], [0.5 + 0.2j, 0.5 - 0.2j], 2.0, dt=PERIOD_S),
        state_space(3, 1, 1),
        state_space(2, 2, 1),  # the second input is the error of the rate
        gain([[7.0]]),
    ],
    ids=lambda system: type(system).__name__,
)
def test_a_system_of_one_output_runs_on_each_axis(system):
    inputs = np.shape(system.D)[1] if isinstance(system, signal.StateSpace) else 1
    expected = [response(system, ERRORS[:, :inputs, axis])[:, 0] for axis in range(3)]
    np.testing.assert_allclose(torques(Law.from_lti(system)), np.transpose(expected), **ROUNDING)


def test_outputs_may_be_accelerations_and_a_torque_may_be_added():
    system, inertia, constant = state_space(2, 3, 3), [2.0, 3.0, 4.0], [0.1, -0.2, 0.3]
    plain = torques(Law.from_lti(system))
    made = torques(Law.from_lti(system, inertia_kg_m2=inertia, constant_torque_Nm=constant))
    np.testing.assert_allclose(made, plain * inertia + constant, **ROUNDING)
    alike = torques(Law.from_lti(system, inertia_kg_m2=2.0, constant_torque_Nm=0.1))
    np.testing.assert_allclose(alike, plain * 2.0 + 0.1, **ROUNDING)


def test_lists_of_polynomials_stand_side_by_side():
    """As a transfer function of several inputs and outputs has them."""
    numerators = [
        [uniform(2), [0.0], [1.0]],
        [[0.0, 2.0], uniform(3), [0.0, 0.0]],
        [[1.5], uniform(1), uniform(2)],
    ]
    denominators = [[[1.0, 0.4], [1.0], [2.0]], [[1.0, -0.3], [3.0, 0.1, 0.2], [1.0, 0.5]], [[1, 0, 0.2]] * 3]
    system = SimpleNamespace(num=numerators, den=denominators, dt=PERIOD_S)
    expected = np.zeros((TICKS, 3))
    for i in range(3):
        for j in range(3):
            # Falling powers of z: late by as much as the numerator is shorter.
            late = len(np.trim_zeros(denominators[i][j], "f")) - len(numerators[i][j])
            numerator = np.concatenate([np.zeros(max(0, late)), numerators[i][j]])
            expected[:, i] += signal.lfilter(numerator, denominators[i][j], ERRORS[:, 0, j])
    np.testing.assert_allclose(torques(Law.from_lti(system)), expected, **ROUNDING)


HOLD = {"plant.engine": "lagrangian", "duration": 0.5}


def test_a_positive_gain_is_the_shipped_pd_law():
    law = Law.from_lti(gain([[2.0, 0.05]]))
    fields = {"controller.law": "pd", "controller.level": "torque"}
    gains = {"controller.stiffness": 2.0, "controller.damping": 0.05}
    own, shipped = (
        simulate(scenarios.load("hold", HOLD), law=law),
        simulate(scenarios.load("hold", HOLD | fields | gains)),
    )
    # Products are added in another order; a stable loop does not let that grow.
    np.testing.assert_allclose(own.telemetry["q_rad"], shipped.telemetry["q_rad"], rtol=0, atol=1e-12)


LEAD = signal.TransferFunction([20.0, -19.0], [1.0, -0.6], dt=PERIOD_S)


def test_it_runs_from_a_file_and_keeps_its_period(tmp_path):
    text = f"""
from scipy import signal
from spheretwin.control.law import Law

lead = Law.from_lti(signal.TransferFunction([20.0, -19.0], [1.0, -0.6], dt={PERIOD_S}), name="lead")
"""
    (path := tmp_path / "mine.py").write_text(text)
    fields = HOLD | {"controller.law": f"{path}:lead"}
    own = simulate(scenarios.load("hold", fields))
    np.testing.assert_array_equal(
        own.telemetry["q_rad"],
        simulate(scenarios.load("hold", HOLD), law=Law.from_lti(LEAD)).telemetry["q_rad"],
    )
    shorter = fields | {"controller.parameters": [0.0] * 5}
    assert simulate(scenarios.load("hold", shorter)).status == "diverged"


def test_another_period_is_refused_and_changes_nothing():
    late = Law.from_lti(gain([[2.0, 0.05]], dt=5e-4))
    message = r"law lti: expected a control period of 0\.0005 s, received 0\.001 s"
    with pytest.raises(InputError, match=message):
        simulate(scenarios.load("hold", HOLD), law=late)
    with Session(scenarios.load("hold", HOLD), Law.from_lti(LEAD)) as session:
        with pytest.raises(InputError, match=message):
            session.set("controller.law", late)
        assert session.law.period_s == PERIOD_S
        assert len(session.advance(5).values) == 5
    clocks = {"controller.period_s": 5e-4 * (1 + 1e-15), "plant.step_s": 5e-4}
    assert simulate(scenarios.load("hold", HOLD | clocks), law=late).status == "completed"


@pytest.mark.parametrize("size", [0, 1, 2, 20, 1000])
def test_parameters_of_another_length_give_no_torque(size):
    """As a scenario may set them; compiled code reads nothing beside them."""
    law = Law.from_lti(LEAD)
    torque = np.full(3, np.nan)
    law.step(0.0, REFERENCE[0], MEASUREMENT[0], np.zeros(size), law.state.copy(), torque)
    assert np.all(np.isnan(torque))
