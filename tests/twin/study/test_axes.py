"""Each kind of axis against its definition, and the designs against theirs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.stats import qmc

from spheretwin.study.axes import Linspace, Logspace, Normal, Uniform
from spheretwin.study.grid import STAGE, Grid
from tests.twin.study.cases import study

FIELD = "disturbance.load"

# Middles of equal strata: a mean over them is an integral by the midpoint rule.
STRATA = 20_000
MIDDLES = (np.arange(STRATA) + 0.5) / STRATA

UNIT = [{"field": f"plant.coulomb_Nm.{i}", "kind": "uniform", "low": 0.0, "high": 1.0} for i in range(3)]


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.integers(2, 50))
def test_linspace_has_equal_distances_and_both_ends(first, last, count):
    listed = Linspace(field=FIELD, first=first, last=last, count=count).listed()
    assert (listed[0], listed[-1], len(listed)) == (first, last, count)
    # Each of two values is rounded a few times.
    np.testing.assert_allclose(np.diff(listed), (last - first) / (count - 1), rtol=0, atol=1e-12)


@given(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 50))
def test_logspace_has_equal_ratios_and_both_ends(first, last, count):
    listed = np.array(Logspace(field=FIELD, first=first, last=last, count=count).listed())
    assert (listed[0], listed[-1], len(listed)) == (first, last, count)
    # Exponents up to 30 of an e, each rounded: some tens of eps.
    np.testing.assert_allclose(listed[1:] / listed[:-1], (last / first) ** (1 / (count - 1)), rtol=1e-12)


def test_uniform_has_its_bounds_and_moments():
    drawn = Uniform(field=FIELD, low=-1.0, high=3.0).quantile(MIDDLES)
    assert -1.0 < drawn.min() < drawn.max() < 3.0
    assert drawn.mean() == pytest.approx(1.0, abs=1e-12)
    # The midpoint rule leaves 1/n² of the variance.
    assert drawn.var() == pytest.approx(16 / 12, rel=2 / STRATA**2 + 1e-12)


@pytest.mark.parametrize("most", [0.5, 3.0, 8.0])
def test_normal_is_the_normal_cut_off(most):
    axis = Normal(field=FIELD, mean=2.0, deviation=0.1, most_deviations=most)
    drawn = axis.quantile(MIDDLES)
    # SciPy's inverse goes by logarithms: it and ours agree to some digits less than eps.
    expected = stats.truncnorm(-most, most, 2.0, 0.1).ppf(MIDDLES)
    np.testing.assert_allclose(drawn, expected, rtol=0, atol=1e-9)
    ends = axis.quantile(np.array([np.finfo(float).eps, 1 - np.finfo(float).eps]))
    # Two roundings of a value about 2.
    assert np.all(np.abs(ends - 2.0) <= 0.1 * most + 1e-15)


DESIGNS = {
    "random": lambda generator, samples: generator.random((samples, 3)),
    "latin_hypercube": lambda generator, samples: qmc.LatinHypercube(3, rng=generator).random(samples),
    "sobol": lambda generator, _: qmc.Sobol(3, rng=generator).random_base2(4),
}


@pytest.mark.parametrize("design", DESIGNS)
@pytest.mark.parametrize(("samples", "seed"), [(1, 0), (8, 5), (13, 5)])
def test_points_are_those_of_numpy_and_scipy(design, samples, seed):
    """A longer Sobol sequence begins with a shorter one."""
    rows = Grid(study(*UNIT, design=design, samples=samples, seed=seed))
    points = np.array([list(row.values.values()) for row in rows])
    expected = DESIGNS[design](np.random.default_rng([seed, STAGE]), samples)[:samples]
    np.testing.assert_array_equal(points, expected)
