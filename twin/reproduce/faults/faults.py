"""The nutation with parts that fail in mid-flight, and what controller, detector and watchdog make of it."""

from __future__ import annotations

from spheretwin.twin.reproduce.experiment import Experiment, Outcomes, Section
from spheretwin.twin.reproduce.faults import by_groups, by_part, engines, why
from spheretwin.twin.reproduce.faults.conditions.cases import FAULT_s, cases
from spheretwin.twin.reproduce.faults.found import keep, more


def tell(outcomes: Outcomes) -> list[Section]:
    """Open groups, why some sets do not track, all other parts, and the other engine."""
    return [
        by_groups.section(outcomes),
        why.section(outcomes),
        by_part.section(outcomes),
        engines.section(outcomes),
    ]


EXPERIMENT = Experiment(
    name="faults",
    title="Parts that fail in mid-flight",
    shows=f"The nutation (59) under AFSM with m = 0.2 and L = 1; from {FAULT_s:g} s on coil groups are open,"
    " or a sensor, the supply or the controller fails.",
    cases=cases,
    tell=tell,
    keep=keep,
    more=more,
)
