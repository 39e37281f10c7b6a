"""Figures of figure 8's page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from spheretwin.models import actuator as actuators
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Array, Outcome
from spheretwin.twin.reproduce.figure8.flown import Course, WINDOW_s
from spheretwin.twin.reproduce.laws import Compared
from spheretwin.viz.figures.drawing import Drawing

TITLE = "Figure 8: nutation, m = 0.2, L = 2"

Runs = Mapping[Compared, Sequence[Outcome]]


def angles(runs: Runs) -> Drawing:
    """Angles of the first seed beside the desired ones."""
    from spheretwin.viz.figures.tracking import over_time as figures

    desired = _longest(runs)
    by_label = {
        compared.label: figures.Motion(
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
    from spheretwin.viz.figures.tracking import over_time as figures

    by_label = {
        compared.label: figures.Course(compared.law, stacked([each.kept.windows_rad for each in found]))
        for compared, found in runs.items()
    }
    window = f"{1e3 * WINDOW_s:g} ms"
    caption = f"Largest |error| within each {window}: median over the seeds, and their range as a band."
    return Drawing("figure8_errors.png", caption, figures.errors(by_label, WINDOW_s, ANGLES, TITLE))


def paths(runs: Runs) -> Drawing:
    """Paths of the shaft tip of the first seed."""
    from spheretwin.viz.figures.tracking import paths as figures
    from spheretwin.viz.scene.poses import shaft_tip

    actuator, desired = actuators.load(), _longest(runs)
    by_label = {
        compared.label: figures.Path(
            compared.law,
            1e3 * shaft_tip(found[0].kept.course.q_rad, actuator),
            1e3 * shaft_tip(desired.q_ref_rad, actuator),
            _whole(found[0]),
        )
        for compared, found in runs.items()
    }
    caption = "Path of the shaft's tip, desired and actual, of the first seed: in space, and from above."
    return Drawing("figure8_paths.png", caption, figures.paths(by_label, f"{TITLE}: the shaft's tip"))


def stacked(of_seeds: Sequence[Array]) -> Array:
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
