"""Figure 8: the nutation under every law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models import actuator as actuators
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Status
from spheretwin.paper import page
from spheretwin.paper.experiment import Case, Experiment, Finding, Outcome, Outcomes, ResultTable, Section
from spheretwin.paper.laws import COMPARED_LAWS, PAPER_LAWS, ComparedLaw
from spheretwin.paper.sinusoid import EFFORT_HEAD, EFFORT_TITLE, EXPECTED, by_hinge, effort, triple
from spheretwin.run import Run
from spheretwin.viz.pages.markdown import Drawing

if TYPE_CHECKING:
    from spheretwin.viz.comparison.trajectories import LawTrajectory

Array = NDArray[np.float64]

SCENARIO = "nutation"
CONDITION = {"plant.modelling_error": 0.2, "disturbance.load": 2.0}
FROM_s = 1.0

WINDOW_s = 0.05
"""Window of the figure of the errors: each point is the largest error within one."""

SAMPLE_s = 0.01
"""Interval of the rows of a trajectory, in which the rotor turns by some 4°."""


class Trajectory(NamedTuple):
    """Samples of a run."""

    t_s: Array  # (n,)
    q_rad: Array  # (n, 3)
    q_ref_rad: Array  # (n, 3)
    torque_Nm: Array  # (n,) norm, stator frame


class NutationData(NamedTuple):
    """Reduction of a run."""

    windows_rad: Array  # (windows, 3) largest |error| within each
    trajectory: Trajectory | None
    """Of the first seed alone."""

    def largest_after(self, t_s: float) -> Array:
        """(3,) largest |error| from a time on, rad; NaN if the run had ended."""
        after = self.windows_rad[round(t_s / WINDOW_s) :]
        return after.max(axis=0) if len(after) else np.full(3, np.nan)


def case(law: ComparedLaw) -> Case:
    """Case of the nutation under a law."""
    return Case(
        name=f"{law.law}: m 0.2, L 2",
        scenario=SCENARIO,
        fields={"controller.law": law.law, **CONDITION},
        details={"gains": law.gains},
        expected_statuses=EXPECTED.get(law.law, (Status.COMPLETED,)),
    )


def reduce(run: Run) -> NutationData:
    """Reduce a run."""
    table, period_s = run.telemetry, run.scenario.controller.period_s
    every = slice(None, None, max(1, round(SAMPLE_s / period_s)))
    trajectory = Trajectory(
        t_s=table["t_s"][every].copy(),
        q_rad=table["q_rad"][every].copy(),
        q_ref_rad=table["q_ref_rad"][every].copy(),
        torque_Nm=np.linalg.norm(table["torque_Nm"][every], axis=1),
    )
    windows = page.window_maxima(table["error_rad"], WINDOW_s, period_s)
    return NutationData(windows, trajectory if run.scenario.seed == 0 else None)


TITLE = "Figure 8: nutation, m = 0.2, L = 2"

Runs = Mapping[ComparedLaw, Sequence[Outcome]]


def angles(runs: Runs) -> Drawing:
    """Angles of the first seed and the desired ones."""
    from spheretwin.viz.figures import over_time as figures

    desired = _longest(runs)
    by_label = {
        law.label: figures.AngleTraces(
            law.law,
            first.data.trajectory.t_s,
            first.data.trajectory.q_rad,
            desired.t_s,
            desired.q_ref_rad,
            first.is_complete,
        )
        for law, (first, *_) in runs.items()
    }
    caption = "Angles q and their references q_d, first seed."
    return Drawing("figure8_angles.svg", caption, figures.angles(by_label, ANGLES, TITLE))


def errors(runs: Runs) -> Drawing:
    """Errors of all seeds over time."""
    from spheretwin.viz.figures import over_time as figures

    by_label = {
        law.label: figures.ErrorBand(law.law, page.padded([run.data.windows_rad for run in of_law]))
        for law, of_law in runs.items()
    }
    window = f"{1e3 * WINDOW_s:g} ms"
    caption = f"Largest |error| within each {window}: median over the seeds, and their range as a band."
    return Drawing("figure8_errors.svg", caption, figures.errors(by_label, WINDOW_s, ANGLES, TITLE))


def paths(runs: Runs) -> Drawing:
    """Paths of the shaft tip of the first seed."""
    from spheretwin.viz.figures import over_time as figures
    from spheretwin.viz.scene.entities import shaft_tip

    actuator, desired = actuators.load(), _longest(runs)
    by_label = {
        law.label: figures.TipPath(
            law.law,
            1e3 * shaft_tip(first.data.trajectory.q_rad, actuator),
            1e3 * shaft_tip(desired.q_ref_rad, actuator),
            first.is_complete,
        )
        for law, (first, *_) in runs.items()
    }
    caption = "Path of the shaft's tip, desired and actual, of the first seed: in space, and from above."
    return Drawing("figure8_paths.svg", caption, figures.paths(by_label, f"{TITLE}: the shaft's tip"))


def _longest(runs: Runs) -> Trajectory:
    """Trajectory of the first seed with the longest reference."""
    trajectories: list[Trajectory] = [first.data.trajectory for first, *_ in runs.values()]
    return max(trajectories, key=lambda trajectory: len(trajectory.t_s))


METHOD = (
    "The rotor spins at 2π rad/s while its axis gyrates with a growing amplitude, up to 1 rad. The rotor"
    " starts from rest and the reference with its full rate. Under every law that keeps the rotor, the error"
    f" of γ is therefore largest in the first tenths of a second; the last column has the largest error after"
    f" {FROM_s:g} s. The paper shows curves of q and q_d and prints no number."
)
HEAD = (
    "law", "gains", "status", "α, mrad", "β, mrad", "γ, mrad", "in degrees",
    f"from {FROM_s:g} s on, mrad",
)  # fmt: skip


def sections(outcomes: Outcomes) -> list[Section]:
    """Errors, angles and paths."""
    by_law = {law: runs for law in COMPARED_LAWS if (runs := outcomes.runs(case(law)))}
    largest = [
        (
            law.label,
            law.gains,
            page.statuses_text(runs),
            *by_hinge(runs, "max_abs_error"),
            triple(1e3 * np.median([run.data.largest_after(FROM_s) for run in runs], axis=0), 1),
        )
        for law, runs in by_law.items()
    ]
    tables = [
        ResultTable("Largest |error|: median over the seeds, and range", HEAD, largest, 3),
        ResultTable(EFFORT_TITLE, EFFORT_HEAD, [effort(law, runs) for law, runs in by_law.items()]),
    ]
    shown = _in_figures(outcomes)
    drawings = [lambda: angles(shown), lambda: errors(shown), lambda: paths(shown)] if shown else []
    return [Section("The nutation under each law", METHOD, tables, drawings)]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Compare the order of the laws with the paper's."""
    runs = [outcomes.runs(case(law)) for law in PAPER_LAWS]
    if not all(runs):
        return []
    worst = [np.array([run.max_abs_error.max() for run in of_law]) for of_law in runs]
    in_order = all(bool(np.all(above > below)) for above, below in pairwise(worst))
    in_order = in_order and all(run.is_complete for run in runs[-1])
    texts = ", ".join(
        f"{law.label} {1e3 * np.median(error):.0f} mrad{_loss_text(of_law)}"
        for law, error, of_law in zip(PAPER_LAWS, worst, runs, strict=True)
    )
    verdict = "AFSM follows the nutation closest" if in_order else "the laws are not in the paper's order"
    return [Finding(in_order, f"{verdict} (largest error of any of {', '.join(ANGLES)}: {texts})")]


def _loss_text(runs: Sequence[Outcome]) -> str:
    lost = sorted({str(run.status).replace("_", " ") for run in runs if not run.is_complete})
    return f" and {', '.join(lost)}" if lost else ""


def _in_figures(outcomes: Outcomes) -> Runs:
    """Runs of the laws of the figures whose first run lasted."""
    laws = {law: outcomes.runs(case(law)) for law in COMPARED_LAWS if law.in_figures}
    return {law: runs for law, runs in laws.items() if runs and len(runs[0].data.trajectory.t_s)}


def trajectories(outcomes: Outcomes) -> dict[str, LawTrajectory]:
    """Runs of the first seed for a recording, by the labels of their laws."""
    from spheretwin.viz.comparison.trajectories import LawTrajectory

    return {
        law.label: LawTrajectory(law.law, *first.data.trajectory)
        for law, (first, *_) in _in_figures(outcomes).items()
    }


EXPERIMENT = Experiment(
    name="figure8",
    title="Figure 8: the nutation",
    summary="The motion (59) for 5 s with m = 0.2 and L = 2 on ideal hardware.",
    cases=lambda: [case(law) for law in COMPARED_LAWS],
    sections=sections,
    reduce=reduce,
    findings=findings,
    trajectories=trajectories,
)
