"""Figure 8: the nutation (59) with m = 0.2 and L = 2."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Case, Experiment, Finding, Outcomes, Section, Table
from spheretwin.twin.reproduce.figure8 import drawing
from spheretwin.twin.reproduce.figure8.flown import keep, side_by_side
from spheretwin.twin.reproduce.laws import COMPARED, OF_PAPER, Compared
from spheretwin.twin.reproduce.rows import ended
from spheretwin.twin.reproduce.sinusoid.conditions import ENDS
from spheretwin.twin.reproduce.sinusoid.tables import RMS, by_hinge, rms, triple

SCENARIO = "nutation"
CONDITION = {"plant.modelling_error": 0.2, "disturbance.load": 2.0}
FROM_s = 1.0

HOW = (
    "The rotor spins at 2π rad/s while its axis gyrates ever wider, to 1 rad at the end. It starts from rest"
    " and the reference with its full rate: the largest error of γ is made in the first tenths of a second"
    f" under every law that keeps the rotor, so that the largest from {FROM_s:g} s on stands beside it. The"
    " paper shows curves of q and q_d and prints no number."
)
HEAD = (
    "law",
    "gains",
    "how it ended",
    "α, mrad",
    "β, mrad",
    "γ, mrad",
    "in degrees",
    f"from {FROM_s:g} s on, mrad",
)


def case(compared: Compared) -> Case:
    """The nutation under a law."""
    return Case(
        name=f"{compared.law}: m 0.2, L 2",
        scenario=SCENARIO,
        fields={"controller.law": compared.law, **CONDITION},
        told={"gains": compared.gains},
        ends=ENDS.get(compared.law, (Status.COMPLETED,)),
    )


def tell(outcomes: Outcomes) -> list[Section]:
    """Errors, angles and paths."""
    ran = {
        compared: outcomes[case(compared).name] for compared in COMPARED if case(compared).name in outcomes
    }
    largest = [
        (
            compared.label,
            compared.gains,
            ended(found),
            *by_hinge(found, "max_abs_error"),
            triple(1e3 * np.median([each.kept.largest_after(FROM_s) for each in found], axis=0), 1),
        )
        for compared, found in ran.items()
    ]
    tables = [
        Table("Largest |error|: median over the seeds, and range", HEAD, largest, 3),
        Table(
            "RMS error, and what it costs: RMS torque, and variation of the commands a group and second",
            RMS,
            [rms(compared, found) for compared, found in ran.items()],
        ),
    ]
    shown = {
        compared: found for compared, found in ran.items() if compared.drawn and len(found[0].kept.course.t_s)
    }
    drawn = [lambda: drawing.angles(shown), lambda: drawing.errors(shown), lambda: drawing.paths(shown)]
    return [Section("The nutation under each law", HOW, tables, drawn if shown else [])]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Whether AFSM follows the nutation, PD does not, and adaptive fuzzy lies between."""
    if not all(case(compared).name in outcomes for compared in OF_PAPER):
        return []
    runs = [outcomes[case(compared).name] for compared in OF_PAPER]
    worst = [np.array([each.max_abs_error.max() for each in some]) for some in runs]
    held = all(bool(np.all(above > below)) for above, below in pairwise(worst))
    held = held and all(each.status == Status.COMPLETED for each in runs[-1])
    told = ", ".join(
        f"{compared.label} {1e3 * np.median(each):.0f} mrad{_lost([run.status for run in some])}"
        for compared, each, some in zip(OF_PAPER, worst, runs, strict=True)
    )
    says = "AFSM follows the nutation closest" if held else "the laws are not in the paper's order"
    return [Finding(held, f"{says} (largest error of any of {', '.join(ANGLES)}: {told})")]


def _lost(statuses: list[Status]) -> str:
    lost = sorted({str(each).replace("_", " ") for each in statuses if each != Status.COMPLETED})
    return f" and {', '.join(lost)}" if lost else ""


EXPERIMENT = Experiment(
    name="figure8",
    title="Figure 8: the nutation",
    shows="The motion (59) for 5 s with m = 0.2 and L = 2 on ideal hardware.",
    cases=lambda: [case(compared) for compared in COMPARED],
    tell=tell,
    keep=keep,
    findings=findings,
    side_by_side=lambda outcomes: side_by_side(
        {of: outcomes[case(of).name][0] for of in COMPARED if of.drawn and case(of).name in outcomes}
    ),
)
