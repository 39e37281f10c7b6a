"""Potentiometer: a line with ends, a residual of stated size and shape, and play of the wiper."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin import scenario as scenarios
from spheretwin.electronics.random_streams import noise_table
from spheretwin.electronics.sensor_chain import SensorsSection
from spheretwin.electronics.stages import SensorSetup
from spheretwin.electronics.transducers import (
    HARMONICS,
    LARGEST_SHARE,
    Potentiometer,
    Potentiometers,
    PotentiometerSection,
    fill_potentiometers,
    wiper_angle,
    wiper_voltage,
)
from spheretwin.simulation import simulate

HALF_rad = np.radians(150)
FINITE = st.floats(allow_nan=False, allow_infinity=False)


def track_of(seed=0, **fields):
    section = PotentiometerSection(**fields)
    shares = np.random.default_rng([seed, 1, 0]).random(4)
    return Potentiometer.filled(fill_potentiometers, section, shares)[0]


def residual(track, angles):
    """What the voltage is off the line by, rad."""
    volts = np.array([wiper_voltage(track, angle) for angle in angles])
    return volts / track.volts_per_rad - angles


@given(FINITE | st.floats(-3, 3), st.sampled_from([HALF_rad, 0.75]), st.sampled_from([2.5, 6.0]))
def test_a_track_without_residual_is_a_line_with_ends(angle, half_rad, half_V):
    volts = wiper_voltage(track_of(electrical_angle_rad=2 * half_rad, supply_V=2 * half_V), angle)
    if abs(angle) >= half_rad:
        assert volts == np.copysign(half_V, angle)
    else:
        # One product; near the end it may round up to the supply, not beyond.
        assert volts == pytest.approx(angle * half_V / half_rad, rel=1e-15, abs=5e-324)
        assert abs(volts) <= half_V


def test_ends_hold_infinity_and_nothing_makes_a_number_of_none():
    track = track_of(nonlinearity_rad=0.02)
    assert [wiper_voltage(track, angle) for angle in (np.inf, -np.inf)] == [
        wiper_voltage(track, angle) for angle in (HALF_rad, -HALF_rad)
    ]
    assert np.isnan(wiper_voltage(track, np.nan))


@pytest.mark.parametrize("seed", range(20))
def test_residual_is_four_harmonics_of_the_track_and_its_peak_is_the_stated_one(seed):
    bound, samples, half_rad = 0.01, 4096, HALF_rad if seed % 2 else 0.75
    # A supply far above what is reached: else the ends would cut the residual off.
    fields = {"nonlinearity_rad": bound, "electrical_angle_rad": 2 * half_rad}
    track = track_of(seed, **fields)
    track.half_supply_V = 1e3
    angles = half_rad * (2 * np.arange(samples) / samples - 1)
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
    track = track_of(seed, nonlinearity_rad=largest)
    track.half_supply_V = 1e3
    volts = [wiper_voltage(track, angle) for angle in np.linspace(-HALF_rad, HALF_rad, 1001)]
    assert np.diff(volts).min() > 0


WIDTH, SPREAD = 4e-3, 1e-3


def made(hysteresis=WIDTH, repeatability=SPREAD):
    section = PotentiometerSection(hysteresis_rad=hysteresis, repeatability_rad=repeatability)
    setup = SensorSetup(SensorsSection(), 0, "potentiometer", first_draw=0, end_draw=0, faults=False)
    return Potentiometers.filled(section.fill, setup)[0]


def followed(stage, angles, draws):
    return np.array([wiper_angle(stage, 0, angle, draw) for angle, draw in zip(angles, draws, strict=True)])


def approaches(count, side):
    """Angles that go to 0 again and again from one side, by way of 0.1 rad on this side."""
    away = side * np.linspace(0, 0.1, 7)
    return np.tile(np.concatenate([away, away[::-1]]), count)


def slow_wiper(angles, numbers, half, spread):
    """Wiper that two stops of the joint push; a stop moves when the wiper begins to move the other way."""
    wiper, direction, stops, path = angles[0], 0, {1: half, -1: half}, []
    for angle, number in zip(angles, numbers, strict=True):
        for way in (1, -1):
            if way * (angle - wiper) > stops[way]:
                wiper = angle - way * stops[way]
                if direction != way:
                    direction = way
                    stops[-way] = half + spread * np.clip(number / 3, -1, 1)
        path.append(wiper)
    return np.array(path)


@given(st.lists(st.floats(-0.02, 0.02), min_size=2, max_size=60), st.integers(0, 99))
def test_wiper_is_its_slow_copy_and_never_jumps(steps, seed):
    angles = np.cumsum(steps)
    numbers = np.random.default_rng(seed).normal(size=(len(angles), 2))
    wiper = followed(made(), angles, numbers)
    # Sums of angles of 1 rad.
    np.testing.assert_allclose(
        wiper, slow_wiper(angles, numbers[:, 0], WIDTH / 2, SPREAD), rtol=0, atol=1e-15
    )
    assert np.all(np.abs(np.diff(wiper)) <= np.abs(np.diff(angles)) + 1e-15)


def test_hysteresis_is_the_difference_of_readings_from_both_sides():
    stage, none = made(repeatability=0.0), np.zeros((42, 0))
    below, above = (followed(stage, approaches(3, side), none)[-1] for side in (-1, 1))
    assert above - below == pytest.approx(WIDTH, rel=1e-12)
    assert above == pytest.approx(WIDTH / 2, rel=1e-12)
    assert stage.lead_rad[0] == above  # the joint is at 0


def test_wiper_starts_at_the_joint_and_nan_stays_nan():
    stage, none = made(repeatability=0.0), np.zeros(0)
    assert wiper_angle(stage, 0, 0.3, none) == 0.3
    assert np.isnan(wiper_angle(stage, 0, np.nan, none))


def test_telemetry_has_the_lead_of_the_wiper():
    fields = {
        "sensors.potentiometer.hysteresis_rad": WIDTH,
        "sensors.potentiometer.repeatability_rad": SPREAD,
        "duration": 0.15,
    }
    first = simulate(scenarios.load("nutation", {"hardware": "electronics", **fields})).telemetry
    numbers = noise_table(0, 0, 150, (("sensors.potentiometer noise", 2),))
    for channel in range(2):
        q = first["q_rad"][:, channel]
        expected = slow_wiper(q, numbers[:, channel], WIDTH / 2, SPREAD) - q
        np.testing.assert_allclose(first["sensor_state_error_rad"][:, channel], expected, rtol=0, atol=1e-15)
    assert np.abs(first["sensor_state_error_rad"][:, 0]).max() > WIDTH / 4
    np.testing.assert_array_equal(first["sensor_state_error_rad"][:, 2], 0)
