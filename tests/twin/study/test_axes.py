"""Each kind of axis against its definition, and the designs against theirs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.stats import qmc

from spheretwin.models.base.errors import InputError
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
    expected = stats.truncnorm(-most, most, 2.0, 0.1)
    # SciPy's inverse goes by logarithms: it and ours agree to some digits less than eps.
    np.testing.assert_allclose(drawn, expected.ppf(MIDDLES), rtol=0, atol=1e-9)
    ends = axis.quantile(np.array([np.finfo(float).eps, 1 - np.finfo(float).eps]))
    # Two roundings of a value about 2.
    assert np.all(np.abs(ends - 2.0) <= 0.1 * most + 1e-15)
    assert drawn.mean() == pytest.approx(2.0, abs=1e-12)
    # In the tails the midpoint rule is worst: of the last stratum it misses a part.
    assert drawn.std() == pytest.approx(expected.std(), rel=1e-3)


def points(design, samples, seed=0, axes=UNIT):
    grid = Grid(study(*axes, design=design, samples=samples, seed=seed))
    return np.array([list(row.values.values()) for row in grid])


@pytest.mark.parametrize("samples", [1, 7, 100])
def test_a_latin_hypercube_has_one_point_in_each_stratum_of_each_axis(samples):
    strata = np.floor(samples * points("latin_hypercube", samples)).astype(int)
    for axis in strata.T:
        assert sorted(axis) == list(range(samples))


@pytest.mark.parametrize("samples", [1, 8, 1000])
def test_a_latin_hypercube_is_scipy_s(samples):
    expected = qmc.LatinHypercube(3, rng=np.random.default_rng([5, STAGE])).random(samples)
    np.testing.assert_array_equal(points("latin_hypercube", samples, 5), expected)


@pytest.mark.parametrize("samples", [1, 8, 13])
def test_sobol_is_scipy_s(samples):
    generator = np.random.default_rng([5, STAGE])
    expected = qmc.Sobol(3, rng=generator).random_base2(4)[:samples]
    np.testing.assert_array_equal(points("sobol", samples, 5), expected)


def test_a_longer_sobol_begins_alike():
    np.testing.assert_array_equal(points("sobol", 16)[:5], points("sobol", 5))


def test_random_points_are_the_generator_s():
    expected = np.random.default_rng([3, STAGE]).random((50, 3))
    np.testing.assert_array_equal(points("random", 50, 3), expected)


@pytest.mark.parametrize("design", ["random", "latin_hypercube", "sobol"])
def test_another_seed_draws_other_points(design):
    assert np.all(points(design, 9, 0) != points(design, 9, 1))


@pytest.mark.parametrize(
    ("axis", "message"),
    [
        ({"kind": "values", "values": []}, "axis.0.values: expected one value at least"),
        ({"kind": "linspace", "first": 0, "last": 1, "count": 0}, "axis.0.count: expected a number greater"),
        ({"kind": "linspace", "first": 0, "last": 1, "count": 10**9}, "axis.0.count: expected a number less"),
        (
            {"kind": "linspace", "first": 0, "last": float("inf"), "count": 2},
            "axis.0.last: expected a finite",
        ),
        ({"kind": "linspace", "first": "0", "last": 1, "count": 2}, "axis.0.first: expected a number"),
        (
            {"kind": "logspace", "first": 0, "last": 1, "count": 2},
            "axis.0.first: expected a number greater than 0",
        ),
        ({"kind": "uniform", "low": 1, "high": 1}, "expected low below high"),
        ({"kind": "normal", "mean": 0, "deviation": 0}, "axis.0.deviation: expected a number greater than 0"),
        ({"kind": "gauss"}, "axis.0.kind: expected one of values, linspace, logspace, uniform, normal"),
        ({"kind": "uniform", "low": 0, "high": 1, "zip": "a"}, "expected no zip of what is drawn"),
    ],
)
def test_what_makes_no_axis_is_refused_in_one_line(axis, message):
    samples = 3 if axis["kind"] in ("uniform", "normal") else None
    with pytest.raises(InputError) as refusal:
        study({"field": FIELD, **axis}, samples=samples)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)
