"""The converter against its definition: the staircase, its ends, errors within bounds, the mean of many."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.electronics.converters import Adc, AdcSection, converted, fill_adcs

NO_DRAWS = np.empty(0)


def made(seed=0, **fields):
    shares = np.random.default_rng([seed, 2, 0]).uniform(-1, 1, 2)
    return Adc.filled(fill_adcs, AdcSection(**fields), shares)[0]


def quiet(channel, volts, noise_V=0.0, draws=NO_DRAWS):
    return converted(channel, volts, noise_V, draws, 0, 1)


def test_the_staircase_has_its_treads_at_whole_steps_and_two_ends():
    channel, step = made(bits=4), 5 / 16
    for code in range(-8, 8):
        for inside in (-0.499, 0.0, 0.499):
            assert quiet(channel, (code + inside) * step) == code * step
    # On a riser, the even of its two codes.
    assert [quiet(channel, (code + 0.5) * step) / step for code in range(-8, 7)] == [
        round(code + 0.5) for code in range(-8, 7)
    ]
    for beyond in (7.4, 7.6, 8.0, 1e9, np.inf):
        assert quiet(channel, beyond * step) == 7 * step
        assert quiet(channel, -(beyond + 1) * step) == -8 * step


@given(st.floats(-2.5, 2.5), st.integers(2, 32))
def test_a_code_is_at_most_half_a_step_off_within_the_range(volts, bits):
    step = 5 / 2**bits
    got = quiet(made(bits=bits), volts)
    assert got / step == round(got / step)
    # The last half step has no code of its own.
    assert abs(got - min(volts, 2.5 - step)) <= step / 2


@given(st.floats())
def test_a_converter_without_errors_hands_over_the_same_bits(volts):
    got = quiet(made(oversampling=7, range_V=0.1), volts)
    assert np.float64(got).tobytes() == np.float64(volts).tobytes() or np.isnan(volts) & np.isnan(got)


def test_none_stays_none():
    assert np.isnan(quiet(made(bits=16, offset_V=1e-3), np.nan))
    assert np.isnan(quiet(made(bits=16), 0.5, 1e-3, np.array([0.0, np.nan])))


@pytest.mark.parametrize("conversions", [1, 4, 16, 64])
def test_the_mean_of_many_sees_between_steps_with_the_variance_of_one_over_their_number(conversions):
    channel, step, runs = made(bits=12), 5 / 2**12, 20_000
    draws = np.random.default_rng(0).standard_normal((runs, conversions))
    constant = 100.3 * step
    got = np.array([quiet(channel, constant, step, row) for row in draws])
    # With noise of a step, quantisation adds a twelfth and shifts nothing, both to exp(-2π²) = 3e-9.
    variance = step**2 * (1 + 1 / 12) / conversions
    assert got.var() == pytest.approx(variance, rel=4 * np.sqrt(2 / runs))
    assert abs(got.mean() - constant) < 4 * np.sqrt(variance / runs)


def test_every_stride_th_draw_is_the_channel_s():
    channel, draws = made(), np.array([1.0, 10.0, 2.0, 20.0])
    assert converted(channel, 0.0, 1.0, draws, 0, 2) == 1.5
    assert converted(channel, 0.0, 1.0, draws, 1, 2) == 15.0


def test_one_error_moves_no_draw_of_the_other():
    both = made(offset_V=1e-3, gain_error=1e-2)
    assert made(offset_V=1e-3).offset_V == both.offset_V
    assert made(gain_error=1e-2).gain == both.gain
