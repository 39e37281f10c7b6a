"""Load and random torque of the paper, and terms: each is its exact torque; a file's terms add."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.session import Session
from spheretwin.trajectories import disturbances
from tests.twin.disturbance_cases import PERIOD, sampled


@pytest.mark.parametrize(("envelope", "sign"), [("decaying", -1), ("growing", 1)])
def test_random_torque_is_equation_56(envelope, sign):
    """One factor for all axes, uniform from -1 to 1."""
    draws, t = disturbances.term_draws(3, 0, 2000, 2), PERIOD * np.arange(2000)
    shape = np.stack([np.cos(np.pi * t), -np.sin(np.pi * t), np.exp(sign * np.pi * t)], axis=1)
    expected = (2 * draws[:, None] - 1) * shape
    paper = disturbances.Disturbance(random_bound_Nm=0.05, gamma_envelope=envelope)
    paper = paper.sample(t, disturbances.Draws(lambda: draws, None))
    np.testing.assert_allclose(paper, 0.05 * expected, rtol=1e-12, atol=1e-16)
    term = disturbances.RandomDisturbance(bound_Nm=(0.05, 0.02, 0.01), gamma_envelope=envelope)
    np.testing.assert_allclose(sampled(term, 0, 2000), [0.05, 0.02, 0.01] * expected, rtol=1e-12, atol=1e-16)


def test_draws_of_a_term_are_uniform_and_independent():
    draws = 2 * disturbances.term_draws(3, 0, 100_000, 2) - 1
    # Mean 0 with variance 1/3, and its estimate with variance (1/5 - 1/9) / n: four standard deviations.
    assert np.abs(draws).max() <= 1
    assert abs(draws.mean()) < 4 * np.sqrt(1 / 3 / 100_000)
    assert abs(draws.var() - 1 / 3) < 4 * np.sqrt((1 / 5 - 1 / 9) / 100_000)
    assert abs(np.corrcoef(draws[1:], draws[:-1])[0, 1]) < 4 / np.sqrt(100_000)


def test_draws_count_by_tick_for_any_seed():
    far = 10**15
    for seed in (0, 2**200):
        whole = disturbances.term_draws(seed, far, 20, 0)
        assert whole[7:9].tobytes() == disturbances.term_draws(seed, far + 7, 2, 0).tobytes()
        assert not np.any(whole == disturbances.term_draws(seed, far, 20, 1))
        assert len(np.unique(whole)) == 20


def test_growing_random_torque_of_bound_zero_is_none():
    """At 300 s the envelope is infinite."""
    growing = disturbances.Disturbance(load=1.0, gamma_envelope="growing")
    torque = growing.sample(np.array([300.0]), disturbances.Draws(lambda: np.ones(1), None))
    np.testing.assert_array_equal(torque, [[0.05, 0.05, 0.05]])


def test_constant_and_steps_hold_on_each_axis_by_itself():
    constant = disturbances.ConstantDisturbance(torque_Nm=(1.0, 2.0, 3.0))
    np.testing.assert_array_equal(sampled(constant, 7, 3), [[1, 2, 3]] * 3)
    steps = disturbances.StepDisturbance(
        times_s=(0.002, 0.004), torques_Nm=((1.0, 0.0, -1.0), (0.0, 5.0, 0.0))
    )
    expected = [[0, 0, 0], [0, 0, 0], [1, 0, -1], [1, 0, -1], [0, 5, 0], [0, 5, 0]]
    np.testing.assert_array_equal(sampled(steps, 0, 6), expected)


def test_sinusoidal_swings_on_each_axis_by_itself():
    term = disturbances.SinusoidalDisturbance(
        amplitude_Nm=(0.1, 0.2, 0.3), frequency_Hz=(1.0, 2.0, 0.0), phase_rad=(0.0, np.pi / 2, np.pi / 6)
    )
    quarters = term.sample(np.array([0.0, 0.25, 0.5, 0.75, 1.0]), None)
    expected = [[0, 0.2, 0.15], [0.1, -0.2, 0.15], [0, 0.2, 0.15], [-0.1, -0.2, 0.15], [0, 0.2, 0.15]]
    np.testing.assert_allclose(quarters, expected, atol=1e-15)


def test_table_goes_by_its_rows(torques):
    t = np.array([0.0, 0.5, 1.0, 1.5, 1.75, 2.0, 50.0])
    linear = disturbances.TableDisturbance(file=torques).sample(t, None)
    rows = [[0.1, 0, 0], [0.3, -0.2, 0], [0, 0, 0.4]]
    first, second, last = rows
    expected = [first, first, [0.2, -0.1, 0], second, [0.15, -0.1, 0.2], last, last]
    np.testing.assert_allclose(linear, expected, atol=1e-16)
    steps = disturbances.TableDisturbance(file=torques, between="held").sample(t, None)
    np.testing.assert_array_equal(steps, np.array(rows)[[0, 0, 0, 1, 1, 2, 2]])


FILE = """
duration = 0.1
seed = 5
[trajectory]
shape = "hold"
[disturbance]
load = 1.0
random_bound_Nm = 0.01
[[disturbance.terms]]
kind = "steps"
times_s = [0.02, 0.05]
torques_Nm = [[0.01, 0.0, 0.0], [0.0, 0.02, 0.0]]
[[disturbance.terms]]
kind = "random"
bound_Nm = [0.01, 0.02, 0.0]
[[disturbance.terms]]
kind = "table"
file = "torque.csv"
"""


def test_terms_of_a_scenario_file_add(tmp_path):
    (tmp_path / "torque.csv").write_text("t_s,alpha_Nm,beta_Nm,gamma_Nm\n0,0,0,0\n0.1,0,0,0.1\n")
    (tmp_path / "mine.toml").write_text(FILE)
    rows = Session(scenarios.load(str(tmp_path / "mine.toml"))).advance(100)
    t = rows["t_s"]
    paper = np.random.default_rng(5).random(1000)[:100]  # the stream of a whole block
    draws = disturbances.Draws(lambda: paper, lambda place: paper)
    expected = 0.05 + disturbances.Disturbance(random_bound_Nm=0.01).sample(t, draws)
    expected[:, 0] += np.where((t >= 0.02) & (t < 0.05), 0.01, 0.0)
    expected[:, 1] += np.where(t >= 0.05, 0.02, 0.0)
    u = 2 * disturbances.term_draws(5, 0, 100, 1) - 1
    expected[:, 0] += 0.01 * u * np.cos(np.pi * t)
    expected[:, 1] -= 0.02 * u * np.sin(np.pi * t)
    expected[:, 2] += t
    np.testing.assert_allclose(rows["disturbance_Nm"], expected, atol=1e-15)
