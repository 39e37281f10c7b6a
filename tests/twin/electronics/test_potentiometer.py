"""The potentiometer against its definition: a line with ends, and a residual of stated size and shape."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from spheretwin.electronics.transducers import (
    HARMONICS,
    LARGEST_SHARE,
    PotentiometerSection,
    potentiometer,
    wiper_voltage,
)

HALF_rad = np.radians(150)
FINITE = st.floats(allow_nan=False, allow_infinity=False)


def made(seed=0, **fields):
    section = PotentiometerSection(**fields)
    return potentiometer(section, np.random.default_rng([seed, 1, 0]).random(4))


def residual(track, angles):
    """What the voltage is off the line by, rad."""
    volts = np.array([wiper_voltage(track, angle) for angle in angles])
    return volts / track.volts_per_rad - angles


@given(FINITE)
def test_a_track_without_residual_is_a_line_with_ends(angle):
    volts = wiper_voltage(made(), angle)
    if abs(angle) >= HALF_rad:
        assert volts == np.copysign(2.5, angle)
    else:
        # One product; near the end it may round up to the supply, not beyond.
        assert volts == pytest.approx(angle * 2.5 / HALF_rad, rel=1e-15, abs=5e-324)
        assert abs(volts) <= 2.5


def test_ends_hold_infinity_and_nothing_makes_a_number_of_none():
    track = made(nonlinearity_rad=0.02)
    assert [wiper_voltage(track, angle) for angle in (np.inf, -np.inf)] == [
        wiper_voltage(track, angle) for angle in (HALF_rad, -HALF_rad)
    ]
    assert np.isnan(wiper_voltage(track, np.nan))


@pytest.mark.parametrize("seed", range(20))
def test_residual_is_four_harmonics_of_the_track_and_its_peak_is_the_stated_one(seed):
    bound, samples = 0.01, 4096
    # A supply far above what is reached: else the ends would cut the residual off.
    track = made(seed, nonlinearity_rad=bound)._replace(half_supply_V=1e3)
    angles = HALF_rad * (2 * np.arange(samples) / samples - 1)
    off = residual(track, angles)
    # Between samples a peak rises above both by at most half its curvature times (π/4096)²; the curvature is
    # at most Σ k²/k² = 4 over a peak of at least π/4.
    miss = 0.5 * 4 / (np.pi / 4) * (np.pi / samples) ** 2
    assert bound * (1 - miss) <= np.abs(off).max() <= bound * (1 + 1e-12)
    spectrum = np.abs(np.fft.rfft(off)) / (samples / 2)
    sizes = spectrum[1] / np.arange(1, HARMONICS + 1) ** 2
    # Rounding of angles of 3 rad, over 4096 samples.
    np.testing.assert_allclose(spectrum[1 : HARMONICS + 1], sizes, rtol=0, atol=1e-15)
    np.testing.assert_allclose(np.delete(spectrum, range(1, HARMONICS + 1)), 0, atol=1e-15)


@pytest.mark.parametrize("seed", range(50))
def test_the_voltage_rises_with_the_angle_at_the_largest_residual(seed):
    largest = LARGEST_SHARE * 2 * HALF_rad * (1 - 1e-12)
    track = made(seed, nonlinearity_rad=largest)._replace(half_supply_V=1e3)
    volts = [wiper_voltage(track, angle) for angle in np.linspace(-HALF_rad, HALF_rad, 1001)]
    assert np.diff(volts).min() > 0


def test_a_residual_with_which_it_might_not_rise_is_refused():
    message = "expected nonlinearity_rad below 0.06 rad, 6% of electrical_angle_rad.* received 0.07"
    with pytest.raises(ValidationError, match=message):
        PotentiometerSection(electrical_angle_rad=1.0, nonlinearity_rad=0.07)


def test_the_residual_is_the_channel_s_own_and_keeps_its_shape_at_any_size():
    angles = np.linspace(-1, 1, 9)
    first = residual(made(1, nonlinearity_rad=0.01), angles)
    np.testing.assert_array_equal(residual(made(1, nonlinearity_rad=0.01), angles), first)
    # The same shape at another size, to the rounding of angles of 1 rad.
    np.testing.assert_allclose(residual(made(1, nonlinearity_rad=0.02), angles), 2 * first, atol=1e-15)
    assert np.abs(residual(made(2, nonlinearity_rad=0.01), angles) - first).max() > 1e-3
