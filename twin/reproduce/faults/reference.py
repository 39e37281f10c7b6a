"""The run that a faulty one is held against: the same seed and hardware, with nothing that fails."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.supervision.detector import DetectorSection
from spheretwin.control.supervision.watchdog import WatchdogSection
from spheretwin.models.actuator import Actuator
from spheretwin.models.design.capability import torque_matrices
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.reproduce.faults.conditions.cases import FAULT_s
from spheretwin.twin.reproduce.faults.left import Left, left
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.simulation import simulate

Array = NDArray[np.float64]

PATH_TICKS = 10
"""Of the path, one control tick in so many is looked at: every 10 ms, in which the rotor turns by some 4°."""


class Reference(NamedTuple):
    """What remains of a healthy run."""

    largest_rad: float
    after_rad: float
    """Largest error from `FAULT_s` on."""
    q: Array
    """(n, 3) rad: poses from `FAULT_s` on."""
    torque_S: Array
    """(n, 3) N·m: what the coils gave there."""
    actuator: Actuator
    limit_A: float


def healthy(scenario: Scenario) -> Scenario:
    """A scenario with nothing that fails, or looks after what may."""
    return scenario.model_copy(
        update={
            "fault": (),
            "detector": DetectorSection(),
            "watchdog": WatchdogSection(),
            "allocation": "least_norm",
        }
    )


@cache
def reference(scenario: Scenario) -> Reference:
    """Run a healthy scenario; each is run once."""
    run = simulate(scenario)
    table = run.telemetry
    path = table["t_s"] >= first_s(scenario)
    return Reference(
        largest_rad=largest(table),
        after_rad=largest(table, scenario),
        q=table["q_rad"][path][::PATH_TICKS].copy(),
        torque_S=table["torque_Nm"][path][::PATH_TICKS].copy(),
        actuator=run.actuator,
        limit_A=run.actuator.group.current_limit_A,
    )


@lru_cache(maxsize=1024)
def left_by(scenario: Scenario, opened: Sequence[int]) -> Left:
    """What is left along the path of a healthy scenario without some groups; the ways of a set share it."""
    path = reference(scenario)
    return left(torque_matrices(path.q, path.actuator), path.torque_S, path.limit_A, opened)


def largest(table: Table, since: Scenario | None = None) -> float:
    """Largest error of any hinge, of the whole run or from the fault on, rad; no number where none is."""
    error = table["error_rad"]
    if since is not None:
        error = error[table["t_s"] >= first_s(since)]
    return float(np.abs(error).max()) if len(error) else float("nan")


def first_s(scenario: Scenario) -> float:
    """Time that all ticks from the fault on are at or after, whatever rounding does to theirs."""
    return FAULT_s - scenario.controller.period_s / 2
