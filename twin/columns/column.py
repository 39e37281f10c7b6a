"""Columns that a stage of the loop adds to the telemetry where it does something."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from spheretwin.models.telemetry.signals import Signal
from spheretwin.twin.scenario.sections import Scenario


class Columns(NamedTuple):
    """What one stage logs."""

    signals: Callable[[int], tuple[Signal, ...]]
    """For an actuator with a number of coil groups; the same tuple for the same number."""
    logged: Callable[[Scenario], bool]
    """Whether a run of a resolved scenario has them."""
    write: Any
    """``write(row, controller, sensors, plant)`` writes them into the beginning of `row`, once a tick, after
    the plant has moved. Made with `part_of_its_caller`: it becomes a part of the loop's machine code."""
