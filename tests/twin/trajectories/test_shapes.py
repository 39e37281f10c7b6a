"""Shapes: each held to its exact solution, and its own refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from spheretwin.trajectories.shapes import Chirp, Component, Hold, Multisine, Nutation, Sinusoid, Steps, Tilt

# --- exact solutions


def test_nutation_is_equation_59():
    t = np.array([0.0, 1.25, 5.0])
    expected = np.stack([0.2 * np.sin(np.pi * t), 0.2 * t * np.cos(np.pi * t), 2 * np.pi * t], axis=1)
    np.testing.assert_allclose(Nutation().sample(t)[:, 0], expected, atol=1e-15)
    assert abs(Nutation().sample(np.array([5.0]))[0, 0, 1]) == pytest.approx(1.0)  # beta ends at 1 rad


def test_tilt_is_equation_60():
    t = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
    expected = np.pi / 30 * np.array([0, 1, 2, 2, 2, 1, 0, 0])
    samples = Tilt().sample(t)
    np.testing.assert_allclose(samples[:, 0, 0], expected, atol=1e-15)
    np.testing.assert_allclose(samples[:, 1, 0], np.pi / 30 * np.array([1, 1, 0, 0, -1, -1, 0, 0]))
    np.testing.assert_array_equal(samples[:, :, 1:], 0)


SWEEPS = st.builds(
    Chirp,
    start_frequency_Hz=st.floats(0.01, 20),
    end_frequency_Hz=st.floats(0.01, 20),
    sweep_s=st.floats(0.1, 20),
    sweep=st.sampled_from(["linear", "exponential"]),
)


@given(SWEEPS)
def test_chirp_is_scipy_s_within_its_sweep(chirp):
    t = np.linspace(0, chirp.sweep_s, 200)[:-1]
    method = {"linear": "linear", "exponential": "logarithmic"}[chirp.sweep]
    first, last = chirp.start_frequency_Hz, chirp.end_frequency_Hz
    expected = 0.1 * signal.chirp(t, first, chirp.sweep_s, last, method=method, phi=-90)
    # The phase is below 2,600 rad and known to a few units in its last place; scipy's formula for equal
    # ratios divides by their logarithm, which loses what ratio and 1 have in common.
    lost = 1e-11 if chirp.sweep == "linear" else 1e-11 / min(1.0, abs(np.log(last / first)) + 1e-12)
    np.testing.assert_allclose(chirp.sample(t)[:, 0, 0], expected, atol=lost)


@given(SWEEPS)
def test_chirp_goes_on_where_its_sweep_ends(chirp):
    end, w = chirp.sweep_s, 2 * np.pi * chirp.end_frequency_Hz
    before, after = chirp.sample(np.array([end * (1 - 1e-9), end]))
    # Angle and rate change by at most rate and acceleration in a billionth of the sweep, 20 ns: below
    # 13 rad/s and, with the sweep of 20 Hz in 0.1 s, below 1.6e3 + 8e2 rad/s².
    np.testing.assert_allclose(before[:2], after[:2], atol=5e-5 * 1.1)
    t = end + np.linspace(0, 3, 50)
    beyond = chirp.sample(t)[:, :, 0]
    # A plain sine from there on, told from angle and rate at its start.
    phase = w * (t - end)
    expected = after[0, 0] * np.cos(phase) + after[1, 0] / w * np.sin(phase)
    np.testing.assert_allclose(beyond[:, 0], expected, atol=1e-11)  # phases below 3,000 rad
    np.testing.assert_allclose(beyond[:, 2], -(w**2) * expected, atol=1e-11 * w**2)


def test_multisine_of_one_is_a_sinusoid_about_its_offset():
    t = np.linspace(0, 10, 1001)
    one = Multisine(
        offset_rad=(0.1, 0.2, 0.3),
        components=(Component(amplitude_rad=(0.2, 0.2, 0.2), frequency_Hz=(0.5, 0.5, 0.5)),),
    )
    about = Hold(angle_rad=(0.1, 0.2, 0.3))
    expected = Sinusoid().sample(t) + about.sample(t)
    np.testing.assert_allclose(one.sample(t), expected, atol=4e-15)  # products in another order, w² = 10


def test_multisine_s_sines_add_with_a_phase_each():
    first = Component(amplitude_rad=(0.1, 0.2, 0.3), frequency_Hz=(1.0, 2.0, 3.0), phase_rad=(0.0, 1.0, -1.0))
    second = Component(amplitude_rad=(0.3, 0.1, 0.2), frequency_Hz=(5.0, 0.0, 0.5), phase_rad=(2.0, 0.5, 0.0))
    t = np.linspace(0, 3, 301)
    both, *alone = (
        Multisine(components=components).sample(t) for components in ((first, second), (first,), (second,))
    )
    np.testing.assert_allclose(both, sum(alone), atol=1e-13)  # accelerations up to 300 rad/s²
    np.testing.assert_allclose(alone[1][:, 0, 1], 0.1 * np.sin(0.5), atol=1e-16)  # no frequency: a constant


def test_steps_hold_each_pose_from_its_time_on():
    steps = Steps(
        start_rad=(0.5, 0.0, 0.0), times_s=(1.0, 2.5), angles_rad=((0.1, 0.2, 0.3), (0.0, 0.0, 0.0))
    )
    samples = steps.sample(np.array([0.0, 0.999, 1.0, 2.499, 2.5, 100.0]))
    expected = [[0.5, 0, 0], [0.5, 0, 0], [0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [0, 0, 0], [0, 0, 0]]
    np.testing.assert_array_equal(samples[:, 0], expected)
    np.testing.assert_array_equal(samples[:, 1:], 0.0)


# Periods and ticks whose product falls short of the decimal fraction by its rounding.
@pytest.mark.parametrize(("period", "tick", "time"), [(7e-4, 17, 0.0119), (7e-4, 25, 0.0175)])
def test_a_tick_whose_time_is_rounded_down_still_reaches_the_step(period, tick, time):
    t = period * np.array([tick - 1.0, tick])
    assert t[1] < time
    steps = Steps(times_s=(time,), angles_rad=((1.0, 1.0, 1.0),))
    np.testing.assert_array_equal(steps.sample(t)[:, 0, 0], [0.0, 1.0])


# --- from a file to a run
