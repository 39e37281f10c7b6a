"""Readings of (41): the laws and conditions of the printed numbers under each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from spheretwin.paper.cells import table
from spheretwin.paper.experiment import Array, Case, ExperimentSection, Outcomes, RunOutcome, Statement
from spheretwin.paper.experiment_file import PAPER_LAWS, ExperimentFile, PRINTED_rad, printed_rad
from spheretwin.viz.pages.markdown import Drawing, ResultTable

FILE = ExperimentFile("readings")
READINGS = [*FILE["reading"], *FILE["reading_with_slope"]]
AS_SHIPPED = READINGS[0]["reading"]
TORQUE = "torque"


class ReadingResult(NamedTuple):
    """Errors of a reading."""

    label: str
    level: str
    surface_slope: float | None
    """λ of the laws that have one; None for the printed one."""
    ratios: Array  # (conditions, laws, 3) largest error over the printed one
    runs: Sequence[RunOutcome]

    @property
    def score(self) -> float:
        """Root mean square of the logarithm of the ratios."""
        return float(np.sqrt(np.mean(np.log(self.ratios) ** 2)))


def case(reading: Mapping[str, Any], law: str, m: float, L: float) -> Case:
    """Return the case of an entry of the readings; PD, which has no λ, is the same as shipped."""
    label = AS_SHIPPED if law == "pd" and "slope" in reading else reading["reading"]
    return FILE.case(reading=label, law=law, m=m, L=L)


def results(outcomes: Outcomes) -> list[ReadingResult]:
    """Result of each reading of which every case was run."""
    conditions = [(law.law, *at) for at in PRINTED_rad for law in PAPER_LAWS]
    printed = np.array([printed_rad(*condition) for condition in conditions])
    results = []
    for reading in READINGS:
        runs = [run for at in conditions for run in outcomes.runs(case(reading, *at))]
        if len(runs) == len(printed):
            ratios = np.array([run.max_abs_error for run in runs]) / printed
            ratios = ratios.reshape(len(PRINTED_rad), len(PAPER_LAWS), 3)
            results.append(
                ReadingResult(reading["reading"], reading["level"], reading.get("slope"), ratios, runs)
            )
    return results


def sections(outcomes: Outcomes) -> list[ExperimentSection]:
    """Table and figure of all readings."""
    complete = results(outcomes)
    slopes = (f" {_with_slope(result)}" for result in complete if result.surface_slope is not None)
    drawings = [lambda: _draw(complete)] if complete else []
    return [FILE.section("readings", [_table(complete)], drawings, "".join(slopes))]


def _table(complete: Sequence[ReadingResult]) -> ResultTable:
    conditions = [(i, j) for i in range(len(PRINTED_rad)) for j in range(len(PAPER_LAWS))]
    laws = [f"{law.label}, L = {L:g}" for _, L in PRINTED_rad for law in PAPER_LAWS]
    cells: dict[str, Callable[[ReadingResult], str]] = {
        "reading of (41)": lambda result: result.label,
        "score": lambda result: f"{result.score:.2f}",
        **dict(zip(laws, map(_mean, conditions), strict=True)),
        "at the current limit": _limited,
        "ended early": _lost,
    }
    return table("Largest error over the printed one (geometric mean of the hinges)", complete, cells)


def _mean(condition: tuple[int, int]) -> Callable[[ReadingResult], str]:
    return lambda result: f"{np.exp(np.mean(np.log(result.ratios[condition]))):.3g}"


def _limited(result: ReadingResult) -> str:
    limited = max(run.figures["saturated_fraction"] or 0.0 for run in result.runs)
    return f"up to {100 * limited:.0f} %"


def _lost(result: ReadingResult) -> str:
    lost = sum(not run.is_complete for run in result.runs)
    return f"{lost} of {len(result.runs)}"


def _with_slope(result: ReadingResult) -> str:
    """State the range of the ratios of every law that has λ, by load, for a reading with another λ."""
    laws = [f"{law.label} by {_ranges(result, i)}" for i, law in enumerate(PAPER_LAWS) if law.law != "pd"]
    return f"With λ = {result.surface_slope:g} the errors differ from the print: {', '.join(laws)}."


def _ranges(result: ReadingResult, law: int) -> str:
    """Return the least and largest ratio of the hinges under each load."""
    return " and ".join(
        f"a factor of {ratios.min():.2f} to {ratios.max():.2f} at L = {L:g}"
        for (_, L), ratios in zip(PRINTED_rad, result.ratios[:, law], strict=True)
    )


def findings(outcomes: Outcomes) -> list[Statement]:
    """Test if the printed errors follow from the printed gains under any reading."""
    every = results(outcomes)
    if len(every) < len(READINGS):
        return []
    shipped, best = every[0], min(every, key=_score)
    torque = min((result for result in every if result.level == TORQUE), key=_score)
    reproduced = best.surface_slope is None and best.score < np.log(1.25)
    return [
        Statement(
            reproduced,
            f"nearest to all {best.ratios.size} printed errors is (41) read {best.label}, with an RMS"
            f" log ratio of {best.score:.2f}; with the printed gains it is {shipped.score:.2f}"
            f" read {shipped.label}, and at best {torque.score:.2f} read as a torque{_of_afsm(best)}",
        )
    ]


def _score(result: ReadingResult) -> float:
    return result.score


def _of_afsm(best: ReadingResult) -> str:
    """State how far AFSM is from the print where the best reading has another λ."""
    if best.surface_slope is None:
        return ""
    afsm = [law.law for law in PAPER_LAWS].index("afsm")
    return f"; AFSM's errors then differ from the print by {_ranges(best, afsm)}"


def _draw(results: Sequence[ReadingResult]) -> Drawing:
    from spheretwin.viz.figures import conditions as figures

    rows = {
        f"{result.label}\nscore {result.score:.2f}": {
            law.law: result.ratios[:, i].ravel() for i, law in enumerate(PAPER_LAWS)
        }
        for result in results
    }
    labels = {law.law: law.label for law in PAPER_LAWS}
    title = f"Readings of (41) against the {results[0].ratios.size} printed errors"
    figure = figures.ratios(rows, labels, "largest |error| over the printed one", title)
    return FILE.drawing("readings", figure)


EXPERIMENT = FILE.experiment(sections=sections, findings=findings)
