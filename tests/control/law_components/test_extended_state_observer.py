"""The observer: poles where they are placed, the error that a moving disturbance leaves, any schedule."""

import numpy as np
import pytest

from spheretwin.control.law_components.extended_state_observer import ObserverState, observe, observer_gains
from spheretwin.control.law_components.nominal_motion import RotorModel, RotorMotion

PERIOD = 1e-3
TUNINGS = [(800.0, 20.0), (800.0, 400.0), (700.0, 100.0), (180.0, 90.0)]
ONE = RotorModel((1.0, 1.0, 1.0), False)  # a disturbance is an acceleration
REST = (0.0, 0.0, 0.0)


def seen(before, angle, torque, bandwidths, nominal=ONE):
    gains = observer_gains(*bandwidths, PERIOD)
    return observe(before, tuple(angle), tuple(torque), (gains,) * 3, nominal, PERIOD)


def error_map(bandwidths):
    """F, column by column: errors of the first axis after one period at rest."""
    columns = []
    for angle, rate, disturbance in np.eye(3):
        wrong = ObserverState(RotorMotion((angle, 0.0, 0.0), (rate, 0.0, 0.0)), (disturbance, 0.0, 0.0))
        motion, learnt = seen(wrong, REST, REST, bandwidths)
        columns.append([motion.angle[0], motion.rate[0], learnt[0]])
    return np.array(columns).T


def poles(bandwidths):
    return np.exp(-np.array([bandwidths[0], bandwidths[0], bandwidths[1]]) * PERIOD)


@pytest.mark.parametrize("bandwidths", TUNINGS)
def test_poles_are_where_they_are_placed(bandwidths):
    # The double pole is known to the root of rounding, the polynomial is not.
    coefficients = np.poly(error_map(bandwidths))
    np.testing.assert_allclose(coefficients, np.poly(poles(bandwidths)), rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("bandwidths", TUNINGS)
def test_a_disturbance_that_rises_steadily_leaves_what_is_said(bandwidths):
    rise, gains = 5.0, observer_gains(*bandwidths, PERIOD)
    l1, l2, l3 = gains.of_angle, gains.of_rate, gains.of_acceleration
    said = -rise / l3 * np.array([PERIOD * (1 - l1), l1 - 0.5 * l2 * PERIOD, l2])
    errors = errors_under(rise * PERIOD * np.arange(2000), bandwidths)
    # After 2 s the slowest pole has left e^-40 of the start; sums of some 1e4 m/s² round at 1e-12 of them.
    np.testing.assert_allclose(errors[-1], said, rtol=1e-6)
    wo, wd = bandwidths
    limit = -rise * np.array([1 / (wo**2 * wd), (2 * wo + wd) / (wo**2 * wd), 2 / wo + 1 / wd])
    fine = errors_under(rise * 1e-5 * np.arange(round(10 / wd / 1e-5)), bandwidths, 1e-5)
    # Ten times 1/ω_d leave e^-10. Sampling moves a gain by some ω T = 8e-3 of itself, and a delay of
    # two ticks that of d̂ by 2e-5 s of 5e-3.
    np.testing.assert_allclose(fine[-1], limit, rtol=2e-2)


def errors_under(push, bandwidths, period_s=PERIOD):
    """Errors of angle, rate and disturbance while an exact double integrator is pushed; as matrices."""
    gains = observer_gains(*bandwidths, period_s)
    A = np.array([[1, period_s, 0.5 * period_s**2], [0, 1, period_s], [0, 0, 1]])
    true, known, errors = np.zeros(2), np.zeros(3), []
    for acceleration in push:
        errors.append([*(known[:2] - true), known[2] - acceleration])
        true = A[:2] @ [*true, acceleration]
        known = A @ known
        known = known + np.array(gains) * (true[0] - known[0])
    return np.array(errors)


def stated(bandwidths, zero_order_hold):
    """The factors of N of the docstring, for a staircase or for any disturbance of bounded rate."""
    a, _, b = poles(bandwidths)
    p, r, T = 1 / (1 - a), 1 / (1 - b), PERIOD
    of_rate = p**2 + 2 * p * r - 3 * p - 1.5 * r + (7 / 4 if zero_order_hold else 11 / 6)
    return np.array(
        [T**3 * a**2 * b * p**2 * r, T**2 * of_rate, T * (2 * p + r - (1.5 if zero_order_hold else 2))]
    )


# Gauss's rule with four points is exact for the square of s that a period holds.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)


@pytest.mark.parametrize("zero_order_hold", [True, False])
@pytest.mark.parametrize("bandwidths", [*TUNINGS, (30.0, 50.0), (3000.0, 2000.0)])
def test_the_bound_is_the_sum_of_magnitudes_of_the_response(bandwidths, zero_order_hold):
    """The largest error that any disturbance of bounded rate can lead to is this sum, for a linear system."""
    F, gains = error_map(bandwidths), np.array(observer_gains(*bandwidths, PERIOD))
    if zero_order_hold:  # it changes where a period begins: all of the next one is left, as seen at its end
        error, weights = np.eye(3)[:, 2:], np.array([PERIOD])
    else:  # by the time that is left of its period, after a step of the disturbance of -1
        s, weights = PERIOD * (POINTS + 1) / 2, PERIOD * WEIGHTS / 2
        error = (np.eye(3) - np.outer(gains, [1, 0, 0])) @ np.array([s**2 / 2, s, np.ones_like(s)])
    total = np.zeros(3)
    for _ in range(int(40 / min(bandwidths) / PERIOD) + 10):  # e^-40 of the start is left
        total += np.abs(error) @ weights
        error = F @ error
    # Sums of some 1e3 numbers; the angle's entries are 1e-6 of others of F, which round at 1e-16.
    np.testing.assert_allclose(total, stated(bandwidths, zero_order_hold), rtol=1e-8)


def test_the_response_has_one_sign_for_all_poles():
    """With time in periods, the response depends on both poles and the instant of the step alone."""
    for fast in np.geomspace(1e-3, 20, 15):
        for slow in np.geomspace(1e-3, 20, 15):
            a, b = np.exp(-fast), np.exp(-slow)
            gains = np.array(observer_gains(fast / PERIOD, slow / PERIOD, PERIOD))
            gains *= [1, PERIOD, PERIOD**2]
            keep = np.eye(3) - np.outer(gains, [1, 0, 0])
            s = np.linspace(0, 1, 21)
            error = keep @ np.array([s**2 / 2, s, np.ones_like(s)])
            least, largest = np.inf, np.zeros(3)
            for _ in range(60):
                least = min(least, error.min())
                largest = np.maximum(largest, error.max(axis=1))
                error = keep @ np.array([[1, 1, 0.5], [0, 1, 1], [0, 0, 1]]) @ error
            assert least >= -1e-14 * largest.max(), (a, b)


@pytest.mark.parametrize(("bandwidths", "share"), [((800.0, 20.0), 0.0025), ((800.0, 400.0), 0.033)])
def test_the_bound_of_continuous_time_is_passed_by_a_staircase(bandwidths, share):
    """So that the sampled one is needed: at 1 kHz its third factor is larger by what is expected."""
    wo, wd = bandwidths
    steady = np.abs(errors_under(PERIOD * np.arange(2000), bandwidths)[-1])
    np.testing.assert_allclose(steady, stated(bandwidths, zero_order_hold=True), rtol=1e-6)
    passed_by = steady[2] / (2 / wo + 1 / wd) - 1
    assert passed_by == pytest.approx(share, rel=0.02)
    # To the first order of T² it is (2 ω_o + ω_d) T²/12; the next order is some (ω_o T)² / 60 of that.
    assert passed_by * (2 / wo + 1 / wd) == pytest.approx((2 * wo + wd) * PERIOD**2 / 12, rel=0.02)


def test_a_schedule_leaves_the_fast_poles_their_directions():
    """The rows that the docstring names are left eigenvectors, and of second order, whatever ω_d is."""
    A = np.array([[1, PERIOD, 0.5 * PERIOD**2], [0, 1, PERIOD], [0, 0, 1]])
    a = np.exp(-800.0 * PERIOD)
    inverse = np.linalg.inv(A - a * np.eye(3))
    first = A[0] @ inverse
    second = first @ inverse
    for slow in (0.0, 20.0, 100.0, 400.0):
        F = error_map((800.0, slow))
        # Numbers of the order of 1; F has been through differences of numbers of 1e6 T² = 1.
        np.testing.assert_allclose(first @ F, a * first, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(second @ F, a * second + first, rtol=1e-9, atol=1e-12)


def test_without_a_bandwidth_no_disturbance_is_learnt():
    result = seen(
        ObserverState(RotorMotion(REST, REST), (0.3, 0.3, 0.3)), (0.1, 0.2, 0.3), REST, (500.0, 0.0)
    )
    assert result.disturbance == (0.3, 0.3, 0.3)
