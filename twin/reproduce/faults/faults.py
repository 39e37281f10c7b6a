"""The nutation with parts that fail in mid-flight, and what controller, detector and watchdog make of it."""

from __future__ import annotations

from spheretwin.twin.reproduce.experiment import Experiment, Finding, Outcomes, Section
from spheretwin.twin.reproduce.faults import by_groups, by_part, engines, latency, why
from spheretwin.twin.reproduce.faults.by_groups import few
from spheretwin.twin.reproduce.faults.conditions.cases import cases
from spheretwin.twin.reproduce.faults.conditions.ways import OF_GROUPS
from spheretwin.twin.reproduce.faults.found import keep, more, tracks


def tell(outcomes: Outcomes) -> list[Section]:
    """Open groups, detection, why some sets do not track, all other parts, and the other engine."""
    return [
        by_groups.section(outcomes),
        latency.section(outcomes),
        why.section(outcomes),
        by_part.section(outcomes),
        engines.section(outcomes),
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """How many of the runs with one or two open groups track, for each way to meet them."""
    told = []
    for way in OF_GROUPS:
        runs = few(outcomes, way)
        if runs:
            told.append(f"{way.name} {[tracks(run) for run in runs].count(True)} of {len(runs)}")
    return [Finding(None, f"runs that track with one or two groups open: {', '.join(told)}")] if told else []


EXPERIMENT = Experiment(
    name="faults",
    title="Parts that fail in mid-flight",
    shows="The nutation (59) under AFSM with m = 0.2 and L = 1; from a time on that is drawn over the whole"
    " run, coil groups are open, or a sensor, the supply or the controller fails.",
    cases=cases,
    tell=tell,
    keep=keep,
    more=more,
    findings=findings,
)
