"""The governed reference: near time-optimal, within its acceleration, and true to what it can follow."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin.control.compensators.reference_governor import (
    Governor,
    GovernorSection,
    fill_governor,
    govern,
)

PERIOD_S = 1e-3
LARGEST = (2.0, 3.0, 5.0)


def made(acceleration=LARGEST, period_s=PERIOD_S):
    return Governor.filled(fill_governor, GovernorSection(acceleration_rad_s2=acceleration), period_s)[0]


def governed(desired, angle=(0.0, 0.0, 0.0), rate=(0.0, 0.0, 0.0), **of_governor):
    """Governed motion (n, 3, 3) along one desired, (n, 3, 3), from a measured angle and rate."""
    mine, measurement = made(**of_governor), np.array([angle, rate, (0.0, 0.0, 0.0)])
    motion = np.array(desired)
    for row in motion:
        assert govern(mine, measurement, row)
    return motion


def to_rest(angle, rate, ticks, **of_governor):
    return governed(np.zeros((ticks, 3, 3)), angle, rate, **of_governor)


def could_stop_within(periods, z, v):
    """Whether ``z+ = z + v, v+ = v + u`` with ``|u| <= 1`` can be brought to rest at 0 in some periods.

    What all u together move is a zonotope; a point is within it if it is so along the normal of every side.
    """
    pushes = np.stack([np.arange(periods)[::-1], np.ones(periods)], axis=1)
    normals = np.array([*np.stack([-pushes[:, 1], pushes[:, 0]], axis=1), (1.0, 0.0), (0.0, 1.0)])
    reach = np.abs(normals @ pushes.T).sum(axis=1)
    return bool(np.all(np.abs(normals @ [-(z + periods * v), -v]) <= reach + 1e-9))


@pytest.mark.parametrize("distance", [1.0, 2.0, 6.0, 7.5, 12.0, 100.0, 381.7])
def test_from_rest_to_rest_it_passes_its_target_by_a_thirteenth_of_a_period_s_move(distance):
    """By less than R h²/13, at and between the ticks; the time is that of any motion, below."""
    unit = np.array(LARGEST) * PERIOD_S**2
    motion = to_rest(distance * unit, np.zeros(3), 60)
    # Rest to rounding: a millionth of what a period moves.
    assert np.abs(motion[-1, :2] / [unit, unit / PERIOD_S]).max() < 1e-6
    angle, rate, push = motion[:, 0], motion[:, 1], motion[:, 2]
    turning = np.clip(-rate / np.where(push == 0, np.inf, push), 0, PERIOD_S)
    lowest = angle + rate * turning + push * turning**2 / 2
    assert (lowest / unit).min() > -1 / 13


@settings(max_examples=100)
@given(st.floats(-400, 400), st.floats(-15, 15))
def test_from_any_motion_it_takes_at_most_a_period_more_than_any_can(z, v):
    """Exact for z, the lead less half a period's rate, on which the discrete feedback acts."""
    h, largest = PERIOD_S, LARGEST[0]
    angle, rate = (z + v / 2) * largest * h * h, v * largest * h
    motion = to_rest((angle, 0.0, 0.0), (rate, 0.0, 0.0), 200)[:, :2, 0]
    moving = np.abs(motion / (largest * h * h, largest * h)).max(axis=1) > 1e-6
    periods = int(moving.sum())
    assert periods < 2 or not could_stop_within(periods - 2, z, v)


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1), st.floats(1e-2, 1e3))
def test_it_never_exceeds_its_acceleration_and_is_a_motion(seed, jumps):
    """Whatever is desired: each angle and rate follows from the last by the acceleration held between."""
    generator, h = np.random.default_rng(seed), PERIOD_S
    desired = jumps * generator.normal(size=(40, 3, 3)).repeat(5, axis=0)
    motion = governed(desired, generator.normal(size=3), generator.normal(size=3))
    assert (np.abs(motion[:, 2]) <= LARGEST).all()
    assert (np.abs(motion[:, 2]).max(axis=0) == LARGEST).all()
    angle, rate, push = motion[:-1, 0], motion[:-1, 1], motion[:-1, 2]
    # Three sums of numbers below 10.
    np.testing.assert_allclose(motion[1:, 1], rate + h * push, rtol=0, atol=1e-14)
    np.testing.assert_allclose(motion[1:, 0], angle + h * rate + h * h / 2 * push, rtol=0, atol=1e-14)


def test_what_is_within_its_acceleration_is_followed():
    """But for the change of acceleration within a period: of third order."""
    t = PERIOD_S * np.arange(3000)
    sines = np.stack([0.2 * np.sin(np.pi * t), 0.2 * np.pi * np.cos(np.pi * t)], axis=1)
    desired = np.repeat(np.append(sines, -(np.pi**2) * sines[:, :1], axis=1)[:, :, None], 3, axis=2)
    motion = governed(desired, desired[0, 0], desired[0, 1])
    jerk = 0.2 * np.pi**3
    behind = (motion - desired)[2:]
    # A period's change adds h³/12 of the jerk to z and -h²/2 to the rate; the feedback takes either to rest
    # in two periods. What is left at any tick is the last period's and what became of the one before.
    assert np.abs(behind[:, 0]).max() == pytest.approx(3 / 8 * jerk * PERIOD_S**3, rel=0.01)
    assert np.abs(behind[:, 1]).max() == pytest.approx(1 / 12 * jerk * PERIOD_S**2, rel=0.01)


def test_a_jump_of_rate_takes_the_time_of_the_exact_move():
    """From rest behind what moves away at w: (1 + √2) w / R, by the parabolas of the continuous optimum."""
    rate, largest = np.pi / 30, 5.0
    t = PERIOD_S * np.arange(200)
    desired = np.zeros((200, 3, 3))
    desired[:, 0], desired[:, 1] = rate * t[:, None], rate
    motion = governed(desired, acceleration=(largest,) * 3)
    apart = np.abs(motion[:, 0] - desired[:, 0]).max(axis=1) > 1e-12
    # Periods are whole, the feedback may take one more, and the last acceleration acts until the next tick.
    assert (1 + np.sqrt(2)) * rate / largest == pytest.approx(PERIOD_S * apart.sum(), abs=2.5 * PERIOD_S)
    # Farthest behind where it has just got the rate: w² / 2R, less than a period's part of it.
    behind = (desired[:, 0] - motion[:, 0]).max()
    assert behind == pytest.approx(rate**2 / (2 * largest), rel=0.05)


def test_non_finite_input_is_reported_and_resets_the_governor():
    for bad in (np.inf, np.nan):
        mine = made()
        assert not govern(mine, np.full((3, 3), bad), np.zeros((3, 3)))
        np.testing.assert_array_equal(mine.motion, 0.0)
        reference = np.zeros((3, 3))
        assert govern(mine, np.ones((3, 3)), reference)
        np.testing.assert_array_equal(reference[:2], 1.0)
