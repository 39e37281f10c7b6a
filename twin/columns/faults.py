"""What fails, and what the controller knows of it, where a scenario plans faults or looks for them."""

from __future__ import annotations

from functools import cache
from typing import Any

from numpy.typing import NDArray

from spheretwin.control.supervision.groups import IN_USE, STATES
from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.telemetry.signals import Signal
from spheretwin.twin.columns.column import Columns
from spheretwin.twin.faults.fault import MODES
from spheretwin.twin.faults.plan import part_names
from spheretwin.twin.scenario.sections import Scenario

NOT_YET = -1.0


@cache
def signals(groups: int) -> tuple[Signal, ...]:
    """Columns for a number of coil groups."""
    each = tuple(f"group {j}" for j in range(groups))
    names = part_names(groups)
    return (
        Signal("fault", "1", len(names), "how a part fails", names, ("works", *MODES)),
        Signal("group_out", "1", groups, "whether the allocation leaves a group out", each, STATES),
        Signal(
            "time_to_detection_s",
            "s",
            groups,
            "from the start of a group's fault until it was left out; -1 as long as it is not",
            each,
        ),
    )


@part_of_its_caller
def write(row: NDArray, controller: Any, sensors: Any, plant: Any) -> None:
    """Write the columns of one tick."""
    groups, parts = controller.supervision.groups, plant.marks.shape[0]
    count = groups.out.shape[0]
    for part in range(parts):
        row[part] = plant.marks[part]
    for j in range(count):
        out = groups.out[j]
        row[parts + j] = out
        known = out != IN_USE and plant.began_s[j] >= 0.0
        row[parts + count + j] = max(groups.out_s[j] - plant.began_s[j], 0.0) if known else NOT_YET


def _logged(scenario: Scenario) -> bool:
    return scenario.supervises_groups


COLUMNS = Columns(signals, _logged, write)
