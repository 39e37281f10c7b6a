"""Runs with the same reference show it once."""

import numpy as np
import pytest

from spheretwin.models.telemetry.signals import common_signals
from spheretwin.viz.comparison.runs import leaders
from tests.viz.tables import table_of


def reference(rows, period_s, rate=1.0):
    t_s = np.arange(rows) * period_s
    return table_of(common_signals(3), t_s, q_ref_rad=np.sin(rate * t_s)[:, None])


@pytest.mark.parametrize(
    ("references", "expected"),
    [
        ([(100, 1e-3), (300, 7e-4), (50, 2e-3)], [1]),
        ([(100, 1e-3), (90, 1e-3, 2.0), (80, 1e-3), (95, 1e-3, 2.0)], [0, 3]),
        ([(1, 1e-3), (1, 1e-3)], [0]),
    ],
)
def test_the_longest_of_equal_references_is_shown_at_whatever_rate(references, expected):
    assert leaders([reference(*each) for each in references]) == expected
