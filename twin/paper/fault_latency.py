"""Detection latency of failed groups as a distribution, and the tracking error that the delay costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import inf
from typing import NamedTuple

import numpy as np

from spheretwin.paper import fault_cases as cases
from spheretwin.paper import fault_sections
from spheretwin.paper.experiment import Outcome, Outcomes, ResultTable, Section
from spheretwin.paper.fault_outcomes import tracks
from spheretwin.paper.fault_sections import percent, runs_by_set
from spheretwin.paper.laws import BY_LAW
from spheretwin.study.statistics import quantile_text, share_interval

METHOD = (
    "*Latency* is the time from the start of a fault to the first tick at which the allocation excludes the"
    " group. Faults that are not detected before the run ends count as infinite in the quantiles. The"
    " *driven ticks* of an open group are the control ticks after the fault at which its commanded current"
    " is above the threshold of the detector. At all other ticks the group is idle: an open group within the"
    " threshold cannot be distinguished from a healthy one. The latency is therefore the time until enough"
    " driven ticks have passed.\n\n"
    "Quantiles have their 95 % interval in brackets. The latency depends on the law, which commands the"
    " currents: every group opens at many starts under each of two. Faults of several groups, which share"
    " their start, count as one draw.\n\n"
    "The *cost* of the delay is the error after the fault (as above) minus that of the run with a reported"
    " fault of the same groups, seed and start."
)
HEAD = (
    "groups", "faults", "latency, ms: median", "90 %", "95 %", "99 %", "longest detected", "not detected",
    "driven ticks: median", "longest", "not detected: most",
)  # fmt: skip
COST = (
    "slowest latency, ms", "runs", "cost, mrad: median", "95 %", "99 %", "largest of these",
    "healthy error, mrad: median", "track",
)  # fmt: skip
QUANTILES = (0.5, 0.9, 0.95, 0.99)

EDGES_ms = (0.0, 6.5, 20.5, 100.5, inf)
"""Between intervals of latency, halfway between control ticks."""


class Detection(NamedTuple):
    """Detection of one failed group."""

    run: int
    """Number of its run: groups of a run share the start."""

    latency_s: float
    """Infinite if it is not detected."""
    driven_ticks: int


def section(outcomes: Outcomes) -> Section:
    """Distribution of the latency, its reason, and its cost."""
    by_kind = {kind: detections for kind, detections in _detections(outcomes).items() if detections}
    rows = [_row(kind, detections) for kind, detections in by_kind.items()]
    pairs = _pairs(outcomes)
    costs = [row for first, end in _intervals() if (row := _cost_row(pairs, first, end))]
    title = "Detection latency of failed groups"
    cost_title = "One or two open groups: cost of the delay, by the latency of the slower group"
    curves = {kind: [one.latency_s for one in detections] for kind, detections in by_kind.items()}
    return Section(
        "Detection latency",
        f"{METHOD}{_why(by_kind)}{_verdict(pairs)}",
        [ResultTable(title, HEAD, rows), ResultTable(cost_title, COST, costs)],
        [lambda: fault_sections.latencies(curves)] if curves else [],
    )


def _detections(outcomes: Outcomes) -> dict[str, list[Detection]]:
    """Detections by the kind of fault."""
    singles, label = cases.singles(), {law: BY_LAW[law].label for law in cases.LATENCY_LAWS}
    kinds = {
        f"one open, {label[law]}": [cases.of_latency(groups, law) for groups in singles] for law in label
    }
    several = {"two open": cases.pairs(), "three to nine open": cases.random_groups()}
    kinds |= {
        kind: [cases.of_groups(groups, cases.DETECTING) for groups in sets] for kind, sets in several.items()
    }
    kinds["one shorted"] = [cases.shorted(groups, cases.DETECTING) for groups in singles]
    return {
        kind: [
            detection
            for number, run in enumerate(run for case in of_kind for run in outcomes.runs(case))
            for detection in _of_run(run, number)
        ]
        for kind, of_kind in kinds.items()
    }


def _of_run(run: Outcome, number: int = 0) -> list[Detection]:
    return [
        Detection(number, inf if latency_s is None else latency_s, ticks)
        for latency_s, ticks in zip(run.data.latencies_s, run.data.driven_ticks, strict=True)
    ]


def _row(kind: str, detections: Sequence[Detection]) -> tuple[str, ...]:
    latencies_ms = [1e3 * one.latency_s for one in detections]
    detected, missed = _split(detections)
    # A shorted group is observed by the current that its back-EMF drives as well.
    ticks = ["–"] * 3
    if "open" in kind and detected:
        driven = [one.driven_ticks for one in detected]
        ticks[:2] = f"{np.median(driven):.0f}", str(max(driven))
    if "open" in kind and missed:
        ticks[2] = str(max(one.driven_ticks for one in missed))
    runs = len({one.run for one in detections})
    return (
        kind, str(len(detections)), *(quantile_text(latencies_ms, _ms, share, runs) for share in QUANTILES),
        _ms(1e3 * max((one.latency_s for one in detected), default=inf)),
        _share(len(missed), len(detections), runs), *ticks,
    )  # fmt: skip


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


def _pairs(outcomes: Outcomes) -> list[tuple[Outcome, Outcome]]:
    """Completed runs with one or two open groups, detected and reported, with the same seed and start."""
    detecting, reported = (
        runs_by_set(outcomes, [*cases.singles(), *cases.pairs()], way)
        for way in (cases.DETECTING, cases.REPORTED)
    )
    return [
        pair
        for groups, runs in detecting.items()
        for pair in zip(runs, reported.get(groups, ()), strict=False)
        if all(run.is_complete for run in pair)
    ]


def _intervals() -> list[tuple[float, float]]:
    """Intervals of the latency in ms, then not detected, then all."""
    return [*pairwise(EDGES_ms), (inf, inf), (0.0, inf)]


def _cost_row(pairs: Sequence[tuple[Outcome, Outcome]], first: float, end: float) -> tuple[str, ...] | None:
    chosen = [pair for pair in pairs if _within(1e3 * _slowest_s(pair[0]), first, end)]
    if not chosen:
        return None
    costs = [1e3 * cost_rad(*pair) for pair in chosen]
    healthy = np.median([1e3 * detecting.data.healthy_rad for detecting, _ in chosen])
    return (
        _named(first, end), str(len(chosen)),
        *(quantile_text(costs, "{:.3f}".format, share) for share in (0.5, 0.95, 0.99)),
        f"{max(costs):.3f}", f"{healthy:.1f}",
        percent([tracks(detecting) for detecting, _ in chosen]),
    )  # fmt: skip


def cost_rad(detecting: Outcome, reported: Outcome) -> float:
    """Return what the delay of the detection adds to the largest error after the fault."""
    return float(detecting.data.after_rad - reported.data.after_rad)


def _slowest_s(run: Outcome) -> float:
    return max(one.latency_s for one in _of_run(run))


def _within(latency_ms: float, first: float, end: float) -> bool:
    if (first, end) == (0.0, inf):
        return True
    return latency_ms == inf if first == inf else first <= latency_ms < end


def _named(first: float, end: float) -> str:
    if first == inf:
        return "not detected"
    if end == inf:
        return f"above {first:.0f}" if first else "all"
    return f"up to {end:.0f}" if first == 0.0 else f"above {first:.0f}, up to {end:.0f}"


def _verdict(pairs: Sequence[tuple[Outcome, Outcome]]) -> str:
    if not pairs:
        return ""
    costs = [1e3 * cost_rad(*pair) for pair in pairs]
    free = sum(cost <= 0 for cost in costs)
    return (
        f" With one or two groups open the delay costs {np.median(costs):.3f} mrad as the median and"
        f" {max(costs):.2f} mrad at most; in {free} of {len(costs)} pairs of runs it costs nothing."
    )
