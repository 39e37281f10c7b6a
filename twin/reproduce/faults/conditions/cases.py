"""The cases of the fault study: the nutation with m = 0.2 and L = 1, healthy and with every fault."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import chain, zip_longest
from typing import Any

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.reproduce.experiment import Case
from spheretwin.twin.reproduce.faults.conditions.parts import Failure, failures
from spheretwin.twin.reproduce.faults.conditions.sets import Groups, drawn, pairs, singles
from spheretwin.twin.reproduce.faults.conditions.ways import DETECTING, OF_GROUPS, OF_PARTS, Way
from spheretwin.twin.scenario.sections import Scenario

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
        [[shorted(groups, DETECTING)] for groups in singles()],
        [[on_other_engine(groups, way) for way in OF_GROUPS] for groups in sample()],
    ]
    return [HEALTHY, HEALTHY_PROTOTYPE, *_in_turn(kinds)]


def of_groups(groups: Groups, way: Way) -> Case:
    """Open groups in one way."""
    kind = {1: "single", 2: "pair"}.get(len(groups), "drawn")
    return _of_coils(groups, way, "open", kind)


def shorted(groups: Groups, way: Way) -> Case:
    """Groups shorted at their ends in one way."""
    return _of_coils(groups, way, "short", "short")


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
    fault: dict[str, Any] = {"target": failure.part, "mode": failure.mode}
    if failure.value is not None:
        fault["value"] = failure.value
    return Case(
        name=f"{failure.name}, {way.name}",
        scenario=SCENARIO,
        fields={**PROTOTYPE, **way.fields, **_planned([fault])},
        told={
            "kind": "part",
            "groups": [],
            "way": way.name,
            "part": failure.part,
            "mode": failure.mode,
            "value": failure.value,
        },
        ends=ENDS,
        drawn=lambda seed: _starts(1, start_s(failure.name, seed)),
    )


def sets() -> list[Groups]:
    """Every single group, every pair, every drawn set."""
    return [*singles(), *pairs(), *drawn()]


def sample() -> list[Groups]:
    """Sets that run on MuJoCo too."""
    return sets()[::SAMPLE]


def start_s(what: str, seed: int) -> float:
    """Return the start of a fault: a control tick of the run, drawn evenly from the seed.

    Parameters
    ----------
    what : str
        What fails. All ways and both engines share its start, so that they can be compared run by run.
    seed : int
    """
    scenario = _healthy()
    tick = np.random.default_rng([zlib.crc32(what.encode()), seed]).integers(scenario.ticks)
    return round(float(tick) * scenario.controller.period_s, 9)


@cache
def _healthy() -> Scenario:
    return scenarios.load(SCENARIO, BASE)


def _of_coils(groups: Groups, way: Way, mode: str, kind: str) -> Case:
    faults = [{"target": f"coil.{group:02d}", "mode": mode, **way.of_fault} for group in groups]
    return Case(
        name=f"{_named(groups)} {mode}, {way.name}",
        scenario=SCENARIO,
        fields={**BASE, **way.fields, **_planned(faults)},
        told={"kind": kind, "groups": list(groups), "way": way.name},
        once=kind == "drawn",
        ends=ENDS,
        drawn=lambda seed: _starts(len(groups), start_s(_named(groups), seed)),
    )


def _planned(faults: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Fields of faults whose starts are drawn."""
    return {f"fault.{i}.{name}": value for i, fault in enumerate(faults) for name, value in fault.items()}


def _starts(faults: int, time_s: float) -> dict[str, Any]:
    """Start of each fault of a run."""
    return {f"fault.{i}.start_s": time_s for i in range(faults)}


def _named(groups: Groups) -> str:
    return f"group{'s' if len(groups) > 1 else ''} {' '.join(map(str, groups))}"


def _in_turn(kinds: Sequence[Sequence[list[Case]]]) -> Iterator[Case]:
    """A limit leaves some of each kind."""
    for blocks in zip_longest(*kinds, fillvalue=[]):
        yield from chain.from_iterable(blocks)
