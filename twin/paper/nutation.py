"""Figure 8: the nutation under every law."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spheretwin.models import actuator as actuators
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.paper.cells import Numbers, hinges
from spheretwin.paper.experiment import (
    Array,
    ExperimentSection,
    Outcomes,
    RunOutcome,
    Statement,
    padded,
    window_maxima,
)
from spheretwin.paper.experiment_file import PAPER_LAWS, CaseRuns, ExperimentFile
from spheretwin.run import Run
from spheretwin.viz.pages.markdown import Drawing

if TYPE_CHECKING:
    from spheretwin.viz.comparison.runs import LawTrajectory

FILE = ExperimentFile("figure8")

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
    windows = window_maxima(table["error_rad"], WINDOW_s, period_s)
    return NutationData(windows, trajectory if run.scenario.seed == 0 else None)


TITLE = "Figure 8: nutation, m = 0.2, L = 2"

Items = Sequence[CaseRuns]


def angles(items: Items) -> Drawing:
    """Angles of the first seed and the desired ones."""
    from spheretwin.viz.figures import over_time as figures

    desired = _longest(items)
    by_label = {
        item["label"]: figures.AngleTraces(
            item["law"],
            item.runs[0].data.trajectory.t_s,
            item.runs[0].data.trajectory.q_rad,
            desired.t_s,
            desired.q_ref_rad,
            item.runs[0].is_complete,
        )
        for item in items
    }
    return FILE.drawing("angles", figures.angles(by_label, ANGLES, TITLE))


def errors(items: Items) -> Drawing:
    """Errors of all seeds over time."""
    from spheretwin.viz.figures import over_time as figures

    by_label = {
        item["label"]: figures.ErrorBand(item["law"], padded([run.data.windows_rad for run in item.runs]))
        for item in items
    }
    figure = figures.errors(by_label, WINDOW_s, ANGLES, TITLE)
    return FILE.drawing("errors", figure, window_ms=1e3 * WINDOW_s)


def paths(items: Items) -> Drawing:
    """Paths of the shaft tip of the first seed."""
    from spheretwin.viz.figures import over_time as figures
    from spheretwin.viz.scene.places import shaft_tip

    actuator, desired = actuators.load(), _longest(items)
    by_label = {
        item["label"]: figures.TipPath(
            item["law"],
            1e3 * shaft_tip(item.runs[0].data.trajectory.q_rad, actuator),
            1e3 * shaft_tip(desired.q_ref_rad, actuator),
            item.runs[0].is_complete,
        )
        for item in items
    }
    return FILE.drawing("paths", figures.paths(by_label, f"{TITLE}: the shaft's tip"))


def _longest(items: Items) -> Trajectory:
    """Trajectory of the first seed with the longest reference."""
    trajectories: list[Trajectory] = [item.runs[0].data.trajectory for item in items]
    return max(trajectories, key=lambda trajectory: len(trajectory.t_s))


def _later(item: CaseRuns) -> tuple[Numbers, ...]:
    return hinges(run.data.largest_after(FROM_s) for run in item.runs)


def sections(outcomes: Outcomes) -> list[ExperimentSection]:
    """Errors, angles and paths."""
    items, shown = FILE.runs(outcomes), _in_figures(outcomes)
    tables = [FILE.table("largest", items, later=_later), FILE.table("effort", items)]
    drawings = [lambda: angles(shown), lambda: errors(shown), lambda: paths(shown)] if shown else []
    return [FILE.section("laws", tables, drawings, from_s=FROM_s)]


def findings(outcomes: Outcomes) -> list[Statement]:
    """Compare the order of the laws with the paper's."""
    runs = [outcomes.runs(FILE.case(law=law.law)) for law in PAPER_LAWS]
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
    return [Statement(in_order, f"{verdict} (largest error of any of {', '.join(ANGLES)}: {texts})")]


def _loss_text(runs: Sequence[RunOutcome]) -> str:
    lost = sorted({str(run.status).replace("_", " ") for run in runs if not run.is_complete})
    return f" and {', '.join(lost)}" if lost else ""


def _in_figures(outcomes: Outcomes) -> Items:
    """Laws of the figures whose first run lasted."""
    return [item for item in FILE.runs(outcomes, in_figures=True) if len(item.runs[0].data.trajectory.t_s)]


def trajectories(outcomes: Outcomes) -> dict[str, LawTrajectory]:
    """Runs of the first seed for a recording, by the labels of their laws."""
    from spheretwin.viz.comparison.runs import LawTrajectory

    return {
        item["label"]: LawTrajectory(item["law"], *item.runs[0].data.trajectory)
        for item in _in_figures(outcomes)
    }


EXPERIMENT = FILE.experiment(sections=sections, reduce=reduce, findings=findings, trajectories=trajectories)
