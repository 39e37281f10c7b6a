"""Coils: relaxation, lag, resistance of copper, exact heat, back-EMF with the power of the torque."""

from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from spheretwin.electronics.coil import (
    SERIES_TO,
    CoilSection,
    CurrentLag,
    GroupCoils,
    advance_lag,
    advance_temperature,
    back_emf,
    fill_coils,
    fill_lag,
    is_overheated,
    relaxation,
)
from spheretwin.models.magnetics import rotor_torque

R, L, PERIOD_S = 1.3, 0.9e-3, 1e-3


def coils(groups, period_s=PERIOD_S, **changes):
    values = {"resistance_ohm": R, "inductance_H": L, "resistance_per_K": 0.0039}
    values |= {"heat_capacity_J_K": 60.0, "thermal_resistance_K_W": 4.0}
    return GroupCoils.filled(fill_coils, CoilSection(**values | changes), period_s, groups=groups)[0]


@pytest.mark.parametrize(("ambient", "share"), [(20.0, 1.0), (120.0, 1.39), (-30.0, 0.805)])
def test_resistance_is_coppers(ambient, share):
    resistance_ohm = np.array([1.3, 5.7, 8.3])
    made = coils(3, ambient_degC=ambient, resistance_ohm=tuple(resistance_ohm))
    np.testing.assert_allclose(made.resistance_ohm, resistance_ohm * share, rtol=1e-15)


def test_constant_power_heats_as_one_exponential_to_its_rest():
    """Each group heats with its own power, heat capacity and thermal resistance."""
    watts, period_s = np.array([0.0, 1.0, 80.0]), 0.5
    capacity_J_K, thermal_K_W = np.array([60.0, 30.0, 60.0]), np.array([4.0, 8.0, 5.0])
    made = coils(
        3, period_s, heat_capacity_J_K=tuple(capacity_J_K), thermal_resistance_K_W=tuple(thermal_K_W)
    )
    for period in range(1, 4001):
        advance_temperature(made, watts * period_s)
        if period in (1, 480, 4000):  # 480 periods are one time constant of the first two, 240 s
            exact = 20 + thermal_K_W * watts * -np.expm1(-period * period_s / (thermal_K_W * capacity_J_K))
            np.testing.assert_allclose(made.temperature_degC, exact, rtol=1e-12)  # 4000 roundings
    np.testing.assert_allclose(made.resistance_ohm, R * (1 + 0.0039 * (exact - 20)), rtol=1e-12)


@given(st.floats(-50, 1000), st.floats(0, 1e4), st.floats(-6, 1), st.floats(-2, 3), st.floats(-2, 2))
def test_one_period_is_the_exact_exponential(start, watts, log_period, log_capacity, log_resistance):
    period_s, capacity, thermal = 10.0**log_period, 10.0**log_capacity, 10.0**log_resistance
    made = coils(1, period_s, heat_capacity_J_K=capacity, thermal_resistance_K_W=thermal)
    made.temperature_degC[0] = start
    advance_temperature(made, np.array([watts * period_s]))
    final = 20.0 + thermal * watts
    exact = final + (start - final) * np.exp(-period_s / (thermal * capacity))
    assert made.temperature_degC[0] == pytest.approx(exact, rel=0, abs=1e-14 * (abs(final) + abs(start)))


def test_a_coil_that_is_cooled_at_once_stays_at_the_temperature_around_it():
    made = coils(1, thermal_resistance_K_W=0.0, ambient_degC=40.0)
    advance_temperature(made, np.array([100.0]))
    assert made.temperature_degC[0] == 40.0


def test_overheated_is_said_of_the_hottest_group():
    made = coils(3, shutdown_degC=(20.0001, 155.0, 155.0))
    assert not is_overheated(made)
    for hottest in (155.0, 400.0, np.nan):
        made.temperature_degC[1] = hottest
        assert is_overheated(made)
    endless = coils(3)
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


@pytest.mark.parametrize("time_constant_s", [1e-4, 6.9e-4, 5e-2, (6.9e-4, 1e-4)])
def test_one_step_is_the_exact_exponential_and_its_mean(time_constant_s):
    step_s = 5e-4
    command, current, mean = np.array([3.0, -1.0]), np.array([0.5, 2.0]), np.empty(2)
    start = current.copy()
    lag = CurrentLag.filled(fill_lag, time_constant_s, step_s, 8.0, groups=2)[0]
    advance_lag(lag, command, current, mean)

    def exact(t):
        return command + (start - command) * np.exp(-t / np.array(time_constant_s))

    np.testing.assert_allclose(current, exact(step_s), rtol=1e-14)
    expected = [quad(lambda t, j=j: exact(t)[j], 0, step_s, epsabs=1e-14)[0] / step_s for j in range(2)]
    np.testing.assert_allclose(mean, expected, rtol=1e-12)


def test_without_lag_the_current_is_the_command():
    command, current, mean = np.array([4.0]), np.zeros(1), np.empty(1)
    advance_lag(CurrentLag.filled(fill_lag, 0.0, 5e-4, 8.0, groups=1)[0], command, current, mean)
    assert current[0] == mean[0] == 4.0


SCALES = [*10.0 ** np.linspace(-14, 18, 1000), *np.linspace(0.9 * SERIES_TO, 1.1 * SERIES_TO, 100)]


def with_sixty_digits(x):
    with localcontext() as context:
        context.prec = 60
        time = Decimal(x)
        settled = 1 - (-time).exp()
        both = settled * settled / 2
        integrals = (time - settled, settled - both, both, time - settled - both)
        return [float(number) for number in (settled, *(integral / time for integral in integrals))]


def test_every_share_is_exact_at_every_scale():
    shares = np.array([relaxation(float(x)) for x in SCALES])
    exact = np.array([with_sixty_digits(float(x)) for x in SCALES])
    # A few roundings; just above the series' end, the mean square is a difference of numbers fifty times it.
    np.testing.assert_allclose(shares[:, :4], exact[:, :4], rtol=1e-15)
    np.testing.assert_allclose(shares[:, 4], exact[:, 4], rtol=1e-14)


@given(st.floats(0, 1e300))
def test_shares_are_shares(x):
    shares = relaxation(x)
    assert all(0 <= share <= 1 for share in shares)
    # Start and end make up the whole, on average as at any moment.
    assert shares.start_start + 2 * shares.start_settled + shares.settled_settled == pytest.approx(
        1, rel=1e-14
    )
    assert shares.start_settled + shares.settled_settled == pytest.approx(shares.mean, rel=1e-14, abs=1e-300)


def test_in_no_time_nothing_has_settled():
    assert relaxation(0.0) == (0, 0, 1, 0, 0)
