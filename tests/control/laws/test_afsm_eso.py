"""The law with an observer: a slow copy, its boost, its presets and its poles."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.laws.afsm_eso import PRESETS, AFSMWithObserver
from spheretwin.models.lagrangian import coriolis_matrix, inertia_matrix
from spheretwin.scenario.changes import with_change
from spheretwin.simulation import simulate
from tests.control.laws.cases import PERIOD, known, machine_code, regressor

EVERYTHING = {
    "surface_slope_1_s": [40.0, 50.0, 60.0],
    "boost_layer_rad_s": [0.1, 0.2, 0.3],
    "observer_bandwidth_rad_s": [300.0, 400.0, 500.0],
    "fuzzy_adaptation": [5.0, 0.0, 20.0],
    "fuzzy_bound": 0.5,
}


class SlowLaw:
    """The law as its docstring has it, with matrices; every torque that it ever asked for is kept."""

    def __init__(self, gains, inertia, delay_s):
        self.gains, self.inertia, self.delay_s = gains, inertia, delay_s
        self.d, self.theta, self.asked = np.zeros(3), np.zeros((3, 75)), []
        self.z, self.wd = None, np.array(gains.disturbance_bandwidth_rad_s)

    def inertia_at(self, q):
        return inertia_matrix(q if self.gains.coupled else np.zeros(3), self.inertia)

    def coriolis_torque(self, q, v):
        return coriolis_matrix(q, v, self.inertia) @ v if self.gains.coupled else np.zeros(3)

    def moved(self, q, v, torque, time_s):
        a = np.linalg.solve(self.inertia_at(q), torque + self.d - self.coriolis_torque(q, v))
        return q + time_s * v + time_s**2 / 2 * a, v + time_s * a

    def asked_before(self, periods):
        return self.asked[-periods] if 0 < periods <= len(self.asked) else np.zeros(3)

    def observe(self, y, torque):
        a, b = np.exp(-np.array(self.gains.observer_bandwidth_rad_s) * PERIOD), np.exp(-self.wd * PERIOD)
        l1, l3 = 1 - a**2 * b, (1 - a) ** 2 * (1 - b) / PERIOD**2
        l2 = (3 - 2 * a - b - l1 - l3 * PERIOD**2 / 2) / PERIOD
        q, v = self.moved(*self.z, torque, PERIOD)
        i = y - q
        self.z = q + l1 * i, v + l2 * i
        self.d = self.d + self.inertia_at(self.z[0]) @ (l3 * i)

    def fuzzy(self, q, v, s):
        g, f = self.gains, np.zeros(3)
        for i in np.flatnonzero(g.fuzzy_adaptation):
            basis = regressor(v[i], q[i])
            f[i] = self.theta[i] @ basis
            learnt = s[i] if abs(s[i]) > g.fuzzy_dead_zone_rad_s else 0.0
            self.theta[i] -= g.fuzzy_adaptation[i] * learnt * PERIOD * basis
            self.theta[i] *= 1 - g.fuzzy_leakage_1_s * PERIOD
            norm = np.linalg.norm(self.theta[i])
            self.theta[i] *= min(1, g.fuzzy_bound / norm) if norm else 1
        return f

    def torque(self, reference, measurement):
        g = self.gains
        if self.z is None:
            self.z = measurement[0].copy(), measurement[1].copy()
        else:
            self.observe(measurement[0], measurement[2])
        whole, late = int(self.delay_s / PERIOD), self.delay_s / PERIOD % 1
        q, v = self.moved(*self.z, self.asked_before(whole + 1), late * PERIOD)
        for periods in range(whole, 0, -1):
            q, v = self.moved(q, v, self.asked_before(periods), PERIOD)
        desired_rate = reference[1] + self.delay_s * reference[2]
        desired = reference[0] + self.delay_s * reference[1] + self.delay_s**2 / 2 * reference[2]
        slope, layer = np.array(g.surface_slope_1_s), np.array(g.boost_layer_rad_s)
        s = v - desired_rate + slope * (q - desired)
        beyond = s - np.clip(s, -layer, layer)
        boost = np.clip(g.boost_slope_1_s * beyond, -np.array(g.boost_bound_rad_s2), g.boost_bound_rad_s2)
        slow = np.array(g.disturbance_bandwidth_rad_s)
        fading = slow + np.exp(-PERIOD / g.fade_s) * (self.wd - slow)
        self.wd = np.where(beyond != 0, g.fast_disturbance_bandwidth_rad_s, fading)
        asked = late * self.asked_before(whole + 2) + (1 - late) * self.asked_before(whole + 1)
        learns = np.abs(asked - measurement[2]).sum() <= 0.2 * np.abs(asked).sum()
        f = self.fuzzy(q, v, s if learns else np.zeros(3))
        a = reference[2] - slope * (v - desired_rate) - np.array(g.reaching_gain_1_s) * s - boost + f
        self.asked.append(self.inertia_at(q) @ a + self.coriolis_torque(q, v) - self.d)
        return self.asked[-1]


@pytest.mark.parametrize("delay_s", [0.0, 1e-3, 2.25e-3])
@pytest.mark.parametrize(
    "gains",
    [{}, {"preset": "fast", "coupled": False}, {"preset": "prototype", **EVERYTHING}],
    ids=["ideal", "uncoupled", "everything"],
)
def test_law_follows_its_equations(actuator, gains, delay_s):
    gains = AFSMWithObserver(**gains)
    law = gains.build(known(actuator, delay_s))
    slow = SlowLaw(gains, actuator.inertia, delay_s)
    call, state = machine_code(law)
    generator = np.random.default_rng(0)
    for tick in range(200):
        q = 0.3 * np.sin(0.02 * tick + np.arange(3))
        reference = np.array([q, 0.1 * generator.normal(size=3), generator.normal(size=3)])
        measurement = np.array([q + 0.002 * generator.normal(size=3), reference[1], slow.asked_before(1)])
        if tick % 3:  # now and then it gets what it asks for, so that f̂ learns
            measurement[2] += generator.normal(size=3)
        torque = call(reference, measurement)
        # 200 ticks of a stable recursion whose torques reach some N·m: accumulated rounding.
        np.testing.assert_allclose(torque, slow.torque(reference, measurement), rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(state[3:6], slow.d, rtol=1e-9, atol=1e-10)
        np.testing.assert_array_equal(state[9:12] == law.parameters[24:27], slow.wd == law.parameters[24:27])


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_sets_the_fields_that_are_not_given(preset):
    law = {"controller.law": "afsm_eso", "controller.preset": preset}
    gains = scenarios.load("hold", law).controller.model_dump()
    assert gains == AFSMWithObserver(**PRESETS[preset]).model_dump() | {"preset": preset}
    own = scenarios.load("hold", {**law, "controller.surface_slope_1_s": 33.0}).controller.model_dump()
    assert own == {**gains, "surface_slope_1_s": (33.0,) * 3}
    run = simulate(scenarios.load("hold", {**law, "duration": 0.01}))
    assert run.scenario.controller.model_dump() == gains  # the resolved scenario shows what is in force


def test_of_a_section_of_the_preset_one_field_can_be_given_alone():
    law = {"controller.law": "afsm_eso", "controller.preset": "prototype"}
    fed = scenarios.load("hold", {**law, "controller.feed_forward.inertia": 0.5}).controller.feed_forward
    assert (fed.friction, fed.inertia) == ((0.8,) * 3, (0.5,) * 3)


def test_ideal_is_the_default():
    assert AFSMWithObserver() == AFSMWithObserver(preset="ideal")
    for name, field in AFSMWithObserver.model_fields.items():
        assert getattr(AFSMWithObserver(), name) == field.default


def test_another_law_in_its_place_starts_with_its_own_gains():
    afsm = scenarios.load("hold", {"controller.law": "afsm"})
    assert with_change(afsm, "controller.law", "afsm_eso").controller == AFSMWithObserver()


def closed_loop(preset, modelling_error, actuator):
    """Matrix of one period of (angle, rate, ẑ₁, ẑ₂, d̂) of β: the law on (1 + m) of its double integrator."""
    law, inertia = AFSMWithObserver(preset=preset, coupled=False).build(known(actuator)), actuator.inertia
    columns, small = [], 1e-4  # well within the layer
    state, torque = law.state.copy(), np.empty(3)
    law.step(0.0, np.zeros((3, 3)), np.zeros((3, 3)), law.parameters, state, torque)
    for unit in small * np.eye(5):
        angle, rate = unit[:2]
        now = state.copy()
        now[16], now[19], now[4] = unit[2], unit[3], unit[4] * inertia[1]
        # The torque that the law asks for in this state: its observer is let see what it expects.
        asked = torque_of(law, now)
        push = asked / inertia[1] / (1 + modelling_error)
        angle, rate = angle + PERIOD * rate + 0.5 * PERIOD**2 * push, rate + PERIOD * push
        measurement = np.zeros((3, 3))
        measurement[0, 1], measurement[2, 1] = angle, asked
        law.step(0.0, np.zeros((3, 3)), measurement, law.parameters, now, torque)
        columns.append([angle, rate, now[16], now[19], now[4] / inertia[1]])
    return np.array(columns).T / small


def torque_of(law, state):
    """What the law asks for on β in a state that it has just come to."""
    slope, reaching = law.parameters[4], law.parameters[7]
    s = state[19] + slope * state[16]
    return law.parameters[1] * (-slope * state[19] - reaching * s) - state[4]


@pytest.mark.parametrize(
    ("preset", "stable", "unstable"),
    [
        ("ideal", (-0.91, 7.9), (-0.92, 7.92)),
        ("fast", (-0.87, 8.2), (-0.88, 8.3)),
        ("prototype", (-0.77, 3.2), (-0.78, 3.3)),
        ("robust", (-0.76, 4.8), (-0.78, 4.95)),
    ],
)
def test_with_another_inertia_the_poles_are_stable_in_the_documented_range(
    actuator, preset, stable, unstable
):
    for m in (*np.linspace(*stable, 30), *unstable):
        largest = np.abs(np.linalg.eigvals(closed_loop(preset, m, actuator))).max()
        assert (largest < 1) == (m not in unstable)


def test_at_the_nominal_inertia_the_poles_are_those_of_observer_and_surface(actuator):
    eigenvalues = np.linalg.eigvals(closed_loop("ideal", 0.0, actuator))
    gains = AFSMWithObserver()
    slope, reaching = gains.surface_slope_1_s[1], gains.reaching_gain_1_s[1]
    wo, wd = gains.observer_bandwidth_rad_s[1], gains.disturbance_bandwidth_rad_s[1]
    # Held over a period, v = -(λ + K) q̇ - λ K q gives d² + ((λ + K) T + λ K T²/2) d + λ K T², d = z - 1.
    damping, stiffness = (slope + reaching) * PERIOD, slope * reaching * PERIOD**2
    of_surface = np.roots([1, damping + stiffness / 2, stiffness]) + 1
    expected = np.poly([*of_surface, *np.exp(-np.array([wo, wo, wd]) * PERIOD)])
    # Double poles are known to the root of rounding; their polynomial, from entries of 1e6 T², to 1e-8.
    np.testing.assert_allclose(np.poly(eigenvalues), expected, rtol=1e-7)


@pytest.mark.parametrize("bandwidths", [(800.0, 20.0), (800.0, 400.0), (700.0, 100.0)])
def test_in_a_run_the_error_of_the_observed_disturbance_stays_within_its_bound(actuator, bandwidths):
    """A slow sinusoidal load on the nominal rotor, held over each period as the loop holds it."""
    frequency_Hz = bandwidths[1] / 20 / (2 * np.pi)
    sinusoid = {"kind": "sinusoidal", "amplitude_Nm": [0.0, 0.02, 0.0], "frequency_Hz": [frequency_Hz] * 3}
    fields = {
        "plant.engine": "lagrangian", "plant.gravity_m_s2": 0.0, "drive.time_constant_s": 0.0,
        "nominal.time_constant_s": 0.0, "trajectory.angle_rad": [0.0, 0.0, 0.0], "duration": 8.0,
        "disturbance.load": 0.0, "disturbance.random_bound_Nm": 0.0, "disturbance.terms": [sinusoid],
        "controller.law": "afsm_eso", "controller.observer_bandwidth_rad_s": bandwidths[0],
        "controller.disturbance_bandwidth_rad_s": bandwidths[1],
        "controller.fast_disturbance_bandwidth_rad_s": bandwidths[1],
    }  # fmt: skip
    table, wo, wd = simulate(scenarios.load("hold", fields)).telemetry, *bandwidths
    true = -table["disturbance_Nm"][:, 1]
    error = np.abs(table["observed_disturbance_Nm"][:, 1] - true)[2000:]  # e^-40 of the start is left
    a, b = np.exp(-wo * PERIOD), np.exp(-wd * PERIOD)
    rate = np.abs(np.diff(true)).max() / PERIOD
    bound = rate * PERIOD * (2 / (1 - a) + 1 / (1 - b) - 1.5)
    assert error.max() <= bound
    # At a twentieth of ω_d the sinusoid is nearly a steady rise: its lag loses half of (1/20)² of the peak.
    assert error.max() > 0.98 * bound
