"""A study from its first row to its table: what is in the journal already is not run again."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from spheretwin.models.base.cache import sources_digest
from spheretwin.models.base.files import make_folder
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.versions import versions
from spheretwin.twin.records import facts
from spheretwin.twin.scenario import reading
from spheretwin.twin.study import agreement, journal, table, threads
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
    wanted = min(len(grid), limit or len(grid))
    with Journal(folder / journal.NAME, digest_of(rows), len(grid)) as kept:
        resumed = kept.done
        todo = [number for number in range(wanted) if not kept.has(number)]
        work = _Work(rows)
        done(wanted - len(todo), wanted)
        try:
            for finished, (row, result) in enumerate(_results(grid, todo, work, threads, stop_requested), 1):
                kept.add(row, result)
                done(wanted - len(todo) + finished, wanted)
        finally:
            table.write(folder / table.NAME, grid, kept, rows)
        failed = sum(result.status != Status.COMPLETED for _, result in kept.results())
        return Found(
            rows=kept.done,
            of=wanted,
            failed=failed,
            resumed=resumed,
            torn=kept.torn,
            checked=work.checked,
            wall_s=time.perf_counter() - started,
            table=folder / table.NAME,
        )


def digest_of(rows: Rows) -> str:
    """Digest of all that results depend on: study, scenario, files, sources and versions."""
    study, base = rows.study.model_dump(mode="json"), rows.base.model_dump(mode="json")
    named = dict(reading.named_files(base))
    for axis in rows.study.axis:
        for value in getattr(axis, "values", ()):
            named |= dict(reading.named_files(reading.alone(axis.field, value)))
    for law in rows.study.law:
        named |= dict(reading.named_files({"controller": dict(law)}))
    for reference in rows.study.metrics:
        if ".py:" in reference:
            named[reference.rpartition(":")[0]] = "metrics"
    files = {path: facts.digest(dotted, path) for path, dotted in named.items()}
    told = json.dumps([study, base, files, sources_digest(), versions()], sort_keys=True)
    return hashlib.sha256(told.encode()).hexdigest()


class _Work:
    """Runs a row; some of them on both plants."""

    def __init__(self, rows: Rows) -> None:
        self._rows, self.checked = rows, 0

    def __call__(self, row: Row) -> Result:
        result = self._rows.carried_out(row)
        if result.error is None and self._rows.chooses_plant and agreement.is_checked(row):
            agreement.check(self._rows, row)
            self.checked += 1
        return result


def _results(
    grid: Grid,
    todo: list[int],
    work: Callable[[Row], Result],
    count: int | None,
    stop_requested: Callable[[], bool],
) -> Iterator[tuple[Row, Result]]:
    return threads.carried_out((grid[number] for number in todo), work, count, stop_requested)


def _telemetry_folder(study: Study, folder: Path) -> Path | None:
    if not study.telemetry:
        return None
    make_folder(folder / TELEMETRY)
    return folder / TELEMETRY
