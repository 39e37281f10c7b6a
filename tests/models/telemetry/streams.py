"""Tables of random numbers, streamed to files in short parts: what the tests of these files share."""

import numpy as np

from spheretwin.models.telemetry.parquet import TelemetryFile
from spheretwin.models.telemetry.signals import Signal, common_signals, width
from spheretwin.models.telemetry.table import Table

SIGNALS = common_signals(18)

PART_ROWS = 64
GAIN = Signal("gain", "1", 2, "a law's own")
FACTS = {"scenario": '{"a": 1}', "ticks": "0"}


def table(rows, signals=SIGNALS, seed=0):
    return Table(signals, np.random.default_rng(seed).normal(size=(rows, width(signals))))


def streamed(path, whole, chunk, facts=FACTS):
    """Write a table chunk by chunk; close is left to the caller."""
    file = TelemetryFile(path, whole.signals, facts)
    for first in range(0, len(whole), chunk):
        file.write(whole.rows(first, first + chunk))
    return file


def parts_beside(path):
    (folder,) = path.parent.glob(f".{path.name}.*.parts")
    return sorted(folder.glob("*.arrows"))
