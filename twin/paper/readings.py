"""The readings that are tried, and the cases of each: the laws and conditions of the printed numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import (
    OF_PAPER,
    Array,
    Case,
    Compared,
    Experiment,
    Finding,
    Outcome,
    Outcomes,
    ResultTable,
    Section,
)
from spheretwin.paper.rows import PRINTED_rad, printed_rad
from spheretwin.viz.pages.markdown import Drawing

SCENARIO = "sinusoid"

STEP_s = 5e-4
"""Physics step of the other figures; at shorter control periods there is one a period."""

# A reading may be wrong enough to lose the rotor: that is what is asked.
ENDS = (Status.COMPLETED, Status.LEFT_WORKSPACE, Status.DIVERGED)


class Reading(NamedTuple):
    """One way to read the law and its gains."""

    name: str
    rate_Hz: float
    level: str
    surface_slope: float | None = None
    """λ of the laws that have one; the printed 50 1/s unless given."""

    @property
    def label(self) -> str:
        """With its control rate."""
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
    """Every reading under every law and condition of which a number is printed."""
    every = (case(reading, law, *at) for reading in READINGS for at in PRINTED_rad for law in OF_PAPER)
    return list({each.name: each for each in every}.values())


def case(reading: Reading, compared: Compared, m: float, L: float) -> Case:
    """A law under a reading and a condition; what has no λ is the same as shipped."""
    if reading.surface_slope is not None and compared.law == "pd":
        return case(AS_SHIPPED, compared, m, L)
    fields: dict[str, Any] = {
        "controller.law": compared.law,
        "controller.level": reading.level,
        "controller.period_s": 1 / reading.rate_Hz,
        "plant.step_s": min(STEP_s, 1 / reading.rate_Hz),
        "plant.modelling_error": m,
        "disturbance.load": L,
    }
    if reading.surface_slope is not None:
        fields["controller.surface_slope"] = reading.surface_slope
    return Case(
        name=f"{reading.label}, {compared.law}: m {m:g}, L {L:g}",
        scenario=SCENARIO,
        fields=fields,
        told={"reading": reading.label, "paper": printed_rad(compared.law, m, L)},
        once=True,
        ends=ENDS,
    )


HOW = (
    "Equation (41) gives u without saying of what. Read as a torque, K over the inertia is 9000 1/s, and a"
    " control period of 1 ms no longer follows it; read as an acceleration, the torque is u times the nominal"
    " inertia of the axis. Each reading runs all laws and conditions of which the paper prints numbers, one"
    " seed each, with the printed gains unless it says otherwise (PD has λ as its stiffness, and keeps it)."
    " The *score* is the root mean square of ln(ours / printed) over all of these numbers: 0 would be all of"
    " them, 0.69 a factor of two. Of a run that ended early, the error until then counts."
)


class Found(NamedTuple):
    """What a reading gave."""

    reading: Reading
    ratios: Array  # (conditions, laws, 3) largest error over the printed one
    runs: Sequence[Outcome]

    @property
    def score(self) -> float:
        """Root mean square of the logarithm of the ratios."""
        return float(np.sqrt(np.mean(np.log(self.ratios) ** 2)))


def found(outcomes: Outcomes) -> list[Found]:
    """Of each reading that was run as a whole."""
    return [
        _found(reading, outcomes)
        for reading in READINGS
        if all(case(reading, law, *at).name in outcomes for at in PRINTED_rad for law in OF_PAPER)
    ]


def _found(reading: Reading, outcomes: Outcomes) -> Found:
    runs = [outcomes[case(reading, law, *at).name][0] for at in PRINTED_rad for law in OF_PAPER]
    printed = [printed_rad(law.law, *at) for at in PRINTED_rad for law in OF_PAPER]
    ratios = np.array([run.max_abs_error for run in runs]) / np.array(printed)
    return Found(reading, ratios.reshape(len(PRINTED_rad), len(OF_PAPER), 3), runs)


def tell(outcomes: Outcomes) -> list[Section]:
    """A table and a figure of all readings."""
    tried = found(outcomes)
    laws = tuple(f"{law.label}, L = {L:g}" for _, L in PRINTED_rad for law in OF_PAPER)
    table = ResultTable(
        "Largest error over the printed one (geometric mean of the hinges)",
        ("reading of (41)", "score", *laws, "at the current limit", "ended early"),
        [_row(each) for each in tried],
    )
    text = HOW + "".join(f" {_with_slope(each)}" for each in tried if each.reading.surface_slope is not None)
    return [Section("Readings of the control law", text, [table], [lambda: _draw(tried)] if tried else [])]


def _with_slope(of: Found) -> str:
    """State the range of the ratios of every law that has λ, by load, for a reading with another λ."""
    laws = [
        f"{law.label} by {_ranges(of, place)}"
        for place, law in enumerate(OF_PAPER)
        if case(of.reading, law, *next(iter(PRINTED_rad))) != case(AS_SHIPPED, law, *next(iter(PRINTED_rad)))
    ]
    return f"With λ = {of.reading.surface_slope:g} the errors differ from the print: {', '.join(laws)}."


def _ranges(of: Found, law: int) -> str:
    """Return the least and largest ratio of the hinges under each load."""
    return " and ".join(
        f"a factor of {ratios.min():.2f} to {ratios.max():.2f} at L = {L:g}"
        for (_, L), ratios in zip(PRINTED_rad, of.ratios[:, law], strict=True)
    )


def findings(outcomes: Outcomes) -> list[Finding]:
    """Whether the printed errors follow from the printed gains under any reading."""
    tried = {each.reading: each for each in found(outcomes)}
    if len(tried) < len(READINGS):
        return []
    best = min(tried.values(), key=lambda each: each.score)
    torque = min(
        (each for each in tried.values() if each.reading.level == TORQUE), key=lambda each: each.score
    )
    held = best.reading.surface_slope is None and best.score < np.log(1.25)
    return [
        Finding(
            held,
            f"nearest to all {best.ratios.size} printed errors is (41) read {best.reading.label}, with an RMS"
            f" log ratio of {best.score:.2f}; with the printed gains it is {tried[AS_SHIPPED].score:.2f} read"
            f" {AS_SHIPPED.label}, and at best {torque.score:.2f} read as a torque{_of_afsm(best)}",
        )
    ]


def _of_afsm(best: Found) -> str:
    """State how far AFSM is from the print where the best reading has another λ."""
    if best.reading.surface_slope is None:
        return ""
    law = next(place for place, law in enumerate(OF_PAPER) if law.law == "afsm")
    return f"; AFSM's errors then differ from the print by {_ranges(best, law)}"


def _row(of: Found) -> tuple[str, ...]:
    means = np.exp(np.mean(np.log(of.ratios), axis=2)).ravel()
    limited = max(run.figures["saturated_fraction"] or 0.0 for run in of.runs)
    lost = sum(run.status != Status.COMPLETED for run in of.runs)
    return (
        of.reading.label,
        f"{of.score:.2f}",
        *(f"{mean:.3g}" for mean in means),
        f"up to {100 * limited:.0f} %",
        f"{lost} of {len(of.runs)}",
    )


def _draw(tried: Sequence[Found]) -> Drawing:
    from spheretwin.viz.figures import conditions as figures

    rows = [
        figures.RatioRow(
            f"{each.reading.label}\nscore {each.score:.2f}",
            {law.law: each.ratios[:, place].ravel() for place, law in enumerate(OF_PAPER)},
        )
        for each in tried
    ]
    labels = {law.law: law.label for law in OF_PAPER}
    title = f"Readings of (41) against the {tried[0].ratios.size} printed errors"
    caption = (
        "Largest error over the printed one, a marker a hinge and condition, under each reading of (41);"
        " the line at 1 is the paper."
    )
    figure = figures.ratios(rows, labels, "largest |error| over the printed one", title)
    return Drawing("readings_ratios.png", caption, figure)


EXPERIMENT = Experiment(
    name="readings",
    title="Readings of the control law",
    shows="The sinusoid with m = 0.2 and L = 1 and 2 under the paper's laws, their output read as a torque or"
    " as an acceleration, at several control rates.",
    cases=cases,
    tell=tell,
    findings=findings,
)
