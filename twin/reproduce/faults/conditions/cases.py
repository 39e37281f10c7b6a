"""The cases of the fault study: the nutation with m = 0.2 and L = 1, healthy and with every fault."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, zip_longest
from typing import Any

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Case
from spheretwin.twin.reproduce.faults.conditions.parts import Failure, failures
from spheretwin.twin.reproduce.faults.conditions.sets import Groups, drawn, pairs, singles
from spheretwin.twin.reproduce.faults.conditions.ways import OF_GROUPS, OF_PARTS, Way

FAULT_s = 1.0
"""When everything fails: in mid-flight. By then the error of a start from rest, which is larger than all that
follows, has died away, so that what is seen is the fault; the axis gyrates by 12° and widens on to 57°."""

SCENARIO = "nutation"
BASE: dict[str, Any] = {"disturbance.load": 1.0, "plant.engine": "lagrangian"}
"""m = 0.2 is the scenario's own."""

# Sensors, supply and watchdog are there on the prototype alone.
PROTOTYPE: dict[str, Any] = {**BASE, "hardware": "prototype"}
OTHER_ENGINE: dict[str, Any] = {"plant.engine": "mujoco"}

SAMPLE = 100
"""One set in so many runs on MuJoCo too."""

# Every end but that of numbers that are none.
ENDS = (Status.COMPLETED, Status.LEFT_WORKSPACE, Status.FAILSAFE)

HEALTHY = Case("healthy", SCENARIO, BASE, {"kind": "healthy", "groups": [], "way": None})
HEALTHY_PROTOTYPE = Case(
    "healthy prototype", SCENARIO, PROTOTYPE, {"kind": "healthy", "groups": [], "way": None}
)


def cases() -> list[Case]:
    """The healthy ones, then one of each kind in turn, in all its ways, as long as there are any."""
    kinds = [
        [[of_groups(groups, way) for way in OF_GROUPS] for groups in singles()],
        [[of_groups(groups, way) for way in OF_GROUPS] for groups in pairs()],
        [[of_groups(groups, way) for way in OF_GROUPS] for groups in drawn()],
        [[of_part(failure, way) for way in OF_PARTS] for failure in failures()],
        [[on_other_engine(groups, way) for way in OF_GROUPS] for groups in sample()],
    ]
    return [HEALTHY, HEALTHY_PROTOTYPE, *_in_turn(kinds)]


def of_groups(groups: Groups, way: Way) -> Case:
    """Open groups in one way."""
    kind = {1: "single", 2: "pair"}.get(len(groups), "drawn")
    return Case(
        name=f"{_named(groups)} open, {way.name}",
        scenario=SCENARIO,
        fields={**BASE, **way.fields, "fault": [_open(group, way) for group in groups]},
        told={"kind": kind, "groups": list(groups), "way": way.name},
        once=kind == "drawn",
        ends=ENDS,
    )


def on_other_engine(groups: Groups, way: Way) -> Case:
    """The same on MuJoCo."""
    case = of_groups(groups, way)
    return case._replace(
        name=f"{case.name}, MuJoCo",
        fields={**case.fields, **OTHER_ENGINE},
        told={**case.told, "kind": "MuJoCo"},
        once=True,
    )


def of_part(failure: Failure, way: Way) -> Case:
    """A failure of what all groups share, in one way."""
    fault = {"target": failure.part, "mode": failure.mode, "start_s": FAULT_s}
    if failure.value is not None:
        fault["value"] = failure.value
    return Case(
        name=f"{failure.name}, {way.name}",
        scenario=SCENARIO,
        fields={**PROTOTYPE, **way.fields, "fault": [fault]},
        told={
            "kind": "part",
            "groups": [],
            "way": way.name,
            "part": failure.part,
            "mode": failure.mode,
            "value": failure.value,
        },
        ends=ENDS,
    )


def sets() -> list[Groups]:
    """Every single group, every pair, every drawn set."""
    return [*singles(), *pairs(), *drawn()]


def sample() -> list[Groups]:
    """Sets that run on MuJoCo too."""
    return sets()[::SAMPLE]


def _open(group: int, way: Way) -> dict[str, Any]:
    return {"target": f"coil.{group:02d}", "mode": "open", "start_s": FAULT_s, **way.of_fault}


def _named(groups: Groups) -> str:
    return f"group{'s' if len(groups) > 1 else ''} {' '.join(map(str, groups))}"


def _in_turn(kinds: Sequence[Sequence[list[Case]]]) -> Iterator[Case]:
    """A limit leaves some of each kind."""
    for blocks in zip_longest(*kinds, fillvalue=[]):
        yield from chain.from_iterable(blocks)
