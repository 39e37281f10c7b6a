"""Figures 6 and 7 as experiments."""

from __future__ import annotations

from functools import partial

import numpy as np

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Experiment, Finding, Outcomes, Section
from spheretwin.twin.reproduce.laws import COMPARED
from spheretwin.twin.reproduce.printed import printed_rad
from spheretwin.twin.reproduce.sinusoid import findings
from spheretwin.twin.reproduce.sinusoid.conditions import FIGURE6, FIGURE7, Condition, Varied, case, cases
from spheretwin.twin.reproduce.sinusoid.tables import tables
from spheretwin.viz.figures.drawing import Drawing

HOW = (
    "The sinusoid on all three hinges for 10 s, from rest, on ideal hardware: true angles and rates, currents"
    " within ±8 A behind the lag of the coils. The reference starts with a rate, so that every run begins"
    " with an error that no law can avoid. All gains are the laws' own at every point. The paper prints"
    " numbers at m = 0.2, for L = 1 and L = 2 alone; all else of its figure is a curve to be compared by eye."
)


PRINTED_IN = {"figure6": Condition(0.2, 1.0), "figure7": Condition(0.2, 2.0)}
"""Where the paper prints numbers of each figure; the first is a point of the other figure, too."""


def _tell(varied: Varied, outcomes: Outcomes) -> list[Section]:
    return [
        Section(
            f"Errors over the {varied.what}",
            HOW,
            tables(varied, outcomes),
            [lambda: _draw(varied, outcomes)],
        )
    ]


def _findings(varied: Varied, outcomes: Outcomes) -> list[Finding]:
    found = [*findings.order(varied, outcomes), *findings.sizes(PRINTED_IN[varied.figure], outcomes)]
    return [*found, *findings.growth(varied, outcomes)] if varied is FIGURE7 else found


def _draw(varied: Varied, outcomes: Outcomes) -> Drawing:
    from spheretwin.viz.figures.tracking import by_condition as figures

    by_label = {}
    for compared in COMPARED:
        if not compared.drawn:
            continue
        points = [at for at in varied.conditions if case(compared, at).name in outcomes]
        if not points:
            continue
        runs = [outcomes[case(compared, at).name] for at in points]
        errors = [np.quantile([each.max_abs_error for each in some], [0, 0.5, 1], axis=0) for some in runs]
        by_label[compared.label] = figures.Series(
            law=compared.law,
            values=np.array([varied.value(at) for at in points]),
            error_rad=np.stack(errors, axis=1),
            whole=np.array([all(each.status == Status.COMPLETED for each in some) for some in runs]),
            paper_rad={varied.value(at): paper for at in points if (paper := printed_rad(compared.law, *at))},
        )
    fixed = "L = 1" if varied is FIGURE6 else "m = 0.2"
    title = f"Figure {varied.figure.removeprefix('figure')}: sinusoid, {fixed}, largest |error|"
    figure = figures.by_condition(by_label, ANGLES, varied.what, "largest |error|", title)
    caption = (
        f"Largest |error| of each hinge over the {varied.what}, {fixed}: median over the seeds, range as"
        " error bars. Wide bars are the numbers that the paper prints, tied to those of the same law; a"
        " hollow marker is of runs that ended early."
    )
    return Drawing(f"{varied.figure}_errors.png", caption, figure)


def _experiment(varied: Varied, shows: str) -> Experiment:
    number = varied.figure.removeprefix("figure")
    return Experiment(
        name=varied.figure,
        title=f"Figure {number}: the sinusoid over the {varied.what}",
        shows=shows,
        cases=partial(cases, varied),
        tell=partial(_tell, varied),
        findings=partial(_findings, varied),
    )


EXPERIMENT_6 = _experiment(
    FIGURE6, "Largest tracking errors with L = 1 and a plant whose inertia is (1 + m) times the nominal one."
)
EXPERIMENT_7 = _experiment(
    FIGURE7, "Largest tracking errors with m = 0.2 and a load torque of L · 0.05 N·m on every hinge."
)
