"""The way to a shape from another motion: it begins with the one, ends with the other, and does not jump."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.simulation import simulate
from spheretwin.trajectories.rounding import ACCELERATION_FADE_s, Approach
from spheretwin.trajectories.shapes import Hold, Jog, Nutation, Sinusoid

STEP = 1e-5
BEGUN = {"angle_rad": (0.1, -0.2, 3.0), "rate_rad_s": (0.5, 0.0, -1.0)}
BEGUN |= {"acceleration_rad_s2": (2.0, -3.0, 0.5)}
SHAPES = (Sinusoid, Nutation, Hold, Jog)


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("rounding", [None, 20.0])
@pytest.mark.parametrize("shape_s", [0.0, 1.3])
def test_it_begins_with_the_one_motion_and_ends_with_the_other(kind, rounding, shape_s):
    way = Approach(start_s=2.0, lasts_s=0.8, shape_s=shape_s, **BEGUN)
    shape, alone = kind(rounding_rad_s2=rounding, approach=way), kind(approach=Approach())
    start, earlier = shape.sample(np.array([2.0, 0.5]))
    np.testing.assert_allclose(start, list(BEGUN.values()), rtol=1e-14, atol=1e-14)
    np.testing.assert_array_equal(earlier, [BEGUN["angle_rad"], np.zeros(3), np.zeros(3)])
    after = np.linspace(2.8 + 1e-9, 4.0, 50)
    if rounding is None:
        assert shape.sample(after).tobytes() == alone.sharp(after - 2.0 + shape_s).tobytes()
    else:
        expected = shape.sample_after_approach(shape_s + (after - 2.0))
        np.testing.assert_array_equal(shape.sample(after), expected)


@pytest.mark.parametrize("kind", SHAPES)
def test_rates_and_accelerations_are_derivatives_and_nothing_jumps(kind):
    shape = kind(approach=Approach(start_s=0.5, lasts_s=0.9, **BEGUN))
    # A step of the difference beside where a polynomial begins or ends would mix the two.
    t = np.linspace(0.5 + 2 * STEP, 2.0, 400)
    t = t[np.abs(t - 0.5 - ACCELERATION_FADE_s) > 2 * STEP]
    before, now, after = (shape.sample(t + h) for h in (-STEP, 0, STEP))
    # Central differences: h² times a sixth of third derivatives below 1e5, and rounding of 3 rad over h.
    np.testing.assert_allclose(now[:, 1], (after - before)[:, 0] / (2 * STEP), atol=2e-6)
    np.testing.assert_allclose(now[:, 2], (after - before)[:, 1] / (2 * STEP), atol=2e-6)
    fine = shape.sample(np.arange(0.5, 2.0, 1e-4))
    # The jerk is at most 9 times the difference of accelerations over a tenth of a second.
    largest = np.abs(fine[:, 2]).max()
    assert np.abs(np.diff(fine[:, 2], axis=0)).max() < 1e-4 * 20 * largest / ACCELERATION_FADE_s


def test_a_scenario_names_it_and_begins_where_it_does():
    fields = {"start_s": 0.02, "lasts_s": 0.1, "angle_rad": [0.1, 0.0, 0.0]}
    scenario = scenarios.load("sinusoid", {"trajectory.approach": fields, "duration": 0.05})
    run = simulate(scenario)
    np.testing.assert_array_equal(run.scenario.plant.initial_rad, [0.1, 0.0, 0.0])
    np.testing.assert_array_equal(run.telemetry["q_ref_rad"][:20], np.tile([0.1, 0, 0], (20, 1)))


def test_jogging_turns_until_the_edge():
    shape = Jog(start_rad=(0.1, -0.2, 0.0), rate_rad_s=(0.5, -0.25, 2.0), farthest_rad=1.0)
    ends = np.array([0.9 / 0.5, 0.8 / 0.25])
    samples = shape.sample(np.array([1.0, *ends, 10.0]))
    np.testing.assert_allclose(samples[0, 0], [0.6, -0.45, 2.0], rtol=1e-15)
    np.testing.assert_allclose(samples[-1, 0], [1.0, -1.0, 20.0], rtol=1e-15)
    np.testing.assert_array_equal(samples[-1, 1], [0.0, 0.0, 2.0])
    np.testing.assert_allclose(shape.corners().t_s, ends, rtol=1e-15)
    for rate, reached in ((0.5, 1.2), (-0.5, 0.7)):  # from beyond the edge, back alone
        jog = Jog(start_rad=(1.2, 0.0, 0.0), rate_rad_s=(rate, 0.0, 0.0), farthest_rad=1.0)
        np.testing.assert_allclose(jog.sample(np.array([0.0, 1.0]))[:, 0, 0], [1.2, reached], rtol=1e-15)
