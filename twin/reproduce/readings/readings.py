"""The ablation of the control law's reading, by how near it comes to all numbers that the paper prints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import (
    Array,
    Experiment,
    Finding,
    Outcome,
    Outcomes,
    Section,
    Table,
)
from spheretwin.twin.reproduce.laws import OF_PAPER
from spheretwin.twin.reproduce.printed import PRINTED_rad, printed_rad
from spheretwin.twin.reproduce.readings.conditions import AS_SHIPPED, READINGS, TORQUE, Reading, case, cases
from spheretwin.viz.figures.drawing import Drawing

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
    table = Table(
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
    from spheretwin.viz.figures.tracking import ratios as figures

    rows = [
        figures.Row(
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
