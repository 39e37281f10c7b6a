"""The converter against its definition: codes, ends, errors of a channel, and what is drawn."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.electronics.converters import Dac, DacSection, convert, fill_dac

GAIN_A_V, RANGE_V, GROUPS = 0.8, 10.0, 18
LSB_A = GAIN_A_V * 2 * RANGE_V / 2**16
PLAIN = DacSection(dac_bits=16)
OFFSET = DacSection(dac_bits=16, dac_offset_V=2e-3)
PROTOTYPE = DacSection(dac_bits=16, dac_offset_V=2e-3, dac_gain_error=1e-3, dac_inl_lsb=4.0)
CODES = np.arange(-(2**15), 2**15)


def dac_of(section, groups, seed=0):
    return Dac.filled(fill_dac, section, GAIN_A_V, seed, groups=groups)[0]


def converted(made, command):
    setpoint = np.empty_like(command)
    convert(made, command, setpoint)
    return setpoint


def curve(made, channel):
    """What one channel makes of every code, A."""
    one = Dac.zeros(groups=len(CODES))
    for name in Dac.fields():
        of_channel = name in ("offset_V", "gain", "inl_lsb")
        one[name] = made[name][channel] if of_channel else made[name]
    return converted(one[0], CODES * LSB_A)


def test_without_bits_commands_pass_bit_by_bit():
    odd = np.array([0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, -1.7e308, 0.1])
    section = DacSection(dac_offset_V=1.0, dac_gain_error=0.1, dac_inl_lsb=9.0)
    for ideal in (DacSection(), section):
        assert converted(dac_of(ideal, len(odd), 0), odd).tobytes() == odd.tobytes()


@pytest.mark.parametrize("bits", [1, 2, 8, 16, 24, 32])
def test_one_code_is_nothing_and_reaches_half_a_step_to_both_sides(bits):
    made = dac_of(DacSection(dac_bits=bits), 5)
    step = GAIN_A_V * 2 * RANGE_V / 2**bits
    setpoint = converted(made, step * np.array([0.0, 0.499, -0.499, -0.501, 0.501]))
    up = 0.0 if bits == 1 else step  # of one bit, the codes are -1 and 0
    np.testing.assert_allclose(setpoint, [0, 0, 0, -step, up], rtol=4e-16)


@given(st.floats(-7.9997, 7.9997))
def test_within_the_range_rounding_is_at_most_half_a_step(command):
    setpoint = converted(dac_of(PLAIN, 1, 0), np.array([command]))[0]
    assert abs(setpoint - command) <= LSB_A / 2 * (1 + 1e-11)  # 1e-16 of 8 A is 4e-12 of half a step
    assert setpoint / LSB_A == pytest.approx(round(setpoint / LSB_A), abs=1e-10)


@given(st.floats(8.0, None, allow_infinity=True))
def test_beyond_the_range_is_its_end(command):
    setpoint = converted(dac_of(PLAIN, 2, 0), np.array([command, -command]))
    np.testing.assert_allclose(setpoint, [8.0 - LSB_A, -8.0], rtol=4e-16)


@given(st.lists(st.floats(allow_nan=False), min_size=GROUPS, max_size=GROUPS), st.integers(0, 2**63))
def test_any_number_gives_a_current_within_the_range_and_its_errors(command, seed):
    setpoint = converted(dac_of(PROTOTYPE, GROUPS, seed), np.array(command))
    most = GAIN_A_V * (RANGE_V * (1 + 1e-3) + 2e-3) + 4 * LSB_A
    assert np.all(np.abs(setpoint) <= most)  # and so is none that is not a number


def test_inl_is_smooth_keeps_to_its_bound_and_turns_no_code_back():
    made = dac_of(PROTOTYPE, GROUPS, 3)
    largest = []
    for channel in range(GROUPS):
        setpoint = curve(made, channel)
        straight = np.linspace(setpoint[0], setpoint[-1], len(setpoint))
        inl = (setpoint - straight) / LSB_A
        largest.append(np.abs(inl).max())
        assert np.all(np.diff(setpoint) > 0)
        # The third term is steepest: 4 LSB times 2 * 3 over half the codes. Rounding: 1e-15 A of 2.4e-4 A.
        assert np.abs(np.diff(inl)).max() <= 4 * 2 * 3 / 2**15 + 2e-11
    assert max(largest) <= 4.0 * (1 + 1e-3)  # in ideal steps, which the gain stretches
    assert min(largest) > 0.1


def test_a_command_may_be_converted_in_place_and_no_number_stays_none_in_its_channel():
    made, command = dac_of(PROTOTYPE, 3, 0), np.array([1.0, np.nan, 7.0])
    expected = converted(made, command)
    convert(made, command, command)
    np.testing.assert_array_equal(command, expected)
    np.testing.assert_array_equal(np.isnan(command), [False, True, False])


def test_one_error_moves_no_draw_of_another_and_each_seed_has_its_own():
    only, all_errors = (dac_of(kind, 18, 1) for kind in (OFFSET, PROTOTYPE))
    np.testing.assert_array_equal(only.offset_V, all_errors.offset_V)
    np.testing.assert_array_equal(only.gain, 1)
    assert np.all(dac_of(PROTOTYPE, 18, 2).offset_V != all_errors.offset_V)
