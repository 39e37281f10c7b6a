"""A run among others, as those who draw it need it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from spheretwin.models.telemetry.status import Level
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.quantities.quantity import Rows

Event = tuple[float, Level, str]
"""Simulated time in s, level, text."""


class Run(NamedTuple):
    """One run."""

    name: str
    """What tells it from the others where there is room for a word: ``run_1_nutation``."""
    label: str
    """What a legend says: file, law, what else is not the same in all."""
    law: str
    period_s: float
    """Between two rows."""
    rows: Rows
    """Its telemetry, with a row at least, and what is derived from it needs beside it."""
    record: Mapping[str, str]
    """What its telemetry file says of it beside the rows."""
    events: Sequence[Event]

    @property
    def table(self) -> Table:
        """Its telemetry."""
        return self.rows.table
