"""Agreement of the plants: the first row and a hundredth of the others run on MuJoCo too.

Both plants run the same loop, so that the RMS error of a run under a smooth law differs by rounding
alone. If sgn(s) chatters, rounding may decide a sign, which moves it by some thousandths. If a run is lost,
both plants lose it, at different ticks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.telemetry.status import Status, named
from spheretwin.study.grid import Row
from spheretwin.study.row import Rows
from spheretwin.study.study import FAST, FULL

EVERY = 100

BOUND = 0.02
"""Largest difference of the rms error of any hinge, of the largest of the three."""


RMS_ERROR = "rms_error_rad"

Ending = tuple[Status, list[float]]
"""Status of a run, and the rms error of each hinge, rad."""


def is_checked(row: Row) -> bool:
    """True if a row runs on both plants; its key decides, so that the choice is random but fixed."""
    return row.number == 0 or int(row.key, 16) % EVERY == 0


def has_both(rows: Rows, row: Row) -> bool:
    """True if a row runs on the fast plant and could run on the other one."""
    return rows.chooses_plant and rows.scenario(row).plant.engine == FAST


def check(rows: Rows, checked: Sequence[Row]) -> Iterator[Row]:
    """Run rows that have both plants on both and compare; yield each row that agrees.

    Raises
    ------
    SpheretwinError
        The statuses of a row differ, or its errors by more than `BOUND`.
    """
    ours, theirs = (_endings(rows, checked, engine) for engine in (FAST, FULL))
    for row, fast, full in zip(checked, ours, theirs, strict=True):
        expected = f"study {rows.study.name}: expected row {row.number}"
        compare(expected, fast, full, "fast = false runs it on MuJoCo alone")
        yield row


def compare(expected: str, ours: Ending, theirs: Ending, way_out: str) -> float:
    """Compare a run on the Lagrangian with the same run on MuJoCo; return their relative difference.

    Parameters
    ----------
    expected : str
        Start of the message.
    ours, theirs : Ending
    way_out : str
        What to do if they differ, for the message.

    Raises
    ------
    SpheretwinError
        Their statuses differ, or both complete and differ by more than `BOUND`.
    """
    difference = _difference(ours[1], theirs[1]) if ours[0] == theirs[0] == Status.COMPLETED else 0.0
    if ours[0] != theirs[0] or not difference <= BOUND:
        raise SpheretwinError(
            f"{expected} to be the same on both plants within {BOUND:g}, received {_ending_text(ours)} on the"
            f" Lagrangian and {_ending_text(theirs)} on MuJoCo; {way_out}"
        )
    return difference


def _endings(rows: Rows, checked: Sequence[Row], engine: str) -> list[Ending]:
    results = rows.with_metrics((RMS_ERROR,)).run(checked, engine)
    for result in results:
        if result.error is not None:
            raise SpheretwinError(result.error)
    return [(named(result.status), result.figures[RMS_ERROR] or []) for result in results]


def _difference(ours: list[float], theirs: list[float]) -> float:
    largest = max(np.max(ours), np.max(theirs))
    return float(np.max(np.abs(np.subtract(ours, theirs))) / largest) if largest > 0 else 0.0


def _ending_text(ending: Ending) -> str:
    return f"{ending[0]} with {', '.join(f'{error:.6g}' for error in ending[1])} rad"
