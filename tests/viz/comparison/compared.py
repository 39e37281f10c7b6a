"""Runs of constructed signals for comparisons: no simulation is needed."""

from types import SimpleNamespace

import numpy as np

from spheretwin.models.telemetry.signals import common_signals
from spheretwin.viz.comparison.runs import ComparedRun, EarlyEnd
from spheretwin.viz.quantities import Quantity, QuantityRows
from tests.viz.tables import table_of

PERIOD_s = 1e-3
T_s = PERIOD_s * np.arange(4000)

# A period of four ticks: 250 Hz.
SQUARE = 0.5 + np.where(np.arange(len(T_s)) // 2 % 2, 3.0, -3.0)
SPIKE = np.where(np.arange(len(T_s)) == 2345, 7.0, 0.0)
RAMP = 2.0 * T_s - 3.0
SIGNALS = {"square": SQUARE, "spike": SPIKE, "ramp": RAMP}

# Constructed signals take the column of the angle α.
VALUE = Quantity("value", "rad", "value", lambda rows: rows.table["q_rad"][:, :1], 1e-3, group="angle")


def run_of(values, label="1 made: pd", law="pd", status=None, period_s=PERIOD_s, events=(), start_s=0.0):
    table = table_of(common_signals(18), start_s + period_s * np.arange(len(values)))
    table["q_rad"][:, 0] = values
    end = EarlyEnd(float(table["t_s"][-1]), status, "the reason") if status else None
    rows = QuantityRows(table, table.rows(0, 1), SimpleNamespace(), 8.0)
    return ComparedRun(label.replace(" ", "_"), label, law, period_s, rows, {}, tuple(events), end)
