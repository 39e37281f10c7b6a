"""The prediction over the delay against a slow integration of the nominal model, and against the plant."""

from itertools import pairwise

import numba
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from spheretwin.control.applied_torque import (
    AppliedTorque,
    delay_capacity,
    estimate_applied_torque,
    fill_applied_torque,
)
from spheretwin.control.compensators.prediction import (
    DelayModel,
    Prediction,
    PredictionSection,
    fill_prediction,
    predict,
)
from spheretwin.control.law import Law
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.lagrangian import acceleration
from spheretwin.models.magnetics import torque_matrix, torque_model
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.session import Session
from spheretwin.simulation import simulate
from tests.control.compensators import cases

LAG_S = 7e-4
Q, V = np.array([0.3, -0.2, 0.5]), np.array([1.0, -2.0, 4.0])


def commands_at(t):
    """Smooth group currents (A), so that a shorter period only samples them more finely."""
    return 0.8 * np.sin(40.0 * t + np.arange(18.0))


class Way:
    """What happened up to t = 0 under a delay of `delay` periods: belief, prediction, exact currents."""

    def __init__(self, actuator, period_s, delay, inertia=None):
        self.period_s, self.delay = period_s, delay
        self.inertia = actuator.inertia if inertia is None else inertia
        self.model = torque_model(actuator)
        self.magnetics = self.model.arrangement[0], self.model.tables
        self.ticks = round(delay) + 20
        self.commands = [commands_at(-period_s * (self.ticks - k)) for k in range(self.ticks)]
        delayed = DelayModel(period_s, delay * period_s, LAG_S, self.inertia)
        self.mine = Prediction.filled(
            fill_prediction,
            PredictionSection(on=True),
            delayed,
            groups=18,
            lines=self.model.sizes["lines"],
        )[0]
        delay_s = delay * period_s
        self.applied_torque = AppliedTorque.filled(
            fill_applied_torque, True, period_s, delay_s, LAG_S,
            groups=18, delays=delay_capacity(delay_s, period_s),
        )[0]  # fmt: skip
        self.measurement = np.zeros((6, 3))
        G = torque_matrix(Q, actuator)
        for k in range(self.ticks):
            self.predict()
            estimate_applied_torque(self.applied_torque, Q, G, self.commands[k])
        self.predict()

    def predict(self):
        self.measurement[:3] = Q, V, self.applied_torque.torque_q
        assert predict(self.mine, self.applied_torque, *self.magnetics, self.measurement)

    def current(self, t):
        """Exact response to the delayed commands, switch by switch; at rest before the first."""
        starts_s = (np.arange(self.ticks) - self.ticks + self.delay) * self.period_s
        return cases.response(self.commands, starts_s, LAG_S, t)


@pytest.mark.release("1.4 s; the motion with the true model is compared in less")
@pytest.mark.parametrize("delay_s", [4e-3, 5.2e-3])
def test_it_is_the_motion_of_the_nominal_model_to_second_order(delay_s, actuator):
    def moving(t, state):
        q, v = state[:3], state[3:]
        torque = rate_jacobian(q).T @ torque_matrix(q, actuator) @ way.current(t)
        return np.concatenate([v, acceleration(q, v, torque, actuator.inertia, 0.0)])

    errors = []
    for period_s in (2e-3, 1e-3, 5e-4):
        way = Way(actuator, period_s, delay_s / period_s)
        state, at = np.concatenate([Q, V]), 0.0
        # Smooth between the switches alone.
        switches = np.arange(way.delay % 1, way.delay + 0.5) * period_s
        for until in switches[switches > 0]:
            state = solve_ivp(moving, (at, until), state, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
            at = until
        assert at == pytest.approx(delay_s)
        result = way.measurement[:2]
        moved = [np.abs(state[:3] - Q).max(), np.abs(state[3:] - V).max()]
        errors.append(np.abs(result - state.reshape(2, 3)).max(axis=1) / moved)
    assert (errors[1] < 1e-2).all()
    assert (np.log2(errors[0] / errors[2]) > 2 * 1.8).all()


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 2.0, 2.75])
def test_the_torque_is_that_of_the_period_before_the_instant_predicted(delay, actuator):
    """Of a rotor too heavy to turn, so that the mean current alone counts; by quadrature."""
    period_s = 1e-3
    way = Way(actuator, period_s, delay, inertia=np.full(3, 1e12))
    E_G = rate_jacobian(Q).T @ torque_matrix(Q, actuator)
    end, switch = delay * period_s, round(delay % 1, 9) * period_s
    inside = [
        s for s in (np.floor(delay) * period_s + switch - period_s * np.arange(3)) if 0 <= end - s < period_s
    ]
    parts = sorted({end - period_s, *inside, end})
    torque = np.zeros(3)
    for first, last in pairwise(parts):
        for i in range(3):
            torque[i] += quad(lambda t, row=E_G[i]: row @ way.current(t), first + 1e-13, last - 1e-13)[0]
    # The pose turns by the rates over the delay all the same, and the matrix with it: G' v δ is what differs.
    tolerance = np.abs(E_G).max() * 18 * 8 * np.abs(V).max() * end + 1e-9
    np.testing.assert_allclose(way.measurement[2], torque / period_s, rtol=0, atol=tolerance)
    np.testing.assert_array_equal(way.measurement[3:5], [Q, V])
    np.testing.assert_array_equal(way.measurement[5], way.applied_torque.torque_q)


HANDED = tuple(
    Signal(name, "1", 3, name, ANGLES)
    for name in ("q_handed", "v_handed", "torque_handed", "q_kept", "v_kept", "torque_kept", "at", "rate_at")
)


@numba.njit
def telling(t, reference, measurement, parameters, state, torque):
    for i in range(3):
        for row in range(6):
            state[3 * row + i] = measurement[row, i]
        state[18 + i], state[21 + i] = reference[0, i], reference[1, i]
        error, error_rate = measurement[0, i] - reference[0, i], measurement[1, i] - reference[1, i]
        torque[i] = -parameters[0] * error - parameters[1] * error_rate


TELLING = Law("telling", telling, [2.0, 0.1], np.zeros(24), HANDED, asks_torque=True)


def still_air(**changes):
    """A run whose nominal model is true."""
    fields = {"duration": 0.5, "controller__prediction__on": True, "plant__step_s": 1e-4}
    return cases.true_model("sinusoid", **fields | changes)


@pytest.mark.parametrize("periods", [1, 3])
def test_with_the_true_model_it_is_the_future_motion_of_the_rotor(periods):
    table = simulate(still_air(drive__delay_s=periods * 1e-3), law=TELLING).telemetry
    for predicted, true in (("q_predicted_rad", "q_rad"), ("qdot_predicted_rad_s", "qdot_rad_s")):
        # From 10 ms on: the first command is a jump of the currents, the others are not.
        now, then, result = (each[10:] for each in (table[true][:-periods], table[true][periods:],
                                                   table[predicted][:-periods]))  # fmt: skip
        # Of second order in a period of 1 ms; an angle of the sine turns with 3 1/s, currents lag by 0.7 ms.
        assert np.abs(result - then).max() < 2e-4 * np.abs(then - now).max()
    np.testing.assert_array_equal(table["q_handed"], table["q_predicted_rad"])
    np.testing.assert_array_equal(table["v_handed"], table["qdot_predicted_rad_s"])
    np.testing.assert_allclose(table["q_kept"], table["q_rad"], rtol=0, atol=1e-299)  # the offset
    np.testing.assert_array_equal(table["v_kept"], table["qdot_rad_s"])
    # The same torque as the belief's at that instant, which takes the matrix where the period begins.
    late, then = table["torque_handed"][:-periods], table["torque_kept"][periods:]
    np.testing.assert_allclose(late, then, rtol=0, atol=0.02 * np.abs(then).max())
    # A sine moved on by two terms of its series: what is left is δ³/6 of its third derivative.
    t = table["t_s"] + periods * 1e-3
    sine = 0.2 * np.sin(np.pi * t)[:, None]
    cubic = 0.2 * (np.pi * periods * 1e-3) ** 3 / 6
    np.testing.assert_allclose(table["at"], np.repeat(sine, 3, axis=1), rtol=0, atol=1.01 * cubic)


def test_without_a_delay_it_changes_no_bit():
    for law in ("pid", "afsm"):
        still = still_air(controller__law=law, duration=0.1)
        plain = still_air(controller__law=law, duration=0.1, controller__prediction__on=False)
        predicted, other = simulate(still).telemetry, simulate(plain).telemetry
        for signal in other.signals:
            np.testing.assert_array_equal(predicted[signal.name], other[signal.name])


def test_a_known_delay_no_longer_destabilises_a_loop():
    """Eight periods under a PID whose poles are at 60 1/s: without prediction it swings for ever."""
    fields = {"drive__delay_s": 8e-3, "controller__law": "pid", "controller__stiffness": 3 * 60.0**2,
              "controller__damping": 180.0, "controller__integral": 60.0**3, "duration": 1.0}  # fmt: skip
    swinging = simulate(still_air(**fields, controller__prediction__on=False)).telemetry
    settled = simulate(still_air(**fields)).telemetry
    assert np.abs(swinging["error_rad"][-200:]).max() > 0.02
    # As far off as with a quarter of the delay: the third derivative of the sine over the loop's ω³.
    assert np.abs(settled["error_rad"][-200:]).max() < 1e-4


def test_a_law_receives_a_delay_of_zero_with_prediction():
    with Session(still_air(drive__delay_s=2e-3, controller__law="pid")) as session:
        session.advance(10)
        predicted = len(session.law.state)
        session.set("controller.prediction.on", False)
        session.advance(10)
        size = len(session.law.state)
    assert size - predicted == 3 * 2  # a PID remembers what it asked for over as many periods
