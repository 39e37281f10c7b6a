"""Fault study: the nutation with parts that fail during the run, and the reasons of lost tracking."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from spheretwin.paper import fault_cases as cases
from spheretwin.paper import fault_latency
from spheretwin.paper.experiment import ExperimentSection, Outcomes, RunOutcome, Statement
from spheretwin.paper.experiment_file import CaseRuns
from spheretwin.paper.fault_cases import COILS, FEW, FILE, FaultRuns
from spheretwin.paper.fault_outcomes import TWICE, reduce, row_fields, tracks
from spheretwin.paper.fault_sections import ERROR, groups_section, parts_section
from spheretwin.viz.pages.markdown import Drawing

FIGURES = {
    "torque": "torque left / needed",
    "least_norm": "the same by least norm",
    "least_share": "delivered share",
}
JUDGED = (
    (cases.REPORTED, "torque"),
    (cases.REPORTED, "least_norm"),
    (cases.DETECTING, "torque"),
    (cases.DETECTING, "least_norm"),
    (cases.BOUNDED, "torque"),
    (cases.UNREPORTED, "least_share"),
)
"""Figures that may separate the runs of a way that track from the others."""

LISTED = 10
"""Sets of each way in the table of the smallest."""


class Split(NamedTuple):
    """Threshold of a figure between the runs that track and the others."""

    at: float
    rightly: float
    """Share of the runs on the right side of the threshold."""


def causes_section(faults: FaultRuns) -> ExperimentSection:
    """Separation of the sets that track by rank and torque, and the smallest sets that do not track."""
    causes = [cause for way, figure in JUDGED if sum(map(len, (cause := _cause(faults, way, figure))[2:]))]
    by_way = {
        way.name: items
        for way in (cases.REPORTED, cases.BOUNDED)
        if (items := faults.of(*COILS, way=way.name))
    }
    small = [item for items in by_way.values() for item in smallest(items)]
    tables = [
        FILE.table("causes", causes, **CAUSES),
        FILE.table("smallest", small, **SMALL),
    ]
    drawings = [lambda: _draw(by_way)] if by_way else []
    verdicts = "".join(_causes_verdict(items, way) for way, items in by_way.items())
    return FILE.section("causes", tables, drawings, f"{_ranks(faults)}{verdicts}")


class Cause(NamedTuple):
    """Values of a figure in the sets of a way, each with the first seed."""

    way: str
    figure: str
    good: Sequence[float]
    """Of the sets that track."""
    bad: Sequence[float]


CAUSES: dict[str, Callable[[Cause], Any]] = {
    "least": lambda cause: min(cause.good, default=None),
    "largest": lambda cause: max(cause.bad, default=None),
    "lost": lambda cause: len(cause.bad),
    "sets": lambda cause: len(cause.good) + len(cause.bad),
    "split": lambda cause: split(cause.good, cause.bad) if cause.good and cause.bad else None,
}


def _cause(faults: FaultRuns, way: cases.Way, figure: str) -> Cause:
    runs = [item.runs[0] for item in faults.of(*COILS, way=way.name)]
    return Cause(way.name, FIGURES[figure], *_by_tracking(runs, figure))


def _by_tracking(runs: Sequence[RunOutcome], figure: str) -> tuple[list[float], list[float]]:
    """Return a figure of the runs that track, and of those that do not."""
    good, bad = (
        [getattr(run.data.remaining, figure) for run in runs if tracks(run) is tracking]
        for tracking in (True, False)
    )
    return good, bad


def split(good: Sequence[float], bad: Sequence[float]) -> Split:
    """Threshold that separates the good figures, above it, from the bad ones with the fewest errors."""
    values = np.concatenate([good, bad])
    order = np.argsort(values, kind="stable")
    is_good = (np.arange(len(values)) < len(good))[order]
    # With the threshold above the i lowest: the bad below and the good above are on the right side.
    bad_below = np.concatenate([[0], np.cumsum(~is_good)])
    good_below = np.concatenate([[0], np.cumsum(is_good)])
    rightly = bad_below + len(good) - good_below
    best = int(np.argmax(rightly))
    neighbours = values[order][[max(best - 1, 0), min(best, len(values) - 1)]]
    return Split(float(neighbours.mean()), float(rightly[best] / len(values)))


def _ranks(faults: FaultRuns) -> str:
    """Count the sets that lose a direction."""
    items = faults.of(*COILS)
    every = {item["groups"] for item in items}
    lost = {item["groups"] for item in items if any(run.data.remaining.rank < 3 for run in item.runs)}
    if not every:
        return ""
    if not lost:
        return f"\n\nAll {len(every)} sets keep rank 3 along the whole path."
    return f"\n\n{len(lost)} of {len(every)} sets lose a direction on the path."


def _causes_verdict(items: Sequence[CaseRuns], way: str) -> str:
    """Count the runs that track with at least and with less than the needed torque."""
    good, bad = _by_tracking([run for item in items for run in item.runs], "torque")
    if not good:
        return ""
    enough = [value >= 1 for value in good].count(True)
    enough_bad = [value >= 1 for value in bad].count(True)
    less, less_bad = len(good) - enough, len(bad) - enough_bad
    return (
        f" {way.capitalize()}: {enough} of {enough + enough_bad} runs with at least the needed torque"
        f" track, and {less} of {less + less_bad} runs with less."
    )


def smallest(items: Sequence[CaseRuns]) -> list[CaseRuns]:
    """Return the sets with the fewest groups that do not track, the one with the least torque first."""
    failing = [item for item in items if not all(map(tracks, item.runs))]
    least = {item.case.name: min(run.data.remaining.torque for run in item.runs) for item in failing}
    failing.sort(key=lambda item: (len(item["groups"]), least[item.case.name], item["groups"]))
    return failing[:LISTED]


def _lost(item: CaseRuns) -> list[RunOutcome]:
    return [run for run in item.runs if not tracks(run)]


SMALL: dict[str, Callable[[CaseRuns], Any]] = {
    "open_groups": lambda item: " ".join(map(str, item["groups"])),
    "lost": lambda item: len(_lost(item)),
    "number": lambda item: len(item.runs),
    "worst": lambda item: max(_lost(item), key=lambda run: run.data.ratio),
}


def _draw(by_way: Mapping[str, Sequence[CaseRuns]]) -> Drawing:
    from spheretwin.viz.figures import faults as figures

    points = {
        way: [
            (run.data.remaining.torque, run.data.ratio, len(item["groups"]))
            for item in items
            for run in item.runs
        ]
        for way, items in by_way.items()
    }
    figure = figures.clouds(
        points,
        ("torque left / torque needed, least along the path", ERROR, "open groups"),
        (1.0, TWICE),
        "What is left decides",
    )
    return FILE.drawing("causes", figure, times=TWICE)


BOUND_rad = 1e-9
"""Largest errors of the two engines differ by no more in runs that track: 10,000 steps round otherwise, and a
closed loop holds the difference small."""


class EnginePairs(NamedTuple):
    """Runs of a way on both engines, with the first seed."""

    way: str
    pairs: Sequence[tuple[RunOutcome, RunOutcome]]

    def same(self, value: Callable[[RunOutcome], object]) -> int:
        """Count the pairs of which a value is the same."""
        return [value(one) == value(other) for one, other in self.pairs].count(True)

    def largest(self, condition: Callable[[RunOutcome], bool]) -> float | None:
        """Largest difference of the pairs of which both runs meet a condition, rad; None without one."""
        pairs = [pair for pair in self.pairs if all(map(condition, pair))]
        return max((difference_rad(*pair) for pair in pairs), default=None)


def engines_section(faults: FaultRuns) -> ExperimentSection:
    """Differences between the engines."""
    every = [both for way in cases.OF_GROUPS if (both := engine_pairs(faults, way)).pairs]
    agreed = [agree(*pair) for both in every for pair in both.pairs]
    more = f" {agreed.count(True)} of {len(agreed)} agree." if agreed else ""
    engines = FILE.table(
        "engines",
        every,
        sets=lambda both: len(both.pairs),
        status=lambda both: both.same(lambda run: run.status),
        tracking=lambda both: both.same(tracks),
        if_tracking=lambda both: both.largest(tracks),
        if_complete=lambda both: both.largest(lambda run: run.is_complete),
    )
    return FILE.section("engines", [engines], more=more, sample=cases.SAMPLE, bound_rad=BOUND_rad)


def agree(one: RunOutcome, other: RunOutcome) -> bool:
    """True if two runs have the same status, and almost the same error if they track."""
    same = one.status == other.status and tracks(one) == tracks(other)
    return same and (not tracks(one) or difference_rad(one, other) <= BOUND_rad)


def difference_rad(one: RunOutcome, other: RunOutcome) -> float:
    """Difference of the largest errors of any hinge, of the complete run or after the fault."""
    whole = np.abs(one.max_abs_error - other.max_abs_error).max()
    return float(max(whole, abs(one.data.after_rad - other.data.after_rad)))


def engine_pairs(faults: FaultRuns, way: cases.Way) -> EnginePairs:
    """Return the runs of the sample on both engines."""
    others = {item["groups"]: item.runs[0] for item in faults.of("MuJoCo", way=way.name)}
    items = [item for item in faults.of(*COILS, way=way.name) if item["groups"] in others]
    return EnginePairs(way.name, [(item.runs[0], others[item["groups"]]) for item in items])


def sections(outcomes: Outcomes) -> list[ExperimentSection]:
    """Open groups, detection, why some sets do not track, all other parts, and the other engine."""
    faults = FaultRuns(outcomes)
    return [
        groups_section(faults),
        fault_latency.section(faults),
        causes_section(faults),
        parts_section(faults),
        engines_section(faults),
    ]


def findings(outcomes: Outcomes) -> list[Statement]:
    """Number of the runs with one or two open groups that track, by way."""
    faults = FaultRuns(outcomes)
    by_way = {way.name: faults.runs(*FEW, way=way.name) for way in cases.OF_GROUPS}
    texts = [
        f"{way} {[*map(tracks, runs)].count(True)} of {len(runs)}" for way, runs in by_way.items() if runs
    ]
    text = f"runs that track with one or two groups open: {', '.join(texts)}"
    return [Statement(None, text)] if texts else []


EXPERIMENT = FILE.experiment(
    cases=cases.cases, sections=sections, reduce=reduce, row_fields=row_fields, findings=findings
)
