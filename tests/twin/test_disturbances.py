"""Load and random torque of the paper, seeded; terms of a file add to them."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.disturbances import Disturbance, Draws, term_draws
from spheretwin.session import Session

T = np.linspace(0, 2, 2001)


@pytest.mark.parametrize(("envelope", "sign"), [("decaying", -1), ("growing", 1)])
def test_random_torque_is_equation_56(envelope, sign):
    disturbance = Disturbance(random_bound_Nm=0.05, gamma_envelope=envelope)
    sampled = disturbance.sample(T, Draws(np.random.default_rng(0).random(len(T)), None))
    r = sampled[:, 0] / np.cos(np.pi * T)
    r = np.where(np.abs(np.cos(np.pi * T)) > 0.1, r, np.nan)
    known = np.isfinite(r)
    assert np.all(np.abs(r[known]) <= 0.05)
    assert np.nanstd(r) == pytest.approx(0.05 / np.sqrt(3), rel=0.05)  # uniform, 1,900 draws
    np.testing.assert_allclose(sampled[known, 1], (r * np.sin(-np.pi * T))[known], atol=1e-15)
    np.testing.assert_allclose(sampled[known, 2], (r * np.exp(sign * np.pi * T))[known], rtol=1e-12)


def test_growing_random_torque_of_bound_zero_is_none():
    """At 300 s the envelope is infinite."""
    torque = Disturbance(load=1.0, gamma_envelope="growing").sample(
        np.array([300.0]), Draws(np.ones(1), None)
    )
    np.testing.assert_array_equal(torque, [[0.05, 0.05, 0.05]])


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
    expected = 0.05 + Disturbance(random_bound_Nm=0.01).sample(t, Draws(paper, lambda place: paper))
    expected[:, 0] += np.where((t >= 0.02) & (t < 0.05), 0.01, 0.0)
    expected[:, 1] += np.where(t >= 0.05, 0.02, 0.0)
    u = 2 * term_draws(5, 0, 100, 1) - 1
    expected[:, 0] += 0.01 * u * np.cos(np.pi * t)
    expected[:, 1] -= 0.02 * u * np.sin(np.pi * t)
    expected[:, 2] += t
    np.testing.assert_allclose(rows["disturbance_Nm"], expected, atol=1e-15)
