"""Encoder: the nearest line of a grid over any turns, eccentricity and index; skew of the converter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin import scenario as scenarios
from spheretwin.electronics.sensor_chain import SensorChain, SensorsSection, fill_sensors, sense
from spheretwin.electronics.stages import SensorSetup
from spheretwin.electronics.transducers import Encoder, EncoderSection, counted
from spheretwin.simulation import simulate

COUNTS = st.integers(1, 2**20)


def sensors_of(section, seed):
    return SensorChain.filled(fill_sensors, section, seed, delays=8)[0]


def encoder_of(counts):
    setup = SensorSetup(None, 0, "encoder", first_draw=0, end_draw=0, faults=False)
    return Encoder.filled(EncoderSection(counts=counts).fill, setup)[0]


@given(st.floats())
def test_without_counts_the_bits_are_the_same(angle):
    got = counted(encoder_of(0), angle)
    assert np.float64(got).tobytes() == np.float64(angle).tobytes() or np.isnan(angle) & np.isnan(got)


@given(st.floats(-1e4, 1e4), COUNTS)
def test_the_line_is_the_nearest(angle, counts):
    line = 2 * np.pi / counts
    got = counted(encoder_of(counts), angle)
    # Products of the angle round to 2⁻⁵³ of it, three of them.
    assert abs(got - angle) <= line / 2 + 4e-16 * abs(angle)
    assert got / line == pytest.approx(round(got / line), rel=1e-15)


@given(st.integers(-(10**7), 10**7), st.integers(0, 1999), st.floats(-0.49, 0.49))
def test_a_count_is_exact_over_ten_million_turns(turns, place, inside):
    # At 1.3e11 radians of counts the angle itself rounds to 4e-6 of a line.
    line, count = 2 * np.pi / 2000, turns * 2000 + place
    assert counted(encoder_of(2000), (count + inside) * line) == count * line


def test_none_stays_none_and_the_endless_endless():
    assert np.isnan(counted(encoder_of(2000), np.nan))
    assert counted(encoder_of(2000), np.inf) == np.inf
    assert counted(encoder_of(2000), -1e308) == -np.inf
    assert counted(encoder_of(2000), 5e-324) == 0


LINE = 2 * np.pi / 2000


def measured(q, seed=0, rates=None, **section):
    """Measured angles (n, 3) at poses (n, 3)."""
    chain, row, angles = (
        sensors_of(SensorsSection(**section), seed),
        np.empty((3, 3)),
        [],
    )
    for pose, rate in zip(q, np.zeros_like(q) if rates is None else rates, strict=True):
        sense(chain, pose, rate, np.zeros(8), np.zeros(0), row)
        angles.append(row[0].copy())
    return np.array(angles)


def spun(angles, seed=0, **encoder):
    """Measured angle of hinge γ alone."""
    q = np.stack([0 * angles, 0 * angles, angles], axis=1)
    return measured(q, seed, encoder=encoder)[:, 2]


@pytest.mark.parametrize("seed", range(5))
def test_eccentricity_is_one_harmonic_of_the_turn(seed):
    turn = 2 * np.pi * np.arange(256) / 256
    error = spun(turn, seed, eccentricity_rad=2e-3) - turn
    spectrum = np.fft.fft(error) / 256
    assert 2 * abs(spectrum[1]) == pytest.approx(2e-3, rel=1e-12)
    assert np.abs(np.delete(spectrum, [1, 255])).max() < 1e-15  # rounding of angles of 6 rad
    over = spun(turn + 6 * np.pi, seed, eccentricity_rad=2e-3) - turn - 6 * np.pi
    np.testing.assert_allclose(over, error, rtol=0, atol=1e-14)


def test_phase_of_the_eccentricity_belongs_to_the_seed_and_counts_round_after_it():
    turn, phases = np.linspace(0, 7, 200), []
    for seed in range(50):
        error = spun(turn, seed, eccentricity_rad=0.01) - turn
        phases.append(np.angle(np.exp(-1j * turn) @ error))
        lines = spun(turn, seed, eccentricity_rad=0.01, counts=2000)
        np.testing.assert_allclose(lines, np.rint((turn + error) / LINE) * LINE, rtol=0, atol=1e-12)
    # 50 phases leave a quarter of the turn empty with a probability of 50 * 0.75**49, 4e-5.
    assert np.diff(np.sort(phases)).max() < np.pi / 2


def slow_count(angles, start, index, counts=2000):
    """Counter that is set right at the index: at its line, or between two ticks on either side of it."""
    lines, error, readings = np.rint(angles * counts / (2 * np.pi)).astype(int), start, []
    index_line = round(index * counts / (2 * np.pi))
    for place, line in enumerate(lines):
        first = line if place == 0 else lines[place - 1]
        passed = range(min(first, line), max(first, line) + 1)
        if any((position - index_line) % counts == 0 for position in passed):
            error = 0
        readings.append(line + error)
    return np.array(readings) * 2 * np.pi / counts


@given(
    st.lists(st.floats(-1.5, 1.5), min_size=1, max_size=40), st.floats(-np.pi, np.pi), st.integers(0, 1000)
)
def test_count_is_wrong_by_a_constant_until_the_index_passes(steps, index, seed):
    angles = 0.37 + np.cumsum(steps)
    section = {"counts": 2000, "start_error_rad": 0.2, "index_rad": index}
    start = spun(np.array([index + 1.0]), seed, **section)[0] - index - 1.0
    expected = slow_count(angles, round(start / LINE), index)
    np.testing.assert_allclose(spun(angles, seed, **section), expected, rtol=0, atol=1e-12)


def test_error_of_the_start_fills_its_bound_and_counters_differ():
    section = {"counts": 2000, "start_error_rad": 0.5}
    errors = [spun(np.array([1.0]), seed, **section)[0] - 1.0 for seed in range(200)]
    assert np.abs(errors).max() <= 0.5 + LINE  # half a line each of the error and of the count
    # Uniform: 200 numbers all miss the outer tenth on one side with a probability of 0.95**200, 4e-5.
    assert max(errors) > 0.45
    assert min(errors) < -0.45


def test_telemetry_shows_the_error_until_the_index():
    fields = {
        "hardware": "electronics",
        "sensors.encoder.start_error_rad": 0.05,
        "sensors.encoder.index_rad": 0.1,
        "seed": 3,
        "duration": 1.52,
    }
    table = simulate(scenarios.load("sinusoid", fields)).telemetry
    error, gamma = table["sensor_state_error_rad"][:, 2], table["q_rad"][:, 2]
    passed = int(np.argmax(gamma > 0.1 - LINE / 2))
    assert passed > 0
    assert abs(error[0]) > LINE
    np.testing.assert_array_equal(error[:passed], error[0])
    np.testing.assert_array_equal(error[passed + 1 :], 0)
    # The reading is the count next to the angle, plus the error.
    off = table["q_measured_rad"][:, 2] - gamma - error
    assert np.abs(off).max() <= LINE / 2 * (1 + 1e-9)


def test_skew_samples_beta_later_to_first_order():
    skew, size, w = 2e-4, 0.3, 20.0
    t = np.arange(0, 1, 1e-3)

    def motion(times):
        return size * np.sin(w * times + 0.4)

    q = np.stack([motion(t)] * 3, axis=1)
    rates = np.stack([size * w * np.cos(w * t + 0.4)] * 3, axis=1)
    got = measured(q, rates=rates, adc={"skew_s": skew})
    bound = size * w**2 * skew**2 / 2
    error = np.abs(got[:, 1] - motion(t + skew))
    assert 0.99 * bound < error.max() <= bound + 1e-15
    assert np.abs(got[:, 1] - q[:, 1]).max() == pytest.approx(size * w * skew, rel=1e-3)
    np.testing.assert_allclose(got[:, 0], q[:, 0], rtol=0, atol=1e-15)  # to volts and back
    np.testing.assert_array_equal(got[:, 2], q[:, 2])
