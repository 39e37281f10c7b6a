"""Shares of a relaxation against sixty digits, at every scale of time."""

from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.electronics.coil import SERIES_TO, relaxation

SCALES = [*10.0 ** np.linspace(-14, 18, 1000), *np.linspace(0.9 * SERIES_TO, 1.1 * SERIES_TO, 100)]


def with_sixty_digits(x):
    with localcontext() as context:
        context.prec = 60
        time = Decimal(x)
        settled = 1 - (-time).exp()
        both = settled * settled / 2
        integrals = (time - settled, settled - both, both, time - settled - both)
        return [float(number) for number in (settled, *(integral / time for integral in integrals))]


def test_every_share_is_exact_at_every_scale():
    shares = np.array([relaxation(float(x)) for x in SCALES])
    exact = np.array([with_sixty_digits(float(x)) for x in SCALES])
    # A few roundings; just above the series' end, the mean square is a difference of numbers fifty times it.
    np.testing.assert_allclose(shares[:, :4], exact[:, :4], rtol=1e-15)
    np.testing.assert_allclose(shares[:, 4], exact[:, 4], rtol=1e-14)


@given(st.floats(0, 1e300))
def test_shares_are_shares(x):
    shares = relaxation(x)
    assert all(0 <= share <= 1 for share in shares)
    # Start and end make up the whole, on average as at any moment.
    assert shares.start_start + 2 * shares.start_settled + shares.settled_settled == pytest.approx(
        1, rel=1e-14
    )
    assert shares.start_settled + shares.settled_settled == pytest.approx(shares.mean, rel=1e-14, abs=1e-300)


def test_in_no_time_nothing_has_settled():
    assert relaxation(0.0) == (0, 0, 1, 0, 0)
