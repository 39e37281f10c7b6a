"""Load and random torque of the paper, seeded."""

import numpy as np
import pytest

from spheretwin.twin.disturbances.load import Disturbance

T = np.linspace(0, 2, 2001)


def test_load_is_constant_on_every_axis():
    sampled = Disturbance(load=2.0).sample(T, np.random.default_rng(0).random(len(T)))
    np.testing.assert_array_equal(sampled, np.full((len(T), 3), 0.1))


@pytest.mark.parametrize(("envelope", "sign"), [("decaying", -1), ("growing", 1)])
def test_random_torque_is_equation_56(envelope, sign):
    disturbance = Disturbance(random_bound_Nm=0.05, gamma_envelope=envelope)
    sampled = disturbance.sample(T, np.random.default_rng(0).random(len(T)))
    r = sampled[:, 0] / np.cos(np.pi * T)
    r = np.where(np.abs(np.cos(np.pi * T)) > 0.1, r, np.nan)
    known = np.isfinite(r)
    assert np.all(np.abs(r[known]) <= 0.05)
    assert np.nanstd(r) == pytest.approx(0.05 / np.sqrt(3), rel=0.05)  # uniform, 1,900 draws
    np.testing.assert_allclose(sampled[known, 1], (r * np.sin(-np.pi * T))[known], atol=1e-15)
    np.testing.assert_allclose(sampled[known, 2], (r * np.exp(sign * np.pi * T))[known], rtol=1e-12)


def test_seed_decides():
    disturbance = Disturbance(random_bound_Nm=0.05)
    first, again, other = (
        disturbance.sample(T, np.random.default_rng(seed).random(len(T))) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
