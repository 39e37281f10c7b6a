"""Readings of (41): the laws and conditions of the printed numbers under each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import Case, Experiment, Finding, Outcome, Outcomes, ResultTable, Section
from spheretwin.paper.laws import PAPER_LAWS, ComparedLaw, PRINTED_rad, printed_rad
from spheretwin.viz.pages.markdown import Drawing

Array = NDArray[np.float64]

SCENARIO = "sinusoid"

STEP_s = 5e-4
"""Physics step of the other figures; at shorter control periods there is one a period."""

# A reading may be wrong enough to lose the rotor.
EXPECTED = (Status.COMPLETED, Status.LEFT_WORKSPACE, Status.DIVERGED)


class Reading(NamedTuple):
    """One way to read the law and its gains."""

    name: str
    rate_Hz: float
    level: str
    surface_slope: float | None = None
    """λ of the laws that have one; the printed 50 1/s unless given."""

    @property
    def label(self) -> str:
        """Name with the control rate."""
        return f"{self.name}, {self.rate_Hz / 1e3:g} kHz"


ACCELERATION, TORQUE = "acceleration", "torque"
RATES_Hz = (1e3, 5e3, 10e3, 20e3)

READINGS = (
    *(Reading("as an acceleration", rate_Hz, ACCELERATION) for rate_Hz in RATES_Hz),
    *(Reading("as a torque", rate_Hz, TORQUE) for rate_Hz in RATES_Hz),
    Reading("as an acceleration, λ = 5", 1e3, ACCELERATION, 5.0),
)
AS_SHIPPED = READINGS[0]


def cases() -> list[Case]:
    """Cases of every reading under every law and condition of which a number is printed."""
    every = [
        case(reading, law, *condition)
        for reading in READINGS
        for condition in PRINTED_rad
        for law in PAPER_LAWS
    ]
    return list({case.name: case for case in every}.values())


def case(reading: Reading, law: ComparedLaw, m: float, L: float) -> Case:
    """Case of a law under a reading and a condition; a law without λ is the same as shipped."""
    if reading.surface_slope is not None and law.law == "pd":
        return case(AS_SHIPPED, law, m, L)
    fields: dict[str, Any] = {
        "controller.law": law.law,
        "controller.level": reading.level,
        "controller.period_s": 1 / reading.rate_Hz,
        "plant.step_s": min(STEP_s, 1 / reading.rate_Hz),
        "plant.modelling_error": m,
        "disturbance.load": L,
    }
    if reading.surface_slope is not None:
        fields["controller.surface_slope"] = reading.surface_slope
    return Case(
        name=f"{reading.label}, {law.law}: m {m:g}, L {L:g}",
        scenario=SCENARIO,
        fields=fields,
        details={"reading": reading.label, "paper": printed_rad(law.law, m, L)},
        single_run=True,
        expected_statuses=EXPECTED,
    )


METHOD = (
    "Equation (41) does not state the quantity of u. If u is a torque, K over the inertia is 9000 1/s, too"
    " fast for a control period of 1 ms; if u is an acceleration, the torque is u times the nominal inertia"
    " of the axis. Each reading runs all laws and conditions of which the paper prints numbers, with one seed"
    " and the printed gains unless its name says otherwise (PD has λ as its stiffness, and keeps it). The"
    " *score* is the root mean square of ln(ours / printed) over all of these numbers: 0 if all agree, 0.69"
    " for a factor of two. The error of a run that ended early is that until its end."
)


class ReadingResult(NamedTuple):
    """Errors of a reading."""

    reading: Reading
    ratios: Array  # (conditions, laws, 3) largest error over the printed one
    runs: Sequence[Outcome]

    @property
    def score(self) -> float:
        """Root mean square of the logarithm of the ratios."""
        return float(np.sqrt(np.mean(np.log(self.ratios) ** 2)))


def results(outcomes: Outcomes) -> list[ReadingResult]:
    """Result of each reading of which every case was run."""
    results = []
    printed = np.array([printed_rad(law.law, *condition) for condition in PRINTED_rad for law in PAPER_LAWS])
    for reading in READINGS:
        runs = [
            run
            for condition in PRINTED_rad
            for law in PAPER_LAWS
            for run in outcomes.runs(case(reading, law, *condition))
        ]
        if len(runs) == len(printed):
            ratios = np.array([run.max_abs_error for run in runs]) / printed
            shape = len(PRINTED_rad), len(PAPER_LAWS), 3
            results.append(ReadingResult(reading, ratios.reshape(shape), runs))
    return results


def sections(outcomes: Outcomes) -> list[Section]:
    """Table and figure of all readings."""
    complete = results(outcomes)
    laws = tuple(f"{law.label}, L = {L:g}" for _, L in PRINTED_rad for law in PAPER_LAWS)
    table = ResultTable(
        "Largest error over the printed one (geometric mean of the hinges)",
        ("reading of (41)", "score", *laws, "at the current limit", "ended early"),
        [_row(result) for result in complete],
    )
    slopes = (f" {_with_slope(result)}" for result in complete if result.reading.surface_slope is not None)
    drawings = [lambda: _draw(complete)] if complete else []
    return [Section("Readings of the control law", METHOD + "".join(slopes), [table], drawings)]


def _with_slope(result: ReadingResult) -> str:
    """State the range of the ratios of every law that has λ, by load, for a reading with another λ."""
    laws = [
        f"{law.label} by {_ranges(result, i)}"
        for i, law in enumerate(PAPER_LAWS)
        if case(result.reading, law, *next(iter(PRINTED_rad)))
        != case(AS_SHIPPED, law, *next(iter(PRINTED_rad)))
    ]
    return f"With λ = {result.reading.surface_slope:g} the errors differ from the print: {', '.join(laws)}."


def _ranges(result: ReadingResult, law: int) -> str:
    """Return the least and largest ratio of the hinges under each load."""
    return " and ".join(
        f"a factor of {ratios.min():.2f} to {ratios.max():.2f} at L = {L:g}"
        for (_, L), ratios in zip(PRINTED_rad, result.ratios[:, law], strict=True)
    )


def findings(outcomes: Outcomes) -> list[Finding]:
    """Test if the printed errors follow from the printed gains under any reading."""
    by_reading = {result.reading: result for result in results(outcomes)}
    if len(by_reading) < len(READINGS):
        return []
    best = min(by_reading.values(), key=_score)
    torque = min((result for result in by_reading.values() if result.reading.level == TORQUE), key=_score)
    reproduced = best.reading.surface_slope is None and best.score < np.log(1.25)
    return [
        Finding(
            reproduced,
            f"nearest to all {best.ratios.size} printed errors is (41) read {best.reading.label}, with an RMS"
            f" log ratio of {best.score:.2f}; with the printed gains it is {by_reading[AS_SHIPPED].score:.2f}"
            f" read {AS_SHIPPED.label}, and at best {torque.score:.2f} read as a torque{_of_afsm(best)}",
        )
    ]


def _score(result: ReadingResult) -> float:
    return result.score


def _of_afsm(best: ReadingResult) -> str:
    """State how far AFSM is from the print where the best reading has another λ."""
    if best.reading.surface_slope is None:
        return ""
    afsm = [law.law for law in PAPER_LAWS].index("afsm")
    return f"; AFSM's errors then differ from the print by {_ranges(best, afsm)}"


def _row(result: ReadingResult) -> tuple[str, ...]:
    means = np.exp(np.mean(np.log(result.ratios), axis=2)).ravel()
    limited = max(run.figures["saturated_fraction"] or 0.0 for run in result.runs)
    lost = sum(not run.is_complete for run in result.runs)
    return (
        result.reading.label,
        f"{result.score:.2f}",
        *(f"{mean:.3g}" for mean in means),
        f"up to {100 * limited:.0f} %",
        f"{lost} of {len(result.runs)}",
    )


def _draw(results: Sequence[ReadingResult]) -> Drawing:
    from spheretwin.viz.figures import conditions as figures

    rows = [
        figures.RatioRow(
            f"{result.reading.label}\nscore {result.score:.2f}",
            {law.law: result.ratios[:, i].ravel() for i, law in enumerate(PAPER_LAWS)},
        )
        for result in results
    ]
    labels = {law.law: law.label for law in PAPER_LAWS}
    title = f"Readings of (41) against the {results[0].ratios.size} printed errors"
    caption = (
        "Largest error over the printed one under each reading of (41), a marker for each hinge and"
        " condition. Dashed line: the paper."
    )
    figure = figures.ratios(rows, labels, "largest |error| over the printed one", title)
    return Drawing("readings_ratios.svg", caption, figure)


EXPERIMENT = Experiment(
    name="readings",
    title="Readings of the control law",
    summary="The sinusoid with m = 0.2 and L = 1 and 2 under the paper's laws, their output read as a torque"
    " or as an acceleration, at several control rates.",
    cases=cases,
    sections=sections,
    findings=findings,
)
