"""The compiled laws against slow copies of the paper's equations, written for this test."""

import numpy as np
import pytest

from spheretwin.control.laws.adaptive_fuzzy import AdaptiveFuzzy
from spheretwin.control.laws.afsm import AFSM
from spheretwin.control.laws.pd import PD
from tests.control.laws.cases import PERIOD, known, machine_code, regressor


def each_axis(kind):
    """Gains of a law, all of which are given per axis."""
    return [
        (name, field.default) for name, field in kind.model_fields.items() if isinstance(field.default, tuple)
    ]


class SlowLaw:
    """Equations (28)-(43), one axis at a time, as matrices and sums."""

    def __init__(self, gains, inertia):
        self.gains = gains
        self.factor = inertia if gains.level == "acceleration" else np.ones(3)
        self.theta = np.zeros((3, 75))
        self.xi, self.zeta = np.zeros(3), np.zeros(3)

    def torque(self, reference, measurement):
        g = self.gains
        e, e_rate = measurement[0] - reference[0], measurement[1] - reference[1]
        if g.law == "pd":
            return self.factor * (-np.array(g.stiffness) * e - g.damping * e_rate)
        s = np.array(g.surface_slope) * e + e_rate
        bound = 1 + np.abs(s) + s**2
        v = np.empty(3)
        for i in range(3):
            rate, angle = measurement[1, i], measurement[0, i]
            basis = regressor(rate, angle)
            v[i] = self.theta[i] @ basis - g.reaching_gain[i] * s[i]
            self.theta[i] -= g.fuzzy_rate[i] * s[i] * basis * PERIOD
        if g.law == "afsm":
            v -= np.sign(s) * (self.xi + self.zeta * bound)
            self.xi += np.array(g.switching_rate) * np.abs(s) * PERIOD
            self.zeta += np.array(g.bound_rate) * np.abs(s) * bound * PERIOD
        return self.factor * v


@pytest.mark.parametrize("level", ["acceleration", "torque"])
@pytest.mark.parametrize("kind", [PD, AdaptiveFuzzy, AFSM])
def test_law_follows_the_paper(actuator, kind, level):
    gains = kind(
        level=level, **{name: (value[0], 2 * value[1], value[2] / 3) for name, value in each_axis(kind)}
    )
    law, slow = gains.build(known(actuator)), SlowLaw(gains, actuator.inertia)
    call, _ = machine_code(law)
    generator = np.random.default_rng(0)
    for _ in range(500):
        reference = generator.normal(size=(3, 3))
        measurement = reference[:2] + 0.3 * generator.normal(size=(2, 3))
        torque = call(reference, measurement)
        # 500 Euler steps of up to 75 sums: accumulated rounding.
        np.testing.assert_allclose(torque, slow.torque(reference, measurement), rtol=1e-9, atol=1e-12)


def test_estimates_are_logged_as_they_are(actuator):
    law = AFSM().build(known(actuator))
    state, torque = law.state.copy(), np.empty(3)
    measurement = np.array([[0.1, -0.2, 0.3], [0.0, 0.0, 0.0]])
    law.step(0.0, np.zeros((3, 3)), measurement, law.parameters, state, torque)
    s = 50 * measurement[0]
    names = [signal.name for signal in law.signals]
    assert names == ["sliding_s", "fuzzy_torque_Nm", "switching_torque_Nm", "switching_gain", "bound_gain"]
    np.testing.assert_allclose(state[:3], s, rtol=1e-15)
    np.testing.assert_allclose(state[9:12], 10 * np.abs(s) * PERIOD)
    np.testing.assert_allclose(state[12:15], 10 * np.abs(s) * (1 + np.abs(s) + s**2) * PERIOD)


def test_no_error_asks_for_no_switching(actuator):
    # sgn(0) = 0: on the surface the law must not push to either side.
    law = AFSM().build(known(actuator))
    state, torque = law.state.copy(), np.empty(3)
    state[9:15] = 5.0  # grown estimates
    law.step(0.0, np.zeros((3, 3)), np.zeros((2, 3)), law.parameters, state, torque)
    np.testing.assert_array_equal(torque, np.zeros(3))
