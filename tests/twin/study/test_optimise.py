"""What is certain of a trial's objectives before all of its rows are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.study import optimise
from spheretwin.study.optimise import Objective

VALUES = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=9)
OVER = {"worst": np.max, "median": np.median, "first": lambda values: values[0]}


@given(VALUES, st.sampled_from(list(OVER)))
def test_an_objective_is_what_its_name_says_and_never_above_it_before_all_rows_are_known(values, over):
    objective = Objective(metric="copper_loss_J", over=over)
    *bounds, whole = (optimise.of_rows(objective, values[:k], len(values)) for k in range(len(values) + 1))
    # A median of an even number is a mean of two, which NumPy rounds otherwise: by some units of 1e6 · 2⁻⁵³.
    assert whole == pytest.approx(OVER[over](values), rel=1e-12, abs=1e-9)
    assert [*bounds, whole] == sorted([*bounds, whole])


@given(st.lists(st.floats(1e-6, 1e6), min_size=1, max_size=9))
def test_a_geometric_mean_is_that_of_all_rows_and_certain_of_nothing_before(values):
    objective = Objective(metric="copper_loss_J", over="geometric_mean")
    whole = optimise.of_rows(objective, values, len(values))
    # Logarithms up to 14 in magnitude: their sum and its exponential round by some units of 1e-15.
    assert whole == pytest.approx(np.exp(np.mean(np.log(values))), rel=1e-12)
    assert all(optimise.of_rows(objective, values[:k], len(values)) == 0 for k in range(len(values)))


def test_within_a_limit_the_least_first_objective_is_best():
    values = {0: (3.0, 1.0), 1: (1.0, 9.0), 2: (2.0, 4.0), 3: (2.0, 5.0)}
    best = {limit: optimise.best_within(values, limit) for limit in (0.5, 1.0, 5.0, 20.0)}
    assert best == {0.5: None, 1.0: 0, 5.0: 2, 20.0: 1}


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=2, max_size=2))
def test_one_dominates_where_it_is_never_worse_and_not_the_same(pair):
    one, other = pair
    slow = one != other and max(a - b for a, b in zip(one, other, strict=True)) <= 0
    assert optimise.dominates(one, other) == slow


def test_of_a_figure_of_each_hinge_the_worst_of_its_entries_is_taken():
    figure = [0.1, 0.3, 0.9]
    of_two = {"metric": "max_abs_error_rad", "of": ("alpha", "beta")}
    assert optimise.of_row(Objective(**of_two), figure) == 0.3
    assert optimise.of_row(Objective(metric="max_abs_error_rad"), figure) == 0.9
    # To be large: the smallest is the worst, and all signs are changed.
    assert optimise.of_row(Objective(**of_two, direction="maximise"), figure) == -0.1


@pytest.mark.parametrize("figure", [None, [], [0.1, None, 0.2], float("nan"), float("inf"), True, "0.1", {}])
def test_what_is_no_number_is_none(figure):
    assert optimise.of_row(Objective(metric="max_abs_error_rad"), figure) is None
