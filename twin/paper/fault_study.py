"""Fault study: the nutation with parts that fail during the run, and the reasons of lost tracking."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.paper import fault_cases as cases
from spheretwin.paper import fault_latency, fault_sections
from spheretwin.paper.experiment import Experiment, Finding, Outcome, Outcomes, ResultTable, Section
from spheretwin.paper.fault_outcomes import reduce, row_fields, tracks
from spheretwin.paper.fault_sections import RunsBySet, few, runs_by_set

METHOD = (
    "These quantities are computed along the path of the healthy run, every 10 ms after the fault, and the"
    " tables contain their least values: the *rank* and least singular value of the torque matrix without"
    " the open groups; the *torque left over the torque needed*, which is the largest torque of any currents"
    " within the limit in the direction of the torque of the healthy run, over that torque, and the same for"
    " least-norm currents; and, for faults that are not reported, the *delivered share* of a torque that is"
    " commanded of all groups, in the worst direction (the least eigenvalue of G_left G_leftᵀ (G Gᵀ)⁻¹)."
)
CAUSES_HEAD = (
    "way", "figure", "sets", "do not track", "track: least", "do not: largest", "threshold", "correct side",
)  # fmt: skip
SMALL = (
    "open groups", "way", "seeds that do not track", "status of the worst", "error ratio",
    "rank", "least singular value, N·m/A", "torque left / needed", "by least norm",
)  # fmt: skip
JUDGED = (
    (cases.REPORTED, ("torque", "torque left / needed")),
    (cases.REPORTED, ("least_norm", "the same by least norm")),
    (cases.DETECTING, ("torque", "torque left / needed")),
    (cases.DETECTING, ("least_norm", "the same by least norm")),
    (cases.BOUNDED, ("torque", "torque left / needed")),
    (cases.UNREPORTED, ("least_share", "delivered share")),
)
"""Figures that may separate the runs of a way that track from the others."""

LISTED = 10
"""Sets of each way in the table of the smallest."""


class Split(NamedTuple):
    """Threshold of a figure between the runs that track and the others."""

    at: float
    rightly: float
    """Share of the runs on the right side of the threshold."""


def causes_section(outcomes: Outcomes) -> Section:
    """Separation of the sets that track by rank and torque, and the smallest sets that do not track."""
    by_way = {way.name: runs_by_set(outcomes, cases.sets(), way) for way in cases.OF_GROUPS}
    figures = [(way, *figure) for way, figure in JUDGED if by_way[way.name]]
    rows = [_causes_row(by_way[way.name], way, name, label) for way, name, label in figures]
    reported = (cases.REPORTED, cases.BOUNDED)
    small = [row for way in reported for row in _smallest(by_way[way.name], way)]
    points = {way.name: _points(by_way[way.name]) for way in reported if by_way[way.name]}
    return Section(
        "Why some sets do not track",
        f"{METHOD}{_ranks(by_way)}{''.join(_causes_verdict(by_way[way.name], way) for way in reported)}",
        [
            ResultTable(
                "How well one figure tells the sets that track, each with the first seed",
                CAUSES_HEAD,
                rows,
                2,
            ),
            ResultTable(
                f"The smallest sets that do not track, at most {LISTED} of each way", SMALL, small, 4
            ),
        ],
        [lambda: fault_sections.torque_left(points)] if points else [],
    )


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


def _causes_row(by_set: RunsBySet, way: cases.Way, figure: str, label: str) -> tuple[str, ...]:
    good, bad = _by_tracking({groups: runs[:1] for groups, runs in by_set.items()}, figure)
    best = split(good, bad)
    return (
        way.name, label, str(len(good) + len(bad)), str(len(bad)),
        f"{min(good):.3f}" if good else "–", f"{max(bad):.3f}" if bad else "–",
        f"{best.at:.3f}" if good and bad else "–", f"{100 * best.rightly:.1f} %" if good and bad else "–",
    )  # fmt: skip


def _by_tracking(by_set: RunsBySet, figure: str) -> tuple[list[float], list[float]]:
    """Return a figure of the runs that track, and of those that do not."""
    good: list[float] = []
    bad: list[float] = []
    for runs in by_set.values():
        for run in runs:
            (good if tracks(run) else bad).append(getattr(run.data.remaining, figure))
    return good, bad


def _ranks(by_way: dict[str, RunsBySet]) -> str:
    """Count the sets that lose a direction."""
    lost = {
        groups
        for by_set in by_way.values()
        for groups, runs in by_set.items()
        if any(run.data.remaining.rank < 3 for run in runs)
    }
    every = {groups for by_set in by_way.values() for groups in by_set}
    if not every:
        return ""
    if not lost:
        return f"\n\nAll {len(every)} sets keep rank 3 along the whole path."
    return f"\n\n{len(lost)} of {len(every)} sets lose a direction on the path."


def _causes_verdict(by_set: RunsBySet, way: cases.Way) -> str:
    """Count the runs that track with at least and with less than the needed torque."""
    good, bad = _by_tracking(by_set, "torque")
    if not good:
        return ""
    enough = [value >= 1 for value in good].count(True)
    enough_bad = [value >= 1 for value in bad].count(True)
    less, less_bad = len(good) - enough, len(bad) - enough_bad
    return (
        f" {way.name.capitalize()}: {enough} of {enough + enough_bad} runs with at least the needed torque"
        f" track, and {less} of {less + less_bad} runs with less."
    )


def _smallest(by_set: RunsBySet, way: cases.Way) -> list[tuple[str, ...]]:
    failing = [(groups, runs) for groups, runs in by_set.items() if not all(map(tracks, runs))]
    failing.sort(key=lambda one: (len(one[0]), min(run.data.remaining.torque for run in one[1]), one[0]))
    return [_listed(groups, runs, way) for groups, runs in failing[:LISTED]]


def _listed(groups: cases.Groups, runs: Sequence[Outcome], way: cases.Way) -> tuple[str, ...]:
    bad = [run for run in runs if not tracks(run)]
    worst = max(bad, key=lambda run: run.data.ratio)
    left = worst.data.remaining
    return (
        " ".join(map(str, groups)), way.name, f"{len(bad)} of {len(runs)}", str(worst.status),
        f"{worst.data.ratio:.2f}", str(left.rank), f"{left.singular_value_Nm_per_A:.4f}",
        f"{left.torque:.2f}", f"{left.least_norm:.2f}",
    )  # fmt: skip


def _points(by_set: RunsBySet) -> list[tuple[float, float, int]]:
    """Torque left, error over the healthy one, and number of open groups, of each run."""
    return [
        (run.data.remaining.torque, run.data.ratio, len(groups))
        for groups, runs in by_set.items()
        for run in runs
    ]


BOUND_rad = 1e-9
"""Largest errors of the two engines differ by no more in runs that track: 10,000 steps round otherwise, and a
closed loop holds the difference small."""

ENGINES_HEAD = (
    "way", "sets", "same status", "same tracking", "difference if they track, rad", "if they complete, rad",
)  # fmt: skip


def engines_section(outcomes: Outcomes) -> Section:
    """Differences between the engines."""
    rows = [row for way in cases.OF_GROUPS if (row := _engines_row(outcomes, way))]
    text = (
        f"The study runs on the Lagrangian engine, the faster one. One of {cases.SAMPLE} sets also runs on"
        " MuJoCo, with the first seed. Runs that track must have largest errors that differ by at most"
        f" {BOUND_rad:g} rad; other runs must end with the same status."
    )
    title = "Largest error of each hinge on the two engines"
    return Section(
        "The other engine", text + _engines_verdict(outcomes), [ResultTable(title, ENGINES_HEAD, rows)]
    )


def agree(one: Outcome, other: Outcome) -> bool:
    """True if two runs have the same status, and almost the same error if they track."""
    same = one.status == other.status and tracks(one) == tracks(other)
    return same and (not tracks(one) or difference_rad(one, other) <= BOUND_rad)


def difference_rad(one: Outcome, other: Outcome) -> float:
    """Difference of the largest errors of any hinge, of the complete run or after the fault."""
    whole = np.abs(one.max_abs_error - other.max_abs_error).max()
    return float(max(whole, abs(one.data.after_rad - other.data.after_rad)))


def engine_pairs(outcomes: Outcomes, way: cases.Way) -> list[tuple[Outcome, Outcome]]:
    """Runs of the sample on both engines, with the first seed."""
    pairs = [
        (outcomes.runs(cases.of_groups(groups, way)), outcomes.runs(cases.on_other_engine(groups, way)))
        for groups in cases.sample()
    ]
    return [(one[0], other[0]) for one, other in pairs if one and other]


def _engines_verdict(outcomes: Outcomes) -> str:
    both = [pair for way in cases.OF_GROUPS for pair in engine_pairs(outcomes, way)]
    if not both:
        return ""
    return f" {sum(agree(*pair) for pair in both)} of {len(both)} agree."


def _engines_row(outcomes: Outcomes, way: cases.Way) -> tuple[str, ...] | None:
    both = engine_pairs(outcomes, way)
    if not both:
        return None
    alike = [one.status == other.status for one, other in both]
    tracked = [tracks(one) == tracks(other) for one, other in both]
    whole = [pair for pair in both if all(run.is_complete for run in pair)]
    close = [pair for pair in both if all(map(tracks, pair))]
    apart = [
        f"{max(difference_rad(*pair) for pair in pairs):.1e}" if pairs else "–" for pairs in (close, whole)
    ]
    return way.name, str(len(both)), str(sum(alike)), str(sum(tracked)), *apart


def sections(outcomes: Outcomes) -> list[Section]:
    """Open groups, detection, why some sets do not track, all other parts, and the other engine."""
    return [
        fault_sections.groups_section(outcomes),
        fault_latency.section(outcomes),
        causes_section(outcomes),
        fault_sections.parts_section(outcomes),
        engines_section(outcomes),
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Number of the runs with one or two open groups that track, by way."""
    texts = []
    for way in cases.OF_GROUPS:
        runs = few(outcomes, way)
        if runs:
            texts.append(f"{way.name} {[tracks(run) for run in runs].count(True)} of {len(runs)}")
    text = f"runs that track with one or two groups open: {', '.join(texts)}"
    return [Finding(None, text)] if texts else []


EXPERIMENT = Experiment(
    name="faults",
    title="Parts that fail during the run",
    summary="The nutation (59) under AFSM with m = 0.2 and L = 1. At a random time coil groups open, or a"
    " sensor, the supply or the controller fails. The detection latency is measured under AFSM-ESO too.",
    cases=cases.cases,
    sections=sections,
    reduce=reduce,
    row_fields=row_fields,
    findings=findings,
)
