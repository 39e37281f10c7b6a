"""Run of a study: rows that are not in the journal, then the table."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import NamedTuple

from spheretwin.models.base.errors import InputError, SpheretwinError, shown, unknown_name
from spheretwin.models.base.files import make_folder
from spheretwin.study import journal, table
from spheretwin.study.engines import ENGINES
from spheretwin.study.engines.engine import Engine, Order, Work
from spheretwin.study.grid import Grid
from spheretwin.study.journal import Journal, digest_of
from spheretwin.study.relative import absolute
from spheretwin.study.row import Rows
from spheretwin.study.study import Study, load

CHECKED_ROWS = 32
"""Rows of a law of which at least one must make a scenario."""


def check(grid: Grid, rows: Rows) -> None:
    """Check that a study has rows that can be run, and a table that can be written.

    Some values of an axis may be out of range: their rows are refused one by one. If all rows of a law are
    refused, as with a gain that it does not have, the study is refused.

    Raises
    ------
    InputError
        A law has no such row, two columns of the table have one name, or a row whose telemetry is requested
        does not exist.
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
    for row in grid.of_law(law, CHECKED_ROWS):
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


class StudyResult(NamedTuple):
    """Result of a study.

    Attributes
    ----------
    rows : int
        Finished rows, including those of earlier runs.
    of : int
        Requested: the first rows up to the limit, and those behind it that were finished earlier.
    study_rows : int
        Of the whole study.
    failed : int
        Finished rows whose status is not ``completed``, or that lack a figure because a metric raised.
    resumed : int
        Rows of earlier runs.
    torn : bool
        Whether the journal ended in a torn line, which was dropped.
    damaged : int
        Damaged lines of the journal, whose rows were run again.
    checked : int
        Rows that were run on both plants.
    wall_s : float
    startup_s : float, optional
        Time until the first row was finished: start of the engine, files and compilation. None if no row was
        run.
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


def run(
    study: Study | str,
    out: Path | str | None = None,
    *,
    engine: str = "local",
    address: str | None = None,
    threads: int | None = None,
    limit: int | None = None,
    done: Callable[[int, int], None] = lambda rows, of: None,
    stop_requested: Callable[[], bool] = lambda: False,
) -> StudyResult:
    """Run a study.

    Parameters
    ----------
    study : Study or str
        Study, its shipped name, or the path of its TOML file.
    out : path, optional
        Folder of journal and table; ``NAME_study`` in the working folder unless given. Rows in a journal of
        the same study are not run again.
    engine : str
        ``local``, threads of this process, ``processes``, or ``ray``: the table does not depend on it.
        ``cuda``: a GPU, whose figures are the same within rounding.
    address : str, optional
        For ``ray``: ``auto``, ``HOST`` or ``HOST:PORT`` of a cluster that this machine is a node of; every
        node needs the same sources, versions and files. Without it a cluster on this machine is started for
        the study.
    threads : int, optional
        Rows at a time; number of cores unless given. The table does not depend on it.
    limit : int, optional
        Run only this number of first rows. The table includes later rows that were finished earlier.
    done : callable
        Receives the number of finished rows, and of all rows, after each row.
    stop_requested : callable
        After True the running rows are finished, and no other is started.

    Raises
    ------
    InputError
        The study, the scenario or the folder cannot be used.
    SpheretwinError
        A row differs between the plants, a file could not be written, or a cluster was lost; finished rows
        are stored.
    """
    started = time.perf_counter()
    study = absolute(load(study) if isinstance(study, str) else study)
    folder = Path(out) if out is not None else Path(f"{study.name}_study")
    chosen = _engine(engine, address)
    grid = Grid(study)
    make_folder(folder)
    rows = chosen.prepare(Rows(study, _telemetry_folder(study, folder)))
    check(grid, rows)
    planned = min(len(grid), limit or len(grid))
    with Journal(folder / journal.NAME, digest_of(rows), len(grid)) as stored:
        resumed, missing = stored.done(), planned - stored.done(planned)
        work = Work(rows)
        todo = (number for number in range(planned) if not stored.has(number))
        most = threads or chosen.threads
        order = Order(todo, missing, grid, work, most, address, stop_requested)
        try:
            first = _fill(stored, resumed + missing, chosen, order, done)
        except BaseException:
            with suppress(SpheretwinError):  # the first error is reported, as of a full disk
                table.write(folder / table.NAME, grid, stored, rows)
            raise
        failed = table.write(folder / table.NAME, grid, stored, rows)
        return StudyResult(
            rows=stored.done(),
            of=resumed + missing,
            study_rows=len(grid),
            failed=failed,
            resumed=resumed,
            torn=stored.torn,
            damaged=stored.damaged,
            checked=len(work.checked),
            wall_s=time.perf_counter() - started,
            startup_s=None if first is None else first - started,
            table=folder / table.NAME,
        )


def _fill(
    journal: Journal, planned: int, engine: Engine, order: Order, done: Callable[[int, int], None]
) -> float | None:
    """Run the missing rows; return the time at which the first one was finished.

    Raises
    ------
    SpheretwinError
        A row has a fault that affects all others; running rows are finished and stored.
    """
    work, interrupted = order.work, order.stop_requested
    finished = journal.done()
    done(finished, planned)
    first = None
    stopping = order._replace(stop_requested=lambda: bool(work.faults) or interrupted())
    with closing(engine.run(stopping)) as results:
        for row, result in results:
            first = first or time.perf_counter()
            if result is not None:
                journal.add(row, result)
                finished += 1
                done(finished, planned)
    if work.faults:
        raise work.faults[0]
    return first


def _engine(name: str, address: str | None) -> Engine:
    if name not in ENGINES:
        raise unknown_name("sweep", name, ENGINES, "{} as engine")
    if address is not None and not ENGINES[name].takes_address:
        able = [other for other, engine in ENGINES.items() if engine.takes_address]
        raise InputError(f"sweep: expected engine {', '.join(able)} for an address, received {name}")
    return ENGINES[name]


def _telemetry_folder(study: Study, folder: Path) -> Path | None:
    if not study.telemetry:
        return None
    make_folder(folder / TELEMETRY)
    return folder / TELEMETRY
