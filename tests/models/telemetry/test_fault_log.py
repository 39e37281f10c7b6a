"""Faults of a run from its rows: starts, ends, detection, for any chunks."""

import numpy as np
import pytest

from spheretwin.models.telemetry.fault_log import FaultLog
from spheretwin.models.telemetry.signals import Signal, width
from spheretwin.models.telemetry.table import Table

GROUPS = ("group 0", "group 1")
SIGNALS = (
    Signal("t_s", "s", 1, "time"),
    Signal("fault", "1", 3, "faults", ("coil.00", "coil.01", "adc"), ("works", "open", "noise")),
    Signal("group_out", "1", 2, "groups", GROUPS, ("in use", "known to be out", "found open")),
    Signal("time_to_detection_s", "s", 2, "delay", GROUPS),
)


def rows():
    """Coil 0 fails twice and is detected the second time, coil 1 is reported, the converter is not found."""
    table = Table(SIGNALS, np.zeros((100, width(SIGNALS))))
    table["t_s"][:] = 1e-3 * np.arange(100)
    table["time_to_detection_s"][:] = -1.0
    table["fault"][10:20, 0] = table["fault"][40:, 0] = 1
    table["group_out"][47:, 0], table["time_to_detection_s"][47:, 0] = 2, 0.007
    table["fault"][30:, 1], table["group_out"][30:, 1], table["time_to_detection_s"][30:, 1] = 1, 1, 0.0
    table["fault"][60:, 2] = 2
    return table


@pytest.mark.parametrize("chunk", [1, 7, 100])
def test_a_detection_is_of_the_fault_that_has_started_not_of_a_later_one_of_the_group(chunk):
    log, table = FaultLog(), rows()
    table["group_out"][13:20, 0], table["time_to_detection_s"][13:20, 0] = 2, 0.003
    for first in range(0, 100, chunk):
        log.write(table.rows(first, min(first + chunk, 100)))
    assert [fault.text() for fault in log.faults] == [
        "coil.00 open from 0.01 s to 0.02 s, detected after 3 ms",
        "coil.01 open from 0.03 s, reported to the controller",
        "coil.00 open from 0.04 s, detected after 7 ms",
        "adc noise from 0.06 s, not detected",
    ]


def test_rows_without_faults_have_none():
    log = FaultLog()
    log.write(Table(SIGNALS[:1], np.zeros((5, 1))))
    assert log.faults == []
