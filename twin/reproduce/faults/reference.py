"""Reference of a faulty run: the same seed, hardware and allocation, without the fault."""

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
from spheretwin.twin.reproduce.faults.left import Left, left
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.simulation import simulate

Array = NDArray[np.float64]

PATH_TICKS = 10
"""Interval of the poses on the path: 10 ms, in which the rotor turns by some 4°."""


class Reference(NamedTuple):
    """Arrays of a healthy run, one row a control tick."""

    error_rad: Array
    """(n, 3) rad: tracking error"""
    q: Array
    """(n, 3) rad"""
    torque_S: Array
    """(n, 3) N·m: torque of the coils"""
    actuator: Actuator
    limit_A: float


def healthy(scenario: Scenario) -> Scenario:
    """Return the same scenario with neither faults, detector nor watchdog."""
    return scenario.model_copy(
        update={"fault": (), "detector": DetectorSection(), "watchdog": WatchdogSection()}
    )


@cache
def reference(scenario: Scenario) -> Reference:
    """Run a healthy scenario; each is run once."""
    run = simulate(scenario)
    table = run.telemetry
    return Reference(
        error_rad=table["error_rad"].copy(),
        q=table["q_rad"].copy(),
        torque_S=table["torque_Nm"].copy(),
        actuator=run.actuator,
        limit_A=run.actuator.group.current_limit_A,
    )


@lru_cache(maxsize=1024)
def left_by(scenario: Scenario, opened: Sequence[int], first: int) -> Left:
    """Return what some open groups leave along the path of a healthy scenario, from a tick to the end."""
    path = reference(scenario)
    rows = slice(first, None, PATH_TICKS)
    return left(torque_matrices(path.q[rows], path.actuator), path.torque_S[rows], path.limit_A, opened)


def start_tick(scenario: Scenario) -> int:
    """Return the control tick of the first fault; 0 for a healthy scenario."""
    starts = [fault.start_s for fault in scenario.fault]
    return round(min(starts, default=0.0) / scenario.controller.period_s)


def largest(error_rad: Array) -> float:
    """Return the largest error of any hinge over a window (n, 3); NaN for an empty one."""
    return float(np.abs(error_rad).max()) if len(error_rad) else float("nan")
