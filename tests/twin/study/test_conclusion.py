"""Conclusion of a study: digits that an interval supports, and sentences that follow from the rows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.study import conclusion
from spheretwin.study.statistics import summary
from tests.twin.study.test_report import made

ERROR = "max_abs_error_rad"


@given(st.floats(1e-6, 1e6), st.floats(1e-4, 0.5))
def test_rounding_changes_a_median_by_at_most_a_sixth_of_half_its_interval(median, share):
    """Half an interval from 0.01 % to 50 % of the median, so that four digits are enough."""
    half = share * median
    places = conclusion.decimals(median, (median - half, median + half))
    shown = float(conclusion.rounded(median, places))
    limit = max(half / 6, 0.5 * 10.0 ** (np.floor(np.log10(median)) - conclusion.MOST_DIGITS + 1))
    assert abs(shown - median) <= limit * (1 + 1e-9)
    # One decimal less would change some medians by more than half of half the interval.
    assert 10.0**-places >= half / 30 * (1 - 1e-9)


@pytest.mark.parametrize(
    ("median", "ends", "text"),
    [
        (0.02909, (0.0187, 0.04205), "29 [19, 42] (18 to 44)"),
        (0.02909, (0.0281, 0.0302), "29.1 [28.1, 30.2] (18.3 to 44.2)"),
        (0.02909, (0.029, 0.0291), "29.09 [29.00, 29.10] (18.30 to 44.20)"),
    ],
)
def test_a_median_has_the_digits_that_its_interval_supports(median, ends, text):
    figure = {"median": median, "median_95": list(ends), "range_95": [0.0183, 0.0442]}
    assert conclusion.spread_text(figure, 1e3) == text


def test_figures_without_spread_or_value_are_no_intervals():
    figure = {"median": 0.0, "median_95": [None, None], "range_95": [0.0, 0.0]}
    assert conclusion.spread_text(figure, 1.0) == "0 (no spread)"
    assert conclusion.spread_text(figure | {"median": None}, 1.0) == "–"


LOADS = np.linspace(0.0, 2.0, 40)
NOISE = np.random.default_rng(8).normal(size=40)


def text_of(values, laws=("pd",), lost=(), axes=None):
    rows = made(40, {ERROR: values}, axes or {"disturbance.load": LOADS}, laws, lost)
    return conclusion.text(rows, summary(rows))


def test_the_axis_with_the_strongest_correlation_is_named_with_its_sign():
    axes = {"plant.payload_kg": NOISE, "disturbance.load": LOADS}
    assert text_of(0.01 + 0.01 * LOADS, axes=axes).endswith(
        "Under pd it depends most on disturbance load (rank correlation +1.00)."
    )
    distance = text_of(0.01 + np.abs(NOISE - np.median(NOISE)), axes=axes)
    assert "the distance from the middle of plant payload (rank correlation +" in distance
    assert text_of(0.01 + 0.001 * NOISE).endswith("Under pd it depends on no axis more than by chance.")


def test_rows_that_did_not_complete_are_counted_by_status_and_law():
    assert text_of(LOADS).startswith("All 40 rows completed. Median largest error, mrad, ")
    lost = text_of(LOADS, ("pd", "afsm"), (0, 2, 5))
    assert lost.startswith(
        "3 of 40 rows did not complete: 2 left workspace under pd, 1 left workspace under afsm."
    )
    assert text_of(LOADS, lost=range(40)) == "40 of 40 rows did not complete: 40 left workspace under pd."


def test_laws_are_ranked_only_if_their_intervals_are_apart():
    """Of every two rows the first is of pd."""
    apart = np.where(np.arange(40) % 2 == 0, 0.03, 0.01) + 1e-4 * NOISE
    assert "afsm 10" in (ranked := text_of(apart, ("pd", "afsm")))
    assert "That of afsm is the lowest." in ranked
    assert ranked.index("afsm 10") < ranked.index("; pd ")
    overlap = text_of(0.03 + 1e-3 * NOISE, ("pd", "afsm"))
    assert "overlap: the two are not ranked." in overlap
