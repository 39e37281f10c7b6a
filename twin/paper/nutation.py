"""Figures of figure 8's page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models import actuator as actuators
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import (
    COMPARED,
    OF_PAPER,
    Case,
    Compared,
    Experiment,
    Finding,
    Outcome,
    Outcomes,
    ResultTable,
    Section,
)
from spheretwin.paper.experiment import Array as ExperimentArray
from spheretwin.paper.rows import ended
from spheretwin.paper.sinusoid import ENDS, RMS, by_hinge, rms, triple
from spheretwin.run import Run
from spheretwin.viz.pages.markdown import Drawing

if TYPE_CHECKING:
    from spheretwin.viz.comparison.trajectories import LawTrajectory

Array = NDArray[np.float64]

WINDOW_s = 0.05
"""Of the figure of the errors: each point is the largest within one."""

THINNED_s = 0.01
"""Between the entries of a course: the rotor turns by some 4° in that time."""


class Course(NamedTuple):
    """A run, thinned."""

    t_s: Array  # (n,)
    q_rad: Array  # (n, 3)
    q_ref_rad: Array  # (n, 3)
    torque_Nm: Array  # (n,) norm, stator frame


class Flown(NamedTuple):
    """What remains of a run."""

    windows_rad: Array  # (windows, 3) largest |error| within each
    course: Course | None
    """None but of the first seed."""

    def largest_after(self, t_s: float) -> Array:
        """(3,) largest |error| from a time on, rad; no numbers where the run had ended."""
        after = self.windows_rad[round(t_s / WINDOW_s) :]
        return after.max(axis=0) if len(after) else np.full(3, np.nan)


def keep(run: Run) -> Flown:
    """Reduce a run."""
    table, period_s = run.telemetry, run.scenario.controller.period_s
    ticks = max(1, round(WINDOW_s / period_s))
    whole = len(table) // ticks
    error = np.abs(table["error_rad"][: whole * ticks]).reshape(whole, ticks, 3)
    every = slice(None, None, max(1, round(THINNED_s / period_s)))
    course = Course(
        t_s=table["t_s"][every].copy(),
        q_rad=table["q_rad"][every].copy(),
        q_ref_rad=table["q_ref_rad"][every].copy(),
        torque_Nm=np.linalg.norm(table["torque_Nm"][every], axis=1),
    )
    return Flown(error.max(axis=1), course if run.scenario.seed == 0 else None)


def side_by_side(runs: Mapping[Compared, Outcome]) -> dict[str, LawTrajectory]:
    """Runs of the first seed for a recording, by the labels of their laws."""
    from spheretwin.viz.comparison.trajectories import LawTrajectory

    return {
        compared.label: LawTrajectory(compared.law, *outcome.kept.course)
        for compared, outcome in runs.items()
        if len(outcome.kept.course.t_s)
    }


TITLE = "Figure 8: nutation, m = 0.2, L = 2"

Runs = Mapping[Compared, Sequence[Outcome]]


def angles(runs: Runs) -> Drawing:
    """Angles of the first seed beside the desired ones."""
    from spheretwin.viz.figures import over_time as figures

    desired = _longest(runs)
    by_label = {
        compared.label: figures.AngleTraces(
            compared.law,
            found[0].kept.course.t_s,
            found[0].kept.course.q_rad,
            desired.t_s,
            desired.q_ref_rad,
            _whole(found[0]),
        )
        for compared, found in runs.items()
    }
    caption = "Angles q and what was asked of them, q_d, of the first seed."
    return Drawing("figure8_angles.png", caption, figures.angles(by_label, ANGLES, TITLE))


def errors(runs: Runs) -> Drawing:
    """Errors of all seeds over time."""
    from spheretwin.viz.figures import over_time as figures

    by_label = {
        compared.label: figures.ErrorBand(compared.law, stacked([each.kept.windows_rad for each in found]))
        for compared, found in runs.items()
    }
    window = f"{1e3 * WINDOW_s:g} ms"
    caption = f"Largest |error| within each {window}: median over the seeds, and their range as a band."
    return Drawing("figure8_errors.png", caption, figures.errors(by_label, WINDOW_s, ANGLES, TITLE))


def paths(runs: Runs) -> Drawing:
    """Paths of the shaft tip of the first seed."""
    from spheretwin.viz.figures import paths as figures
    from spheretwin.viz.scene.motion import shaft_tip

    actuator, desired = actuators.load(), _longest(runs)
    by_label = {
        compared.label: figures.TipPath(
            compared.law,
            1e3 * shaft_tip(found[0].kept.course.q_rad, actuator),
            1e3 * shaft_tip(desired.q_ref_rad, actuator),
            _whole(found[0]),
        )
        for compared, found in runs.items()
    }
    caption = "Path of the shaft's tip, desired and actual, of the first seed: in space, and from above."
    return Drawing("figure8_paths.png", caption, figures.paths(by_label, f"{TITLE}: the shaft's tip"))


def stacked(of_seeds: Sequence[ExperimentArray]) -> ExperimentArray:
    """(seeds, windows, 3); after the end of a run that ended early there are no numbers."""
    longest = max(len(each) for each in of_seeds)
    found = np.full((len(of_seeds), longest, 3), np.nan)
    for row, each in zip(found, of_seeds, strict=True):
        row[: len(each)] = each
    return found


def _whole(outcome: Outcome) -> bool:
    return outcome.status == Status.COMPLETED


def _longest(runs: Runs) -> Course:
    """Of the first seed, the course that has the whole of what was asked."""
    courses: list[Course] = [found[0].kept.course for found in runs.values()]
    return max(courses, key=lambda course: len(course.t_s))


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
        ResultTable("Largest |error|: median over the seeds, and range", HEAD, largest, 3),
        ResultTable(
            "RMS error, and what it costs: RMS torque, and variation of the commands a group and second",
            RMS,
            [rms(compared, found) for compared, found in ran.items()],
        ),
    ]
    shown = {
        compared: found for compared, found in ran.items() if compared.drawn and len(found[0].kept.course.t_s)
    }
    drawn = [lambda: angles(shown), lambda: errors(shown), lambda: paths(shown)]
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
