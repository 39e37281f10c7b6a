"""Detection latency of failed groups as a distribution, and the tracking error that the delay costs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from math import inf
from typing import Any, NamedTuple

import numpy as np

from spheretwin.paper import fault_cases as cases
from spheretwin.paper.cells import NONE, Numbers, table
from spheretwin.paper.experiment import ExperimentSection, RunOutcome
from spheretwin.paper.experiment_file import BY_LAW
from spheretwin.paper.fault_cases import FEW, FILE, FaultRuns
from spheretwin.paper.fault_outcomes import tracks
from spheretwin.paper.fault_sections import percent
from spheretwin.study.statistics import quantile_text, share_interval
from spheretwin.viz.pages.markdown import Drawing

EDGES_ms = (0.0, 6.5, 20.5, 100.5, inf)
"""Between intervals of latency, halfway between control ticks."""


class Detection(NamedTuple):
    """Detection of one failed group."""

    run: int
    """Number of its run: groups of a run share the start."""

    latency_s: float
    """Infinite if it is not detected."""
    driven_ticks: int


Pairs = Sequence[tuple[RunOutcome, RunOutcome]]
"""Runs of the same faults, detected and reported."""


def section(faults: FaultRuns) -> ExperimentSection:
    """Distribution of the latency, its reason, and its cost."""
    by_kind = {kind: detections for kind, detections in _detections(faults).items() if detections}
    pairs = _pairs(faults)
    costs = [(_named(*interval), _within(pairs, *interval)) for interval in _intervals()]
    tables = [
        table("Detection latency of failed groups", by_kind.items(), LATENCY),
        FILE.table("cost", [cost for cost in costs if cost[1]], **COST),
    ]
    drawings = [lambda: _draw(by_kind)] if by_kind else []
    return FILE.section("latency", tables, drawings, f"{_why(by_kind)}{_verdict(pairs)}")


def _detections(faults: FaultRuns) -> dict[str, list[Detection]]:
    """Detections by the kind of fault."""
    kinds = {f"one open, {BY_LAW[law].label}": faults.runs("latency", law=law) for law in cases.LATENCY_LAWS}
    several = {"two open": "pair", "three to nine open": "drawn", "one shorted": "short"}
    kinds |= {name: faults.runs(kind, way=cases.DETECTING.name) for name, kind in several.items()}
    return {
        name: [detection for number, run in enumerate(runs) for detection in _of_run(run, number)]
        for name, runs in kinds.items()
    }


def _draw(by_kind: Mapping[str, Sequence[Detection]]) -> Drawing:
    from spheretwin.viz.figures import faults as figures

    curves = {kind: [one.latency_s for one in detections] for kind, detections in by_kind.items()}
    figure = figures.remaining(
        curves, "time since the fault, s", "faults not detected yet, %", "Detection latency"
    )
    return FILE.drawing("latency", figure)


def _of_run(run: RunOutcome, number: int = 0) -> list[Detection]:
    return [
        Detection(number, inf if latency_s is None else latency_s, ticks)
        for latency_s, ticks in zip(run.data.latencies_s, run.data.driven_ticks, strict=True)
    ]


Kind = tuple[str, Sequence[Detection]]
"""Kind of fault with its detections."""


def _quantile(share: float, kind: Kind) -> str:
    latencies_ms = [1e3 * one.latency_s for one in kind[1]]
    return quantile_text(latencies_ms, _ms, share, _draws(kind))


def _draws(kind: Kind) -> int:
    return len({one.run for one in kind[1]})


def _longest(kind: Kind) -> str:
    return _ms(1e3 * max((one.latency_s for one in _split(kind[1])[0]), default=inf))


def _missed(kind: Kind) -> str:
    return _share(len(_split(kind[1])[1]), len(kind[1]), _draws(kind))


def _ticks(missed: bool, text: Callable[[Sequence[int]], str], kind: Kind) -> str:
    """Driven ticks; of open groups alone, as a shorted one is observed by the current of its back-EMF too."""
    ticks = [one.driven_ticks for one in _split(kind[1])[missed]]
    return text(ticks) if "open" in kind[0] and ticks else NONE


def _most(ticks: Sequence[int]) -> str:
    return str(max(ticks))


LATENCY: dict[str, Callable[[Kind], str]] = {
    "groups": lambda kind: kind[0],
    "faults": lambda kind: str(len(kind[1])),
    "latency, ms: median": partial(_quantile, 0.5),
    "90 %": partial(_quantile, 0.9),
    "95 %": partial(_quantile, 0.95),
    "99 %": partial(_quantile, 0.99),
    "longest detected": _longest,
    "not detected": _missed,
    "driven ticks: median": partial(_ticks, False, lambda ticks: f"{np.median(ticks):.0f}"),
    "longest": partial(_ticks, False, _most),
    "not detected: most": partial(_ticks, True, _most),
}


def _share(cases: int, count: int, draws: int) -> str:
    """Cases and their share in percent, with its interval."""
    low, high = share_interval(cases * draws / count, draws)
    return f"{cases} ({100 * cases / count:.1f} % [{100 * low:.1f}, {100 * high:.1f}])"


def _split(detections: Sequence[Detection]) -> tuple[list[Detection], list[Detection]]:
    """Detected and missed faults."""
    detected = [one for one in detections if one.latency_s < inf]
    return detected, [one for one in detections if one.latency_s == inf]


def _ms(value: float) -> str:
    return f"{value:.0f}" if value < inf else "not detected"


def _why(by_kind: Mapping[str, Sequence[Detection]]) -> str:
    """State how many driven ticks detected and undetected open groups had."""
    detected, missed = _split([one for kind, ones in by_kind.items() if "open" in kind for one in ones])
    known = [one.driven_ticks for one in detected]
    if not known:
        return ""
    text = (
        f"\n\nThe {len(known)} open groups that were detected had {min(known)} driven ticks at least until"
        f" then, {np.median(known):.0f} as the median."
    )
    if not missed:
        return text
    fewer = sum(one.driven_ticks < min(known) for one in missed)
    return (
        f"{text} Of the {len(missed)} that were not, {fewer} had fewer than {min(known)} until the run ended."
    )


def _pairs(faults: FaultRuns) -> Pairs:
    """Completed runs with one or two open groups, detected and reported, with the same seed and start."""
    reported = {item["groups"]: item.runs for item in faults.of(*FEW, way=cases.REPORTED.name)}
    return [
        pair
        for item in faults.of(*FEW, way=cases.DETECTING.name)
        for pair in zip(item.runs, reported.get(item["groups"], ()), strict=False)
        if all(run.is_complete for run in pair)
    ]


def _intervals() -> list[tuple[float, float]]:
    """Intervals of the latency in ms, then not detected, then all."""
    return [*pairwise(EDGES_ms), (inf, inf), (0.0, inf)]


def cost_rad(detecting: RunOutcome, reported: RunOutcome) -> float:
    """Return what the delay of the detection adds to the largest error after the fault."""
    return float(detecting.data.after_rad - reported.data.after_rad)


def _slowest_s(run: RunOutcome) -> float:
    return max(one.latency_s for one in _of_run(run))


def _within(pairs: Pairs, first: float, end: float) -> Pairs:
    """Pairs whose slowest latency, in ms, is in an interval."""
    if (first, end) == (0.0, inf):
        return pairs
    latencies = [1e3 * _slowest_s(pair[0]) for pair in pairs]
    return [
        pair
        for pair, latency_ms in zip(pairs, latencies, strict=True)
        if (latency_ms == inf if first == inf else first <= latency_ms < end)
    ]


def _costs(pairs: Pairs) -> list[float]:
    return [1e3 * cost_rad(*pair) for pair in pairs]


COST: dict[str, Callable[[tuple[str, Pairs]], Any]] = {
    "interval": lambda interval: interval[0],
    "runs": lambda interval: len(interval[1]),
    "cost": lambda interval: Numbers(_costs(interval[1])),
    "healthy": lambda interval: Numbers(1e3 * detecting.data.healthy_rad for detecting, _ in interval[1]),
    "track": lambda interval: percent([tracks(detecting) for detecting, _ in interval[1]]),
}
"""Measures of an interval of the latency with its pairs."""


def _named(first: float, end: float) -> str:
    if first == inf:
        return "not detected"
    if end == inf:
        return f"above {first:.0f}" if first else "all"
    return f"up to {end:.0f}" if first == 0.0 else f"above {first:.0f}, up to {end:.0f}"


def _verdict(pairs: Pairs) -> str:
    if not pairs:
        return ""
    costs = _costs(pairs)
    free = sum(cost <= 0 for cost in costs)
    return (
        f" With one or two groups open the delay costs {np.median(costs):.3f} mrad as the median and"
        f" {max(costs):.2f} mrad at most; in {free} of {len(costs)} pairs of runs it costs nothing."
    )
