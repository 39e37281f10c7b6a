"""Sine and cosine by polynomials against NumPy."""

import numpy as np
import pytest

from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.trigonometry import LARGEST_rad, sine_cosine
from spheretwin.models.base.vectors import WIDTH, load, store

# NumPy's own are within one unit in the last place, 1.1e-16 near 1.
ROUNDING = 4e-16


@allocation_free
def of_each(angles, sines, cosines):
    for i in range(angles.shape[0]):
        sines[i], cosines[i] = sine_cosine(angles[i])


@allocation_free
def of_four(angles, sines, cosines):
    for i in range(0, angles.shape[0], WIDTH):
        sine, cosine = sine_cosine(load(angles, i))
        store(sine, sines, i)
        store(cosine, cosines, i)


@pytest.mark.parametrize("function", [of_each, of_four])
def test_sine_and_cosine_are_exact_to_rounding(function):
    generator = np.random.default_rng(8)
    near, far = generator.uniform(-2, 2, 2000), generator.uniform(-LARGEST_rad, LARGEST_rad, 2000)
    angles = np.concatenate([near, far, np.arange(-10, 10) * np.pi / 4])
    sines, cosines = np.empty(len(angles)), np.empty(len(angles))
    function(angles, sines, cosines)
    np.testing.assert_allclose(sines, np.sin(angles), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(cosines, np.cos(angles), rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("function", [of_each, of_four])
def test_what_is_no_angle_has_no_sine(function):
    sines, cosines = np.zeros(WIDTH), np.zeros(WIDTH)
    function(np.array([np.nan, np.inf, -np.inf, 0.0]), sines, cosines)
    assert np.isnan(sines).tolist() == np.isnan(cosines).tolist() == [True, True, True, False]
