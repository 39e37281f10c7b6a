"""A run as its own file tells it, whichever kind of file: telemetry, recording, or what was left of one."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.record import RunRecord
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table, read_parquet
from spheretwin.twin.review import leavings
from spheretwin.twin.review.journal import logged
from spheretwin.viz.recording.parts.events import Event


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
        Its telemetry.
    log : tuple of Event
        Lines that were logged; of a telemetry file, which has no log, none.
    whole : bool
        Whether the file was closed.
    metadata : mapping of str
        The record as a telemetry file keeps it.
    """

    path: Path
    record: RunRecord
    table: Table
    log: tuple[Event, ...]
    whole: bool
    metadata: Mapping[str, str]

    @property
    def period_s(self) -> float:
        """Control period, s."""
        return float(self.record.scenario["controller"]["period_s"])

    @property
    def simulated_s(self) -> float:
        """Time that its rows cover, s."""
        return len(self.table) * self.period_s


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
            return _of_telemetry(found, table, metadata, whole=False)
        return _of_telemetry(found, *read_parquet(found), whole=True)
    except (KeyError, ValueError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise InputError(f"review {found}: expected the file of a run, {error!r}") from None


def _of_telemetry(path: Path, table: Table, metadata: dict[str, str], *, whole: bool) -> Reviewed:
    return Reviewed(path, RunRecord.from_metadata(metadata), table, (), whole, metadata)


def _of_recording(path: Path) -> Reviewed:
    from spheretwin.viz.reading import reading  # Rerun is slow to import

    facts, table, log, whole = reading.read(path)
    statuses = {status.told: status for status in Status}
    scenario, ticks = _scenario(facts), len(table)
    journal = logged(log, scenario, float(scenario["controller"]["period_s"]), ticks)
    status = statuses.get(log[-1][2] if log else "")
    record = RunRecord(scenario, journal, ticks, {}, facts["versions"], status)
    return Reviewed(path, record, table, tuple(log), whole, record.metadata())


def _scenario(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Scenario by section, as JSON has it, from what a recording says of it."""
    sections = json.loads(json.dumps(facts["sections"]))
    return {"name": facts["name"], "description": facts["description"], **sections.pop("run"), **sections}
