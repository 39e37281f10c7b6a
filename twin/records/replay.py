"""Replay of a run from its telemetry file: initial scenario, command journal, ticks, model and curves."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from spheretwin import scenario as scenarios
from spheretwin.control.laws import LAWS
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.user_code import file_of, is_reference
from spheretwin.models.telemetry.run_record import Change, RunRecord
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.records import provenance
from spheretwin.scenario import reading
from spheretwin.scenario.changes import EXTERNAL
from spheretwin.scenario.sections import Scenario


class RunPlan(NamedTuple):
    """Run to be carried out: scenario, ticks and journal."""

    scenario: Scenario
    ticks: int
    journal: tuple[Change, ...]
    first_tick: int = 0
    """Tick of the first row that the files contain."""


def read(path: Path) -> RunPlan:
    """Read the plan of a run from its telemetry file; the replayed run gives the same bytes.

    Raises
    ------
    InputError
        The file is not telemetry of a run, its law is not in a file, or a model or curve was changed.
    """
    _, metadata = read_parquet(path, rows=False)
    try:
        record = RunRecord.from_metadata(metadata)
    except InputError as error:
        raise InputError(f"replay {path}: {error}") from None
    try:
        return _plan(_with_moved_files(record, path.parent), str(path))
    except (KeyError, ValueError, TypeError, AttributeError, OverflowError, RecursionError):
        raise InputError(
            f"replay {path}: expected scenario, journal and ticks of a run, received others"
        ) from None


def _with_moved_files(record: RunRecord, folder: Path) -> RunRecord:
    """Return the record with files of `folder` instead of missing or changed files with the same digests."""
    moved = {}
    for path, dotted in provenance.files_of(dict(record.scenario), record.journal):
        expected, candidate = record.files.get(path), folder / Path(path).name
        is_gone = expected and provenance.digest(dotted, path) != expected
        if is_gone and provenance.digest(dotted, str(candidate)) == expected:
            moved[path] = str(candidate.resolve())

    def place(path: str, dotted: str) -> str:
        file = file_of(path) if is_reference(path) else path
        return moved.get(file, file) + path[len(file) :]

    return replace(
        record,
        scenario=reading.replace_files(copy.deepcopy(dict(record.scenario)), place),
        journal=tuple(
            change._replace(value=reading.replace_value_files(change.name, change.value, place))
            for change in record.journal
        ),
        files={moved.get(path, path): digest for path, digest in record.files.items()},
    )


def _plan(record: RunRecord, source: str) -> RunPlan:
    scenario = scenarios.from_record(record.scenario, source)
    for change in record.journal:
        if change.name == EXTERNAL:
            raise InputError(
                f"replay {source}: expected a run of the twin alone, received one with {change.value}"
            )
        if change.name == "controller.law" and change.value not in LAWS and not is_reference(change.value):
            raise InputError(
                f"replay {source}: expected changes to {', '.join(LAWS)}, received one to {change.value}"
                f" at tick {change.tick}, a law that the file does not contain"
            )
    if record.ticks <= record.first_tick:
        raise InputError(
            f"replay {source}: expected a run of at least one tick, received"
            f" {record.ticks - record.first_tick};"
            " the partial files of a killed run do not contain its length"
        )
    named = provenance.files_of(scenario.model_dump(mode="json"), record.journal)
    _check_files(named, record.files, source)
    return RunPlan(scenario, record.ticks, record.journal, record.first_tick)


def _check_files(named: Iterable[tuple[str, str]], digests: Mapping[str, str | None], source: str) -> None:
    for path, dotted in named:
        if path in digests and provenance.digest(dotted, path) != digests[path]:  # older files have none
            raise InputError(
                f"replay {source}: expected {dotted} {path} as it was at the start of the run,"
                " received a file that is missing or has changed"
            )
