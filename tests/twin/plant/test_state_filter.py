"""Extended Kalman filter: against a slow copy, truncated normal distribution, coverage of its bands."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from spheretwin import plant
from spheretwin.plant.state_filter import Estimates, StateFilter, _truncated, run_filter

PARAMETERS = plant.parameters("nutation", {"plant.coulomb_Nm": [2e-3] * 3, "plant.payload_kg": 0.05})
NOISE_rad, PERIOD_s = 3.5e-4, 1e-3


def new_filter(states=9, half_count_rad=0.0, torque_noise_Nm_s=3e-4):
    return StateFilter(
        mean=np.zeros(states),
        covariance=np.diag(np.repeat([1e-2, 1.0, 1e-2, 1e-4], 3)[:states]),
        noise_rad=np.full(3, NOISE_rad),
        half_count_rad=np.array([0.0, 0.0, half_count_rad]),
        density=np.repeat([0.0, 0.0, 1e-4, 1e-6], 3)[:states],
        torque_noise_Nm_s=torque_noise_Nm_s,
        longest_step_s=PERIOD_s,
        slopes=np.zeros((states, states)),
        product=np.zeros((states, states)),
    )


def new_estimates(rows, states=9):
    return Estimates(*(np.empty((rows, width)) for width in (states, states, 3, 3)))


def motion(rows, generator, disturbance=(0.01, -0.02, 0.005)):
    """Times, currents, true states and noisy angles of a plant under random currents that change slowly."""
    current = np.cumsum(generator.normal(0, 0.05, (rows, 18)), axis=0)
    state, states = plant.State(np.zeros(3), np.zeros(3)), []
    for k in range(rows):
        state = plant.step(state, current[k], np.array(disturbance), PARAMETERS, PERIOD_s)
        states.append(np.concatenate([*state, disturbance]))
    angles = np.array(states)[:, :3] + generator.normal(0, NOISE_rad, (rows, 3))
    return PERIOD_s * np.arange(rows + 1), current, np.array(states), angles


def slopes(mean, current):
    """Slopes of the step by central differences."""

    def moved(x):
        end = plant.step(plant.State(x[:3], x[3:6]), current, x[6:9], PARAMETERS, PERIOD_s)
        return np.concatenate([*end, x[6:]])

    step = 1e-5 * np.eye(len(mean))
    return np.stack([(moved(mean + d) - moved(mean - d)) / 2e-5 for d in step], axis=1), moved(mean)


@pytest.mark.parametrize("states", [9, 12])
def test_it_is_the_textbook_filter(states):
    """Matrices with all channels at once, a solved gain, and Joseph's form, in NumPy."""
    edges, current, _, angles = motion(60, np.random.default_rng(states))
    filter, estimates = new_filter(states), new_estimates(60, states)
    mean, P, likelihood = filter.mean.copy(), filter.covariance.copy(), 0.0
    result = run_filter(filter, PARAMETERS, edges, current, angles, estimates, 0.0)
    H = np.hstack([np.eye(3), np.zeros((3, 6)), np.eye(3)])[:, :states]
    for k in range(60):
        F, mean = slopes(mean, current[k])
        white = F[:, 6:9] @ F[:, 6:9].T * 3e-4**2 / PERIOD_s
        white[6:], white[:, 6:] = 0.0, 0.0
        P = F @ P @ F.T + np.diag(filter.density) * PERIOD_s + white
        S = H @ P @ H.T + NOISE_rad**2 * np.eye(3)
        likelihood += stats.multivariate_normal.logpdf(angles[k], mean[:3] + (H[:, 9:] @ mean[9:]), S)
        gain = np.linalg.solve(S, H @ P).T
        mean = mean + gain @ (angles[k] - H @ mean)
        keep = np.eye(states) - gain @ H
        P = keep @ P @ keep.T + NOISE_rad**2 * gain @ gain.T
        # Forward instead of central differences: 1e-6 of the slopes, with friction that changes in 0.01 rad/s
        # some 1e-3 of a rate's own slope.
        assert np.allclose(estimates.mean[k], mean, rtol=0, atol=3e-3 * np.sqrt(np.diag(P)) + 1e-9)
        assert np.allclose(estimates.deviation[k], np.sqrt(np.diag(P)), rtol=3e-3)
    assert result == pytest.approx(likelihood, rel=1e-4)


NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)


def reference(centre, half, deviation):
    """Log share, mean and variance by quadrature over panels, about the largest density in the interval."""
    low, high = centre - half, centre + half
    top = min(max(low, 0.0), high)
    scale = min(deviation, deviation**2 / max(abs(top), deviation))  # decay of the density there
    edges = np.unique(np.clip(top + scale * np.linspace(-60, 60, 481), low, high))
    widths = np.diff(edges)[:, None] / 2
    x = edges[:-1, None] + widths * (1 + NODES)
    weight = widths * WEIGHTS * np.exp(0.5 * (top**2 - x**2) / deviation**2)
    whole = weight.sum()
    mean = (weight * x).sum() / whole
    share = np.log(whole / (deviation * np.sqrt(2 * np.pi))) - 0.5 * (top / deviation) ** 2
    return share, mean, (weight * (x - mean) ** 2).sum() / whole


@given(st.floats(-40, 40), st.floats(0.05, 5), st.floats(0.02, 3))
def test_the_truncated_distribution_has_its_share_mean_and_variance(centre, half, deviation):
    share, mean, variance = _truncated(centre, half, deviation)
    expected = reference(centre, half, deviation)
    # The variance in a far tail is the difference of numbers some 1e4 times larger.
    assert share == pytest.approx(expected[0], rel=1e-9, abs=1e-9)
    assert mean == pytest.approx(expected[1], rel=1e-9, abs=1e-9 * deviation)
    assert variance * deviation**2 == pytest.approx(expected[2], rel=1e-4, abs=1e-9 * deviation**2)


def test_a_count_far_from_the_prediction_moves_it_to_the_edge_of_the_count():
    share, mean, variance = _truncated(1e5, 1.0, 1.0)
    assert mean == pytest.approx(1e5 - 1.0, rel=1e-9)
    assert 0.0 <= variance < 1e-3
    assert share < -1e9


def test_its_bands_cover_the_truth_also_of_a_counted_angle():
    """Share of rows within two standard deviations: 95.4 %; neighbouring rows are not independent."""
    generator, inside = np.random.default_rng(7), []
    half = np.radians(0.09)
    for _ in range(20):
        edges, current, truth, angles = motion(400, generator)
        angles[:, 2] = 2 * half * np.round(angles[:, 2] / (2 * half))
        filter, estimates = new_filter(half_count_rad=half, torque_noise_Nm_s=1e-6), new_estimates(400)
        run_filter(filter, PARAMETERS, edges, current, angles, estimates, 0.0)
        inside.append(np.abs(estimates.mean - truth)[100:] < 2 * estimates.deviation[100:])
    share = np.mean(inside, axis=(0, 1))
    # 20 runs with some ten independent estimates each: two deviations of a share are 3 %. The walk of the
    # disturbance is larger than here, where it rests: its band is too wide.
    assert np.all(share > 0.92), share


def test_a_missing_angle_is_not_used_and_widens_its_band():
    edges, current, truth, angles = motion(200, np.random.default_rng(3))
    angles[100:150] = np.nan
    estimates = new_estimates(200)
    run_filter(new_filter(), PARAMETERS, edges, current, angles, estimates, 0.0)
    assert np.all(np.isnan(estimates.innovation_rad[100:150]))
    assert np.all(estimates.deviation[149, :3] > 3 * estimates.deviation[99, :3])
    assert np.all(estimates.deviation[199, :3] < 2 * estimates.deviation[99, :3])
    assert np.all(np.abs(estimates.mean - truth)[150:, :6] < 5 * estimates.deviation[150:, :6])


def test_a_long_gap_is_passed_in_steps_of_the_longest_length():
    current, angles = np.random.default_rng(5).normal(0, 1, (1, 18)), np.full((1, 3), np.nan)
    many, once, estimates = new_filter(), new_filter(), new_estimates(1)
    run_filter(once, PARAMETERS, np.array([0.0, 0.01]), current, angles, estimates, 0.0)
    for _ in range(10):
        run_filter(many, PARAMETERS, np.array([0.0, 0.001]), current, angles, estimates, 0.0)
    assert np.allclose(once.mean, many.mean, rtol=1e-12, atol=1e-15)
    assert np.allclose(once.covariance, many.covariance, rtol=1e-9)
