"""Figures of the fronts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from spheretwin.twin.reproduce.experiment import Outcomes
from spheretwin.twin.reproduce.laws import BY_LAW
from spheretwin.twin.reproduce.rivals.conditions import IDEAL, PROTOTYPE, Setting
from spheretwin.twin.reproduce.rivals.fronts import LARGEST, TAIL, Point, front, on_front, plane, points
from spheretwin.viz.figures.drawing import Drawing

if TYPE_CHECKING:
    from spheretwin.viz.figures.tracking.fronts import Panel

TITLES = {LARGEST: "largest |error|", TAIL: "RMS error, second half"}
VARIATION = "variation of the commands, A/s"

READ = (
    "Each marker is a law at one setting, median over the seeds; a line joins a law's front, and faint"
    " markers are not on it. A ring is where its family begins; the grey band is the common front of all."
)


def ideal(outcomes: Outcomes) -> Drawing:
    """Both errors under both conditions of the sinusoid."""
    from spheretwin.viz.figures.tracking import fronts as figures

    ran = [setting for setting in IDEAL if points(setting, outcomes)]
    panels = [
        _panel(setting, points(setting, outcomes), error, 1e3, "mrad", 60.0)
        for error in TITLES
        for setting in ran
    ]
    figure = figures.fronts(panels, _labels(IDEAL), VARIATION, len(ran))
    return Drawing("rivals_ideal.png", f"The sinusoid on ideal hardware, worst hinge. {READ}", figure)


def prototype(outcomes: Outcomes) -> Drawing:
    """The tilt, with what stands around a law and without."""
    from spheretwin.viz.figures.tracking import fronts as figures

    panels = [
        _panel(setting, of, LARGEST, np.degrees(1.0), "degrees", 12.0)
        for setting in PROTOTYPE
        if (of := points(setting, outcomes))
    ]
    bare = panels[0].by_law
    for place, panel in enumerate(panels[1:], start=1):
        beside = {law: bare[law].values[bare[law].front] for law in panel.by_law if law in bare}
        panels[place] = panel._replace(title=f"{panel.title} (hollow: without)", beside=beside)
    figure = figures.fronts(panels, _labels(PROTOTYPE), VARIATION, len(panels))
    caption = (
        f"The tilt on the prototype, true error of the worse of α and β. {READ} Hollow,"
        " beside those governed: the fronts without governor and feed-forward."
    )
    return Drawing("rivals_prototype.png", caption, figure)


def _labels(settings: Sequence[Setting]) -> dict[str, str]:
    return {law: BY_LAW[law].label for setting in settings for law in setting.laws}


def _panel(setting: Setting, of: Sequence[Point], error: str, scale: float, unit: str, most: float) -> Panel:
    from spheretwin.viz.figures.tracking import fronts as figures

    to = np.array([1.0, scale])
    clouds = {}
    for law in setting.laws:
        own = [each for each in of if each.law == law and not each.preset]
        if own:
            values = plane(own, error)
            begins = np.array([each.shipped for each in own])
            clouds[law] = figures.Cloud(to * values, front(values), begins)
    return figures.Panel(
        setting.title,
        f"{TITLES[error]}, {unit}",
        clouds,
        to * plane(on_front(of, error), error),
        {each.preset: (each.law, *(to * plane([each], error))[0]) for each in of if each.preset},
        most,
    )
