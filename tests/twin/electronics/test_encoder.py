"""The encoder against its definition: the nearest line of a grid, over any number of turns."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.electronics.stages import SensorSetup
from spheretwin.electronics.transducers import EncoderSection, counted

COUNTS = st.integers(1, 2**20)


def made(counts):
    setup = SensorSetup(None, 0, "encoder", first_draw=0, faults=False, longest_delay_ticks=0)
    return EncoderSection(counts=counts).build(setup)


@given(st.floats())
def test_without_counts_the_bits_are_the_same(angle):
    got = counted(made(0), angle)
    assert np.float64(got).tobytes() == np.float64(angle).tobytes() or np.isnan(angle) & np.isnan(got)


@given(st.floats(-1e4, 1e4), COUNTS)
def test_the_line_is_the_nearest(angle, counts):
    line = 2 * np.pi / counts
    got = counted(made(counts), angle)
    # Products of the angle round to 2⁻⁵³ of it, three of them.
    assert abs(got - angle) <= line / 2 + 4e-16 * abs(angle)
    assert got / line == pytest.approx(round(got / line), rel=1e-15)


@given(st.integers(-(10**7), 10**7), st.integers(0, 1999), st.floats(-0.49, 0.49))
def test_a_count_is_exact_over_ten_million_turns(turns, place, inside):
    # At 1.3e11 radians of counts the angle itself rounds to 4e-6 of a line.
    line, count = 2 * np.pi / 2000, turns * 2000 + place
    assert counted(made(2000), (count + inside) * line) == count * line


def test_none_stays_none_and_the_endless_endless():
    assert np.isnan(counted(made(2000), np.nan))
    assert counted(made(2000), np.inf) == np.inf
    assert counted(made(2000), -1e308) == -np.inf
    assert counted(made(2000), 5e-324) == 0
