"""Whether the fast plant can be believed: the first row and a hundredth of the others are run on MuJoCo too.

Both plants run the same loop, so that the root mean square of the error of a run is the same but for
rounding where the law is smooth. Where sgn(s) chatters, a sign that rounding decides moves it by some
thousandths; where a run is lost, both lose it, but not at the same tick.
"""

from __future__ import annotations

import numpy as np

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.telemetry.status import Status
from spheretwin.twin.metrics.metric import Planned
from spheretwin.twin.metrics.tracking.rms_error import RmsError
from spheretwin.twin.simulation import follow
from spheretwin.twin.study.grid import Row
from spheretwin.twin.study.row import Rows, follower

EVERY = 100

BOUND = 0.02
"""Largest difference of the rms error of any hinge, of the largest of the three."""


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
    if rows.scenario(row).plant.engine != "lagrangian" or not rows.chooses_plant:
        return
    ours, theirs = _rms(rows, row, "lagrangian"), _rms(rows, row, "mujoco")
    same_end = ours[0] == theirs[0]
    if not (same_end and (ours[0] != Status.COMPLETED or _apart(ours[1], theirs[1]) <= BOUND)):
        raise SpheretwinError(
            f"study {rows.study.name}: expected row {row.number} to be the same on both plants within"
            f" {BOUND:g}, received {_told(ours)} on the Lagrangian and {_told(theirs)} on MuJoCo;"
            " fast = false runs it on MuJoCo alone"
        )


def _rms(rows: Rows, row: Row, engine: str) -> tuple[Status, list[float]]:
    scenario = rows.scenario(row, engine)
    with rows.session(scenario) as session:
        metric = RmsError(Planned(session.begun_as, session.actuator, scenario.ticks))
        status = follow(session, scenario.ticks, [follower({"rms_error_rad": metric})])
        return status, metric.value() or []


def _apart(ours: list[float], theirs: list[float]) -> float:
    largest = max(np.max(ours), np.max(theirs))
    return float(np.max(np.abs(np.subtract(ours, theirs))) / largest) if largest > 0 else 0.0


def _told(found: tuple[Status, list[float]]) -> str:
    return f"{found[0]} with {', '.join(f'{each:.6g}' for each in found[1])} rad"
