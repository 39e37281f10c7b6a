"""Tables of constructed columns."""

import numpy as np

from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.table import Table


def table_of(signals, t_s, **columns):
    """Rows at some times; what is not given is zero."""
    table = Table(signals, np.zeros((len(t_s), width(signals))))
    for name, values in {"t_s": t_s, **columns}.items():
        table[name][:] = values
    return table


def chunks(table, cuts):
    """Rows of a table, cut at some places."""
    ends = sorted(cuts)
    return [table.rows(first, last) for first, last in zip([0, *ends], [*ends, len(table)], strict=True)]
