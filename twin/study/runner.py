"""A study from its first row to its table: what is in the journal already is not run again."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import NamedTuple

from spheretwin.models.base.errors import InputError, SpheretwinError, did_you_mean, shown
from spheretwin.models.base.files import make_folder
from spheretwin.models.telemetry.status import Status
from spheretwin.study import journal, table
from spheretwin.study.engines import ENGINES
from spheretwin.study.engines.engine import Engine, Order, Work
from spheretwin.study.grid import Grid
from spheretwin.study.journal import Journal, digest_of
from spheretwin.study.row import Rows
from spheretwin.study.study import Study

TRIED = 32
"""Rows of a law of which one at least has to make a scenario."""


def check(grid: Grid, rows: Rows) -> None:
    """Find out whether a study has rows that can be run, and a table that can be written.

    Some values of an axis may be out of range: their rows are refused one by one. Where all rows of a law
    are, as by a gain that it has not, the study is.

    Raises
    ------
    InputError
        A law has no such row, two columns of the table have one name, or there is no row whose telemetry is
        wanted.
    """
    study = rows.study
    table.check_names(rows)
    if beyond := [number for number in study.telemetry if number >= len(grid)]:
        raise InputError(
            f"study {study.name}: expected rows up to {len(grid) - 1} for telemetry, received {beyond[0]}"
        )
    for law in range(grid.laws):
        _check_law(grid, rows, law)


def _check_law(grid: Grid, rows: Rows, law: int) -> None:
    complaints: list[str] = []
    for row in grid.of_law(law, TRIED):
        try:
            rows.scenario(row)
        except InputError as error:
            complaints.append(str(error))
        else:
            return
    named = study_law["law"] if (study_law := next(grid.of_law(law, 1)).law) else rows.base.controller.law
    raise InputError(
        f"study {rows.study.name}: expected rows under {shown(named)} that make a scenario,"
        f" received none among {len(complaints)}; the first: {complaints[0]}"
    )


TELEMETRY = "telemetry"


class Found(NamedTuple):
    """What a study left.

    Attributes
    ----------
    rows : int
        Finished, those of earlier runs included.
    of : int
        Requested: the first rows up to the limit, and those behind it that were finished earlier.
    study_rows : int
        Of the whole study.
    failed : int
        Finished rows whose status is not ``completed``, or that lack a figure because a metric raised.
    resumed : int
        Rows that were in the journal already.
    torn : bool
        Whether the journal ended in a torn line, which was dropped.
    damaged : int
        Lines of the journal that were passed over, and their rows run again.
    checked : int
        Rows that were run on both plants.
    wall_s : float
    startup_s : float, optional
        Of it, what went by before the first row was finished: the engine's start, and what is read and
        compiled once. None where none was run.
    table : Path
    """

    rows: int
    of: int
    study_rows: int
    failed: int
    resumed: int
    torn: bool
    damaged: int
    checked: int
    wall_s: float
    startup_s: float | None
    table: Path


def run_study(
    study: Study,
    folder: Path,
    *,
    engine: str,
    address: str | None,
    threads: int | None,
    limit: int | None,
    done: Callable[[int, int], None],
    stop_requested: Callable[[], bool],
) -> Found:
    """Run a study, as `spheretwin.study.run` says."""
    started = time.perf_counter()
    chosen = _engine(engine, address)
    grid = Grid(study)
    make_folder(folder)
    rows = Rows(study, _telemetry_folder(study, folder))
    check(grid, rows)
    wanted = min(len(grid), limit or len(grid))
    with Journal(folder / journal.NAME, digest_of(rows), len(grid)) as kept:
        resumed, missing = kept.done(), wanted - kept.done(wanted)
        work = Work(rows)
        todo = (number for number in range(wanted) if not kept.has(number))
        order = Order(todo, missing, grid, work, threads, address, stop_requested)
        try:
            first = _fill(kept, resumed + missing, chosen, order, done)
        except BaseException:
            with suppress(SpheretwinError):  # what came first is told, as that the disk is full
                table.write(folder / table.NAME, grid, kept, rows)
            raise
        table.write(folder / table.NAME, grid, kept, rows)
        return Found(
            rows=kept.done(),
            of=resumed + missing,
            study_rows=len(grid),
            failed=sum(
                result.status != Status.COMPLETED or result.error is not None for _, result in kept.results()
            ),
            resumed=resumed,
            torn=kept.torn,
            damaged=kept.damaged,
            checked=len(work.checked),
            wall_s=time.perf_counter() - started,
            startup_s=None if first is None else first - started,
            table=folder / table.NAME,
        )


def _fill(
    kept: Journal, wanted: int, engine: Engine, order: Order, done: Callable[[int, int], None]
) -> float | None:
    """Run what the journal has not yet; returns when the first row was finished.

    Raises
    ------
    SpheretwinError
        One of the rows has shown that the others cannot be believed; those in flight are finished and kept.
    """
    work, asked = order.work, order.stop_requested
    finished = kept.done()
    done(finished, wanted)
    first = None
    stopping = order._replace(stop_requested=lambda: bool(work.faults) or asked())
    with closing(engine.run(stopping)) as results:
        for row, result in results:
            first = first or time.perf_counter()
            if result is not None:
                kept.add(row, result)
                finished += 1
                done(finished, wanted)
    if work.faults:
        raise work.faults[0]
    return first


def _engine(name: str, address: str | None) -> Engine:
    if name not in ENGINES:
        raise InputError(
            f"sweep: expected {', '.join(ENGINES)} as engine,"
            f" received {shown(name)}{did_you_mean(name, ENGINES)}"
        )
    if address is not None and not ENGINES[name].takes_address:
        able = [each for each, engine in ENGINES.items() if engine.takes_address]
        raise InputError(f"sweep: expected engine {', '.join(able)} for an address, received {name}")
    return ENGINES[name]


def _telemetry_folder(study: Study, folder: Path) -> Path | None:
    if not study.telemetry:
        return None
    make_folder(folder / TELEMETRY)
    return folder / TELEMETRY
