"""Frequency response of loops: measured next to linear, and margins next to python-control."""

import numpy as np
import pytest

import control
from spheretwin import scenario as scenarios
from spheretwin.paper import frequency_response as responses
from spheretwin.paper.frequency_response import LINES_Hz, OpenLoop, linear_loop, margins, measured
from spheretwin.simulation import simulate

PERIOD_s = 1e-3


def loop_of(law):
    return scenarios.load("hold", {**responses.fields(), "controller.law": law})


@pytest.mark.release("9 s of plain Python; test_linear_closed_loop.py has the linear loop")
@pytest.mark.uncompiled
@pytest.mark.parametrize("law", ["pid", "afsm_eso"])
def test_the_measured_response_is_that_of_the_linear_loop(law):
    scenario = loop_of(law)
    response = measured(simulate(scenario).telemetry, PERIOD_s)
    linear = linear_loop(scenario).response(LINES_Hz)
    # The rotor turns by 1e-4 rad, so that its products of rates are below 1e-4 of the torque; the differences
    # of the law are rounded to 1e-9 of its gains. At half of the rate the response of AFSM-ESO vanishes.
    scale = np.maximum(np.abs(linear), 1e-3)
    np.testing.assert_array_less(np.abs(response - linear), 2e-3 * scale)


def test_margins_are_those_of_python_control():
    scenario = loop_of("pid")
    frequency_Hz = np.geomspace(1, 500, 3000)
    response = linear_loop(scenario).response(frequency_Hz)
    data = control.FrequencyResponseData(response, 2 * np.pi * frequency_Hz, smooth=True)
    _, phase_deg, _, _, crossover, _ = control.stability_margins(data)
    ours = margins(frequency_Hz, response)
    # Linear interpolation of 3000 lines next to a spline through them.
    assert ours.phase_deg == pytest.approx(phase_deg, abs=0.01)
    assert ours.crossover_Hz == pytest.approx(crossover / (2 * np.pi), rel=1e-4)


def test_the_gain_margin_is_the_gain_at_which_the_closed_loop_becomes_unstable():
    loop = linear_loop(loop_of("pid"))
    factor = 10 ** (margins(LINES_Hz, loop.response(LINES_Hz)).gain_dB / 20)

    def largest_pole(gain):
        closed = loop.A + gain * np.outer(loop.b, loop.c)
        return np.abs(np.linalg.eigvals(closed)).max()

    # The lines are 10 % apart; the margin of this loop is at half of the control rate, which is a line.
    assert largest_pole(0.999 * factor) < 1 + 1e-9
    assert largest_pole(1.001 * factor) > 1 + 1e-6


def test_a_double_integrator_behind_a_hold_has_its_known_response():
    T = PERIOD_s
    loop = OpenLoop(np.array([[1, T], [0, 1]]), np.array([T**2 / 2, T]), -np.array([100.0, 10.0]), T)
    z = np.exp(2j * np.pi * T * np.array([5.0, 50.0]))
    expected = 100 * T**2 / 2 * (z + 1) / (z - 1) ** 2 + 10 * T / (z - 1)
    # Two solutions of two equations.
    np.testing.assert_allclose(loop.response([5.0, 50.0]), expected, rtol=1e-9)


def test_a_response_without_a_crossing_has_no_margins():
    assert np.isnan(margins([1.0, 2.0, 3.0], np.full(3, 0.1 + 0j))).all()
