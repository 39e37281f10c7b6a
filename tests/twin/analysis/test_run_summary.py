"""Spectrum and work of a review against sinusoids and the engine's own kinematics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.analysis.run_summary import PEAKS, amplitudes, angular_velocity, mechanical_work_J, peaks
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.telemetry.signals import common_signals, width
from spheretwin.models.telemetry.table import Table

PERIOD_s = 1e-3


@given(st.floats(5.0, 450.0), st.floats(1e-6, 10.0), st.floats(0, 6.3))
def test_an_oscillation_between_the_lines_is_found(frequency_Hz, amplitude, phase):
    t = np.arange(4000) * PERIOD_s
    top = peaks(3.0 + amplitude * np.sin(2 * np.pi * frequency_Hz * t + phase), PERIOD_s)[0]
    # Its mirror image at negative frequencies leaks as the cube of the distance, at least 40 lines.
    assert top.frequency_Hz == pytest.approx(frequency_Hz, abs=1e-3)
    assert top.amplitude == pytest.approx(amplitude, rel=1e-3)


def test_the_strongest_come_first():
    t = np.arange(8000) * PERIOD_s
    strengths = {10.0: 0.1, 33.3: 1.0, 120.7: 0.5, 200.0: 0.01}
    values = sum(size * np.sin(2 * np.pi * frequency * t) for frequency, size in strengths.items())
    result = peaks(values, PERIOD_s)
    assert len(result) == PEAKS
    # Each leaks a little into the others; they are hundreds of lines apart.
    assert [peak.frequency_Hz for peak in result] == pytest.approx([33.3, 120.7, 10.0], abs=1e-3)
    assert [peak.amplitude for peak in result] == pytest.approx([1.0, 0.5, 0.1], rel=1e-3)


@pytest.mark.parametrize("values", [[], [1.0] * 15, [0.0] * 100, [np.nan] * 100])
def test_what_does_not_oscillate_has_no_peak(values):
    assert peaks(np.array(values), PERIOD_s) == []


def test_rates_are_those_of_the_kinematics():
    q, qdot = np.random.default_rng(0).uniform(-1, 1, size=(2, 50, 3))
    expected = [rate_jacobian(pose) @ rates for pose, rates in zip(q, qdot, strict=True)]
    # Sums of three products up to 1.
    np.testing.assert_allclose(angular_velocity(q, qdot), expected, rtol=0, atol=1e-15)


def test_work_is_torque_times_angle():
    """About the first hinge alone: a constant torque over a constant rate."""
    signals = common_signals(18)
    table = Table(signals, np.zeros((1000, width(signals))))
    table["torque_Nm"][:, 0], table["qdot_rad_s"][:, 0] = 0.3, 2.0
    # A sum of a thousand terms.
    assert mechanical_work_J(table, PERIOD_s) == pytest.approx(0.3 * 2.0 * 1.0, rel=1e-12)
    assert mechanical_work_J(table.rows(0, 0), PERIOD_s) is None


def test_a_spectrum_has_at_a_line_the_amplitude_of_what_oscillates_there():
    t = np.arange(2000) * PERIOD_s
    frequency_Hz, amplitude = amplitudes(0.3 * np.sin(2 * np.pi * 50 * t) + 7.0, PERIOD_s)
    assert len(frequency_Hz) == len(amplitude) == 1000
    assert frequency_Hz[99] == 50.0  # a whole number of lines
    # Hann's window keeps an oscillation on a line to rounding, and half of it on both beside.
    np.testing.assert_allclose(amplitude[98:101], [0.15, 0.3, 0.15], rtol=1e-12)
    assert amplitude[:90].max() < 1e-12


def test_what_is_too_short_or_has_gaps_has_no_spectrum():
    for values in ([0.0] * 15, [np.nan] * 100):
        assert [len(each) for each in amplitudes(np.array(values), PERIOD_s)] == [0, 0]
