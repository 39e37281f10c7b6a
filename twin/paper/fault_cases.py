"""Cases of the fault study: the nutation with m = 0.2 and L = 1, healthy and with every fault."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import chain, combinations, zip_longest
from math import tau
from typing import Any, NamedTuple

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.faults.targets import TARGETS
from spheretwin.models import actuator
from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import Case, Outcomes, RunOutcome
from spheretwin.paper.experiment_file import CaseRuns, ExperimentFile
from spheretwin.scenario.hardware import PROTOTYPE_DRIVE, PROTOTYPE_SENSORS
from spheretwin.scenario.sections import Scenario

FILE = ExperimentFile("faults")

COUNT_rad = tau / PROTOTYPE_SENSORS["sensors.encoder.counts"]
SUPPLY_V = PROTOTYPE_DRIVE["drive.supply_V"]

# Values that a laboratory may meet, large compared with the healthy part.
VALUES: dict[tuple[str, str], tuple[float, str]] = {
    ("pot", "offset"): (0.02, " rad"),  # a slip of a degree on the shaft, some 60 times the nonlinearity
    ("pot", "gain"): (0.9, ""),  # a tenth of the supply of the track is gone
    ("pot", "noise"): (0.01, " rad"),  # a worn track, some 30 times the healthy noise
    ("encoder", "offset"): (10 * COUNT_rad, " rad"),  # ten lost counts
    ("encoder", "gain"): (0.5, ""),  # every second line is missed
    ("encoder", "noise"): (COUNT_rad, " rad"),  # a count
    ("adc", "offset"): (0.1, " V"),  # a drift of its reference, 100 times the healthy offset; 0.1 rad
    ("adc", "gain"): (0.9, ""),  # a tenth of its reference
    ("adc", "noise"): (0.01, " V"),  # an open shield, some 130 times the healthy noise; 0.01 rad
    ("adc", "delay"): (5e-3, " s"),  # five control periods
    ("supply", "offset"): (-SUPPLY_V / 2, " V"),
    ("supply", "gain"): (0.5, ""),  # half of the cells
    ("supply", "noise"): (SUPPLY_V / 10, " V"),  # a dry capacitor
    ("controller", "delay"): (5e-3, " s"),  # five control periods
}
"""With their units."""


class Failure(NamedTuple):
    """One mode of one part."""

    part: str
    mode: str
    value: float | None
    """None if the mode has none, or has a default."""
    unit: str

    @property
    def name(self) -> str:
        """Part, mode and value."""
        return f"{self.part} {self.mode}" + ("" if self.value is None else f" {self.value:.3g}{self.unit}")


def failures() -> list[Failure]:
    """Modes of the parts that all groups share, if a mode needs no value or has one in `VALUES`."""
    return [
        Failure(part, mode, *VALUES.get((target.name, mode), (None, "")))
        for target in TARGETS.values()
        if not target.each_group
        for part in target.names(0)
        for mode, what in target.modes.items()
        if (target.name, mode) in VALUES or what.value is None or what.value.default is not None
    ]


Groups = tuple[int, ...]
"""Numbers of the open groups, rising."""

RANDOM_SETS = 2000
SIZES = tuple(range(3, 10))
"""Sizes of the random sets; each has as many sets as any other, but for one."""
SEED = 18


@cache
def random_groups() -> tuple[Groups, ...]:
    """Random sets, size after size in turn; no two are the same."""
    random = np.random.default_rng(SEED)
    chosen: dict[Groups, None] = {}
    while len(chosen) < RANDOM_SETS:
        size = SIZES[len(chosen) % len(SIZES)]
        groups = random.choice(count(), size, replace=False)
        chosen[tuple(sorted(int(group) for group in groups))] = None
    return tuple(chosen)


@cache
def singles() -> tuple[Groups, ...]:
    """Sets of one group."""
    return tuple((group,) for group in range(count()))


@cache
def pairs() -> tuple[Groups, ...]:
    """Sets of two groups."""
    return tuple(combinations(range(count()), 2))


@cache
def count() -> int:
    """Number of coil groups of the actuator."""
    return len(actuator.load().groups)


class Way(NamedTuple):
    """Treatment of a fault: what reports it, and the allocation or watchdog."""

    name: str
    of_fault: Mapping[str, Any] = {}
    """Fields of every fault."""
    fields: Mapping[str, Any] = {}
    """Fields of the scenario."""


UNREPORTED = Way("not reported")
REPORTED = Way("reported", {"reported_to_controller": True})
DETECTING = Way("detecting", {"detection": True})
BOUNDED = Way("reported, bounded", {"reported_to_controller": True}, {"allocation": "bounded"})

OF_GROUPS = (UNREPORTED, REPORTED, DETECTING, BOUNDED)
"""For open groups: they are not reported, reported to the allocation, or detected. The last way reports
them to the allocation that uses all that the current limit allows."""

LATENCY_LAWS = ("afsm", "afsm_eso")
"""Laws of the distribution of the detection latency: it depends on what the law commands to each group."""

SEEDS = 200
"""Starts of each group for this distribution, whose tail is rare."""

ALONE = Way("no watchdog", fields={"watchdog.on": False})
RELEASE = Way("release", fields={"watchdog.on": True, "watchdog.action": "release"})
BRAKE = Way("short", fields={"watchdog.on": True, "watchdog.action": "short"})

OF_PARTS = (ALONE, RELEASE, BRAKE)
"""For parts that all groups share: no watchdog, or one by its action."""


SCENARIO = "nutation"
BASE: dict[str, Any] = {"disturbance.load": 1.0, "plant.engine": "lagrangian"}
"""m = 0.2 is the scenario's own."""

# Only the hardware set of the electronics has sensors, supply and watchdog.
ELECTRONICS: dict[str, Any] = {**BASE, "hardware": "electronics"}
OTHER_ENGINE: dict[str, Any] = {"plant.engine": "mujoco"}

SAMPLE = 100
"""One of this number of sets also runs on MuJoCo."""

# Every status but that of diverged numbers.
EXPECTED = (Status.COMPLETED, Status.LEFT_WORKSPACE, Status.FAILSAFE)


def _healthy_case(name: str, fields: Mapping[str, Any]) -> Case:
    details: dict[str, Any] = {"kind": "healthy", "groups": [], "way": None}
    return Case(name, SCENARIO, fields, details, columns=details)


HEALTHY = _healthy_case("healthy", BASE)
HEALTHY_ELECTRONICS = _healthy_case("healthy electronics", ELECTRONICS)


class FaultRuns:
    """Cases that were run, by their columns: kind, groups, way, failure, law."""

    def __init__(self, outcomes: Outcomes) -> None:
        self._by_kind: dict[str, list[CaseRuns]] = {}
        for case in cases():
            if runs := outcomes.runs(case):
                self._by_kind.setdefault(case.columns["kind"], []).append(CaseRuns(case, runs))

    def of(self, *kinds: str, **columns: Any) -> list[CaseRuns]:
        """Return the cases of some kinds, kind by kind, with some columns."""
        every = (item for kind in kinds for item in self._by_kind.get(kind, ()))
        return [item for item in every if columns.items() <= item.case.columns.items()]

    def runs(self, *kinds: str, **columns: Any) -> list[RunOutcome]:
        """Return the runs of the cases `of` some kinds with some columns."""
        return [run for item in self.of(*kinds, **columns) for run in item.runs]


FEW = ("single", "pair")
COILS = (*FEW, "drawn")
"""Kinds of one or two open groups, and of any number."""
KINDS = ("healthy", *COILS, "part", "short", "latency", "MuJoCo")


@cache
def cases() -> list[Case]:
    """Healthy cases, then one of each kind in turn, in all its ways."""
    kinds = [
        [[of_groups(groups, way) for way in OF_GROUPS] for groups in singles()],
        [[of_groups(groups, way) for way in OF_GROUPS] for groups in pairs()],
        [[of_groups(groups, way) for way in OF_GROUPS] for groups in random_groups()],
        [[of_part(failure, way) for way in OF_PARTS] for failure in failures()],
        [[shorted(groups, DETECTING)] for groups in singles()],
        [[of_latency(groups, law) for law in LATENCY_LAWS] for groups in singles()],
        [[on_other_engine(groups, way) for way in OF_GROUPS] for groups in sample()],
    ]
    return [HEALTHY, HEALTHY_ELECTRONICS, *_in_turn(kinds)]


def of_groups(groups: Groups, way: Way) -> Case:
    """Case of open groups in one way."""
    kind = {1: "single", 2: "pair"}.get(len(groups), "drawn")
    return _of_coils(groups, way, "open", kind)


def shorted(groups: Groups, way: Way) -> Case:
    """Case of groups with shorted ends in one way."""
    return _of_coils(groups, way, "short", "short")


def of_latency(groups: Groups, law: str) -> Case:
    """Case of open groups under a law, with many starts."""
    case = _of_kind("latency", of_groups(groups, DETECTING), f"{law}, latency", {"controller.law": law})
    return case._replace(columns={**case.columns, "law": law}, seeds=SEEDS)


def on_other_engine(groups: Groups, way: Way) -> Case:
    """Case of open groups in one way, on MuJoCo."""
    return _of_kind("MuJoCo", of_groups(groups, way), "MuJoCo", OTHER_ENGINE)._replace(single_run=True)


def _of_kind(kind: str, case: Case, name: str, fields: Mapping[str, Any]) -> Case:
    """Case of another kind, with further fields."""
    return case._replace(
        name=f"{case.name}, {name}",
        fields={**case.fields, **fields},
        details={**case.details, "kind": kind},
        columns={**case.columns, "kind": kind},
    )


def of_part(failure: Failure, way: Way) -> Case:
    """Case of a failure of a part that all groups share, in one way."""
    fault: dict[str, Any] = {"target": failure.part, "mode": failure.mode}
    if failure.value is not None:
        fault["value"] = failure.value
    return Case(
        name=f"{failure.name}, {way.name}",
        scenario=SCENARIO,
        fields={**ELECTRONICS, **way.fields, **_planned([fault])},
        details={
            "kind": "part",
            "groups": [],
            "way": way.name,
            "part": failure.part,
            "mode": failure.mode,
            "value": failure.value,
        },
        columns={"kind": "part", "way": way.name, "failure": failure.name},
        expected_statuses=EXPECTED,
        seeded_fields=lambda seed: _starts(1, start_s(failure.name, seed)),
    )


def sets() -> list[Groups]:
    """Sets of one group, of two groups and random sets."""
    return [*singles(), *pairs(), *random_groups()]


def sample() -> list[Groups]:
    """Sets that also run on MuJoCo."""
    return sets()[::SAMPLE]


def start_s(what: str, seed: int) -> float:
    """Return the start of a fault: a random control tick of the run, uniform.

    Parameters
    ----------
    what : str
        Name of the failed part. All ways and both engines share its start, so that runs can be
        compared one by one.
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
        details={"kind": kind, "groups": list(groups), "way": way.name},
        columns={"kind": kind, "groups": groups, "way": way.name},
        single_run=kind == "drawn",
        expected_statuses=EXPECTED,
        seeded_fields=lambda seed: _starts(len(groups), start_s(_named(groups), seed)),
    )


def _planned(faults: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Fields of faults without their random starts."""
    return {f"fault.{i}.{name}": value for i, fault in enumerate(faults) for name, value in fault.items()}


def _starts(faults: int, time_s: float) -> dict[str, Any]:
    """Start of each fault of a run."""
    return {f"fault.{i}.start_s": time_s for i in range(faults)}


def _named(groups: Groups) -> str:
    return f"group{'s' if len(groups) > 1 else ''} {' '.join(map(str, groups))}"


def _in_turn(kinds: Sequence[Sequence[list[Case]]]) -> Iterator[Case]:
    """Alternate the kinds, so that a limit leaves some of each."""
    for blocks in zip_longest(*kinds, fillvalue=[]):
        yield from chain.from_iterable(blocks)
