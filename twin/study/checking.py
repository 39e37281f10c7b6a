"""What can be found out about a study before its first row."""

from __future__ import annotations

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import shown
from spheretwin.twin.study import table
from spheretwin.twin.study.grid import Grid
from spheretwin.twin.study.row import Rows

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
