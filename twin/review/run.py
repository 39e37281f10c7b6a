"""A run as its own file tells it, whichever kind of file: telemetry, recording, or what was left of one."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import shown
from spheretwin.models.telemetry.checksums import has_checksums
from spheretwin.models.telemetry.record import RunRecord
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table, read_parquet
from spheretwin.twin.review import leavings
from spheretwin.twin.review.held import held, ticks_of
from spheretwin.twin.review.journal import logged
from spheretwin.viz.recording.parts.events import Event

# In the metadata of columns that were exported of a recording that does not keep every row.
_RATE = "record_rate_Hz"


@dataclass(frozen=True)
class Reviewed:
    """What the file of a run says.

    Attributes
    ----------
    path : Path
        The file, or what a killed process left of it.
    record : RunRecord
        Scenario at the start, command journal, versions, and how it ended.
    table : Table
        Its telemetry, as the file has it.
    log : tuple of Event
        Lines that were logged; of a telemetry file, which has no log, none.
    whole : bool
        Whether the file was closed.
    metadata : mapping of str
        The record as a telemetry file keeps it.
    rate_Hz : float or None
        Rows a second that the file keeps beside those that stand out; None for every row.
    checked : bool
        True if the file has checksums; they were compared.
    """

    path: Path
    record: RunRecord
    table: Table
    log: tuple[Event, ...]
    whole: bool
    metadata: Mapping[str, str]
    rate_Hz: float | None = None
    checked: bool = True

    @property
    def period_s(self) -> float:
        """Control period, s."""
        return float(self.record.scenario["controller"]["period_s"])

    @property
    def simulated_s(self) -> float:
        """Time that its rows cover, s."""
        return len(self.every_tick) * self.period_s

    @cached_property
    def every_tick(self) -> Table:
        """A row a tick: where the file does not keep every one, each is held until the next."""
        return held(self.table, self.period_s) if self.rate_Hz else self.table


def read(path: Path) -> Reviewed:
    """Read a telemetry file, a recording, or what a killed process left of either.

    Raises
    ------
    InputError
        There is none, it is none of these, or not a row of it is whole.
    """
    found = leavings.found(path)
    try:
        if found.suffix in leavings.RECORDINGS or leavings.is_recording(found):
            return _of_recording(found)
        if found.is_dir():
            with leavings.joined(found) as joined:
                table, metadata = read_parquet(joined)
            return _of_telemetry(found, table, metadata, whole=False, checked=leavings.are_checked(found))
        table, metadata = read_parquet(found)
        return _of_telemetry(found, table, metadata, whole=True, checked=has_checksums(found))
    except KeyError as error:
        raise InputError(
            f"review {found}: expected the file of a run, received one without {shown(error.args[0])}"
        ) from None
    except (ValueError, TypeError, AttributeError, OverflowError, RecursionError):
        raise InputError(
            f"review {found}: expected the file of a run, received one that cannot be read"
        ) from None


def _of_telemetry(
    path: Path, table: Table, metadata: dict[str, str], *, whole: bool, checked: bool
) -> Reviewed:
    _check_times(path, table)
    rate_Hz = float(metadata[_RATE]) if _RATE in metadata else None
    try:
        record = RunRecord.from_metadata(metadata)
    except InputError as error:
        raise InputError(f"review {path}: {error}") from None
    return Reviewed(path, record, table, (), whole, metadata, rate_Hz, checked)


def _of_recording(path: Path) -> Reviewed:
    from spheretwin.viz.reading import reading  # Rerun is slow to import
    from spheretwin.viz.recording.parts.described import RATE

    facts, table, log, whole, checked = reading.read(path)
    _check_times(path, table)
    statuses = {status.told: status for status in Status}
    scenario, status = _scenario(facts), statuses.get(log[-1][2] if log else "")
    period_s = float(scenario["controller"]["period_s"])
    ticks = int(ticks_of(table, period_s)[-1]) + 1 if len(table) else 0
    journal = logged(log, scenario, period_s, ticks)
    record = RunRecord(scenario, journal, ticks, {}, facts["versions"], status)
    rate_Hz, metadata = facts.get(RATE), record.metadata()
    if rate_Hz:
        metadata = {**metadata, _RATE: repr(rate_Hz)}
    return Reviewed(path, record, table, tuple(log), whole, metadata, rate_Hz, checked)


def _check_times(path: Path, table: Table) -> None:
    """Refuse rows out of their order: only damage makes them so."""
    t_s = table["t_s"]
    if not (np.all(np.isfinite(t_s)) and np.all(t_s[1:] > t_s[:-1])):
        raise InputError(f"review {path}: expected rows whose times rise, received others: it is damaged")


def _scenario(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Scenario by section, as JSON has it, from what a recording says of it."""
    sections = json.loads(json.dumps(facts["sections"]))
    return {"name": facts["name"], "description": facts["description"], **sections.pop("run"), **sections}
