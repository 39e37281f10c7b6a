"""A study from its first row to its table: what is in the journal already is not run again."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from spheretwin.models.base.cache import sources_digest
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.base.files import make_folder
from spheretwin.models.base.user_code import file_of, is_reference
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.versions import versions
from spheretwin.twin.records import facts
from spheretwin.twin.scenario import reading
from spheretwin.twin.study import agreement, checking, journal, table
from spheretwin.twin.study import threads as pool
from spheretwin.twin.study.grid import Grid, Row
from spheretwin.twin.study.journal import Journal
from spheretwin.twin.study.row import Result, Rows
from spheretwin.twin.study.study import Study

TELEMETRY = "telemetry"


class Found(NamedTuple):
    """What a study left.

    Attributes
    ----------
    rows : int
        Finished, those of earlier runs included.
    of : int
        Wanted.
    failed : int
        Finished rows whose status is other than ``completed``.
    resumed : int
        Rows that were in the journal already.
    torn : bool
        Whether the journal ended in a torn line, which was dropped.
    damaged : int
        Lines of the journal that were passed over, and their rows run again.
    checked : int
        Rows that were run on both plants.
    wall_s : float
    table : Path
    """

    rows: int
    of: int
    failed: int
    resumed: int
    torn: bool
    damaged: int
    checked: int
    wall_s: float
    table: Path


def carried_out(
    study: Study,
    folder: Path,
    *,
    threads: int | None,
    limit: int | None,
    done: Callable[[int, int], None],
    stop_requested: Callable[[], bool],
) -> Found:
    """Run a study, as `spheretwin.twin.study.run` says."""
    started = time.perf_counter()
    grid = Grid(study)
    make_folder(folder)
    rows = Rows(study, _telemetry_folder(study, folder))
    checking.check(grid, rows)
    wanted = min(len(grid), limit or len(grid))
    with Journal(folder / journal.NAME, digest_of(rows), len(grid)) as kept:
        resumed = kept.done(wanted)
        work = _Work(rows)
        try:
            _fill(kept, grid, wanted, work, threads, done, stop_requested)
        except BaseException:
            with suppress(SpheretwinError):  # what came first is told, as that the disk is full
                table.write(folder / table.NAME, grid, kept, rows, wanted)
            raise
        table.write(folder / table.NAME, grid, kept, rows, wanted)
        return Found(
            rows=kept.done(wanted),
            of=wanted,
            failed=sum(result.status != Status.COMPLETED for _, result in kept.results(wanted)),
            resumed=resumed,
            torn=kept.torn,
            damaged=kept.damaged,
            checked=len(work.checked),
            wall_s=time.perf_counter() - started,
            table=folder / table.NAME,
        )


def _fill(
    kept: Journal,
    grid: Grid,
    wanted: int,
    work: _Work,
    threads: int | None,
    done: Callable[[int, int], None],
    stop_requested: Callable[[], bool],
) -> None:
    """Run what the journal has not yet.

    Raises
    ------
    SpheretwinError
        One of the rows has shown that the others cannot be believed; those in flight are finished and kept.
    """
    todo = (grid[number] for number in range(wanted) if not kept.has(number))
    finished = kept.done(wanted)
    done(finished, wanted)
    for row, result in pool.carried_out(todo, work, threads, lambda: bool(work.faults) or stop_requested()):
        if result is not None:
            kept.add(row, result)
            finished += 1
            done(finished, wanted)
    if work.faults:
        raise work.faults[0]


def digest_of(rows: Rows) -> str:
    """Digest of all that results depend on: study, scenario, files, sources and versions.

    Of a file, what is in it, not where it is: a study may be run from anywhere, and its folder may be moved.
    """
    study = rows.study.model_dump(mode="json", exclude={"description"})
    told = json.dumps([study, *_contents(rows), sources_digest(), versions()], sort_keys=True)
    return hashlib.sha256(told.encode()).hexdigest()


def _contents(rows: Rows) -> Iterator[Any]:
    """Values of the base and of what differs from row to row, with the content of each file for its path."""
    study = rows.study
    yield reading.with_files(rows.base.model_dump(mode="json"), _content)
    named = [(axis.field, value) for axis in study.axis for value in getattr(axis, "values", ())]
    named += [("controller", dict(law)) for law in study.law]
    for dotted, value in named:
        if isinstance(value, str | list | dict):  # a number names no file
            found = reading.alone(dotted, reading.value_beside(study.folder, dotted, value))
            yield reading.with_files(found, _content)
    for name in study.metrics:
        if is_reference(name):
            yield _content(study.beside(name), "metrics")


def _content(path: str, dotted: str) -> str:
    if is_reference(path):
        return f"{facts.digest(dotted, file_of(path))}:{path.rpartition(':')[2]}"
    return str(facts.digest(dotted, path))


class _Work:
    """Runs a row; some of them on both plants.

    Attributes
    ----------
    faults : list of SpheretwinError
        Why rows have no result: no fault of theirs.
    checked : list of int
        Rows that were run on both plants.
    """

    def __init__(self, rows: Rows) -> None:
        self._rows = rows
        self.faults: list[SpheretwinError] = []
        self.checked: list[int] = []

    def __call__(self, row: Row) -> Result | None:
        try:
            result = self._rows.carried_out(row)
            if result.error is None and self._rows.chooses_plant and agreement.is_checked(row):
                agreement.check(self._rows, row)
                self.checked.append(row.number)
        except SpheretwinError as error:
            self.faults.append(error)
            return None
        return result


def _telemetry_folder(study: Study, folder: Path) -> Path | None:
    if not study.telemetry:
        return None
    make_folder(folder / TELEMETRY)
    return folder / TELEMETRY
