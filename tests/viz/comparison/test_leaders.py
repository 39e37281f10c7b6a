"""Runs with the same reference show it once."""

import numpy as np

from spheretwin.models.telemetry.signals import common_signals, width
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.comparison.runs import leaders


def asked(rows, period_s, rate=1.0):
    signals = common_signals(3)
    table = Table(signals, np.zeros((rows, width(signals))))
    table["t_s"][:] = np.arange(rows) * period_s
    table["q_ref_rad"][:] = np.sin(rate * table["t_s"])[:, None]
    return table


def test_the_longest_of_equals_shows_it_at_whatever_rate():
    assert leaders([asked(100, 1e-3), asked(300, 7e-4), asked(50, 2e-3)]) == [1]


def test_each_distinct_reference_is_shown():
    assert leaders([asked(100, 1e-3), asked(90, 1e-3, 2.0), asked(80, 1e-3), asked(95, 1e-3, 2.0)]) == [0, 3]


def test_a_tick_alone_is_enough_to_be_the_same():
    assert leaders([asked(1, 1e-3), asked(1, 1e-3)]) == [0]
