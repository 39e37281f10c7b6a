"""Figure of frequency responses: what is drawn is what was measured, without zeros that rounding fills."""

import numpy as np
import pytest

from spheretwin.viz.figures.frequency_response import bode

FREQUENCY_Hz = np.array([1.0, 10.0, 100.0, 500.0])


def test_lines_and_markers_have_gain_and_phase_and_a_zero_is_left_out():
    linear = np.array([10.0, 1.0, -0.1j, -0.01])
    measured = np.array([10.0, 1.0, -0.1j, 1e-12 + 0j])  # no gain at half of the sampling rate
    figure = bode({"pid": (FREQUENCY_Hz, measured, linear)}, {"pid": "PID"}, "loop")
    gain, phase = ([curve.get_ydata() for curve in axes.lines[:2]] for axes in figure.axes)
    assert gain[0] == pytest.approx([20.0, 0.0, -20.0, -40.0])
    assert gain[1] == pytest.approx([20.0, 0.0, -20.0, np.nan], nan_ok=True)
    assert np.diff(phase[0]) == pytest.approx([0.0, -90.0, -90.0])
    assert np.isnan(phase[1]).tolist() == [False, False, False, True]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "PID",
        "linear model of the sampled loop",
        "measured",
    ]
