"""Coils: copper's resistance, heat against its exact solution and balance, back-EMF as the torque's twin."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.electronics.coil import CoilSection, advance_temperature, back_emf, group_coils, is_overheated
from spheretwin.models.magnetics import rotor_torque

R, L, PERIOD_S = 1.3, 0.9e-3, 1e-3
COPPER = CoilSection(resistance_per_K=0.0039)


def test_figures_are_the_models_unless_given():
    model = group_coils(CoilSection(), R, L, PERIOD_S, 2)
    given_ = group_coils(CoilSection(resistance_ohm=2.0, inductance_H=1e-3), R, L, PERIOD_S, 2)
    assert model.inductance_H == L
    assert given_.inductance_H == 1e-3
    np.testing.assert_array_equal(model.resistance_ohm, R)
    np.testing.assert_array_equal(given_.resistance_ohm, 2.0)


@pytest.mark.parametrize(("ambient", "share"), [(20.0, 1.0), (120.0, 1.39), (-30.0, 0.805)])
def test_resistance_is_coppers(ambient, share):
    made = group_coils(COPPER.model_copy(update={"ambient_degC": ambient}), R, L, PERIOD_S, 3)
    np.testing.assert_allclose(made.resistance_ohm, R * share, rtol=1e-15)


def test_constant_power_heats_as_one_exponential_to_its_rest():
    watts, period_s = np.array([0.0, 1.0, 80.0]), 0.5
    made = group_coils(COPPER, R, L, period_s, 3)
    for period in range(1, 4001):
        advance_temperature(made, watts * period_s)
        if period in (1, 480, 4000):  # 480 periods are one time constant, 240 s
            exact = 20 + 4.0 * watts * -np.expm1(-period * period_s / 240)
            np.testing.assert_allclose(made.temperature_degC, exact, rtol=1e-12)  # 4000 roundings
    np.testing.assert_allclose(made.resistance_ohm, R * (1 + 0.0039 * (exact - 20)), rtol=1e-12)


@given(st.floats(-50, 1000), st.floats(0, 1e4), st.floats(-6, 1), st.floats(-2, 3), st.floats(-2, 2))
def test_one_period_is_the_exact_exponential(start, watts, log_period, log_capacity, log_resistance):
    period_s, capacity, thermal = 10.0**log_period, 10.0**log_capacity, 10.0**log_resistance
    section = CoilSection(heat_capacity_J_K=capacity, thermal_resistance_K_W=thermal)
    made = group_coils(section, R, L, period_s, 1)
    made.temperature_degC[0] = start
    advance_temperature(made, np.array([watts * period_s]))
    final = 20.0 + thermal * watts
    exact = final + (start - final) * np.exp(-period_s / (thermal * capacity))
    assert made.temperature_degC[0] == pytest.approx(exact, rel=0, abs=1e-14 * (abs(final) + abs(start)))


def warmed(current_A, periods):
    """Temperature at the end of periods of 1 s with a constant current."""
    made = group_coils(COPPER, R, L, 1.0, 1)
    for _ in range(periods):
        advance_temperature(made, made.resistance_ohm * current_A**2)
    return made.temperature_degC[0]


def test_a_constant_current_comes_to_rest_where_copper_lets_it_and_runs_away_beyond():
    # Rise = 4 K/W R20 i² (1 + 0.0039 rise), at rest only for i² below 1 / (4 R20 0.0039): 7.02 A.
    cold = 4 * R * 3.0**2
    rest = 20 + cold / (1 - 0.0039 * cold)
    assert warmed(3.0, 20_000) == pytest.approx(rest, rel=1e-12)  # 60 time constants and more
    assert warmed(7.1, 20_000) > 1000
    assert warmed(7.1, 40_000) > 1.5 * warmed(7.1, 20_000)


def test_a_coil_that_is_cooled_at_once_stays_at_the_temperature_around_it():
    made = group_coils(CoilSection(thermal_resistance_K_W=0.0, ambient_degC=40.0), R, L, PERIOD_S, 1)
    advance_temperature(made, np.array([100.0]))
    assert made.temperature_degC[0] == 40.0


def test_overheated_is_said_of_the_hottest_group():
    made = group_coils(CoilSection(shutdown_degC=155.0), R, L, PERIOD_S, 3)
    assert not is_overheated(made)
    for hottest in (155.0, 400.0, np.nan):
        made.temperature_degC[1] = hottest
        assert is_overheated(made)
    endless = group_coils(CoilSection(), R, L, PERIOD_S, 3)
    endless.temperature_degC[1] = 1e30
    assert not is_overheated(endless)


@given(st.integers(0, 2**32), st.sampled_from([12, 18, 24]))
def test_emf_takes_as_power_what_the_torque_gives(seed, groups):
    generator = np.random.default_rng(seed)
    G, rate = generator.normal(size=(3, groups)), generator.normal(size=3)
    gain, current = generator.uniform(-2, 2, groups), generator.normal(size=groups)
    emf, torque = np.empty(groups), np.empty(3)
    back_emf(G, gain, rate, emf)
    rotor_torque(G, gain * current, torque)
    np.testing.assert_allclose(emf, gain * (G.T @ rate), rtol=0, atol=1e-14)
    # Rounding of sums of some thirty products of size one.
    assert emf @ current == pytest.approx(torque @ rate, rel=0, abs=1e-13)
