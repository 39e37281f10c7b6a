"""Runs with the same reference show it once."""

import numpy as np
import pytest

from spheretwin.models.telemetry.signals import common_signals, width
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.comparison.runs import leaders


def reference(rows, period_s, rate=1.0):
    signals = common_signals(3)
    table = Table(signals, np.zeros((rows, width(signals))))
    table["t_s"][:] = np.arange(rows) * period_s
    table["q_ref_rad"][:] = np.sin(rate * table["t_s"])[:, None]
    return table


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
