"""Whether the fast plant can be believed: the first row and a hundredth of the others are run on MuJoCo too.

Both plants run the same loop, so that the root mean square of the error of a run is the same but for
rounding where the law is smooth. Where sgn(s) chatters, a sign that rounding decides moves it by some
thousandths; where a run is lost, both lose it, but not at the same tick.
"""

from __future__ import annotations

import numpy as np

from spheretwin.metrics import PlannedRun, RmsError
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.telemetry.status import Status
from spheretwin.simulation import follow
from spheretwin.study.grid import Row
from spheretwin.study.row import Rows, follower
from spheretwin.study.study import FAST, FULL

EVERY = 100

BOUND = 0.02
"""Largest difference of the rms error of any hinge, of the largest of the three."""


Ending = tuple[Status, list[float]]
"""How a run ended, and the rms error of each hinge, rad."""


def is_checked(row: Row) -> bool:
    """Whether a row is one of those that are run twice: decided by its key, so at random, and for ever."""
    return row.number == 0 or int(row.key, 16) % EVERY == 0


def check(rows: Rows, row: Row) -> None:
    """Run a row on both plants and compare.

    Raises
    ------
    SpheretwinError
        They end otherwise, or differ by more than `BOUND`.
    """
    if rows.scenario(row).plant.engine != FAST or not rows.chooses_plant:
        return
    compare(
        f"study {rows.study.name}: expected row {row.number}",
        _rms(rows, row, FAST),
        _rms(rows, row, FULL),
        "fast = false runs it on MuJoCo alone",
    )


def compare(expected: str, ours: Ending, theirs: Ending, way_out: str) -> float:
    """Hold a run on the Lagrangian against the same on MuJoCo; returns how far they are apart.

    Parameters
    ----------
    expected : str
        Who expects it of what, for the complaint.
    ours, theirs : Ending
    way_out : str
        What to do where they differ, for the same.

    Raises
    ------
    SpheretwinError
        They end otherwise, or both complete and differ by more than `BOUND`.
    """
    apart = _apart(ours[1], theirs[1]) if ours[0] == theirs[0] == Status.COMPLETED else 0.0
    if ours[0] != theirs[0] or not apart <= BOUND:
        raise SpheretwinError(
            f"{expected} to be the same on both plants within {BOUND:g}, received {_ending_text(ours)} on the"
            f" Lagrangian and {_ending_text(theirs)} on MuJoCo; {way_out}"
        )
    return apart


def _rms(rows: Rows, row: Row, engine: str) -> Ending:
    scenario = rows.scenario(row, engine)
    with rows.session(scenario) as session:
        metric = RmsError(PlannedRun(session.begun_as, session.actuator, scenario.ticks))
        status = follow(session, scenario.ticks, [follower({"rms_error_rad": metric})])
        return status, metric.value() or []


def _apart(ours: list[float], theirs: list[float]) -> float:
    largest = max(np.max(ours), np.max(theirs))
    return float(np.max(np.abs(np.subtract(ours, theirs))) / largest) if largest > 0 else 0.0


def _ending_text(found: Ending) -> str:
    return f"{found[0]} with {', '.join(f'{each:.6g}' for each in found[1])} rad"
