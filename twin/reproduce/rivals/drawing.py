"""Figures of the comparison: the error of every law over the variation of the currents."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from spheretwin.twin.reproduce.experiment import Outcomes
from spheretwin.twin.reproduce.laws import BY_LAW
from spheretwin.twin.reproduce.rivals.conditions import Condition, Hardware
from spheretwin.twin.reproduce.rivals.results import current_limits_rad, results
from spheretwin.viz.figures.drawing import Drawing

if TYPE_CHECKING:
    from spheretwin.viz.figures.tracking.fronts import Panel

CAPTION = (
    "A marker is a law with the gains that the search found within one limit on the variation, median over"
    " the seeds; a line joins the limits. Hollow: presets as shipped."
)
FULL_CURRENT = " Grey lines: full current at the start, least norm (upper) and bounded (lower)."


def figure(hardware: Hardware, outcomes: Outcomes) -> Drawing:
    """Error over variation under the conditions with a right nominal model."""
    from spheretwin.viz.figures.tracking import fronts

    panels = [
        _panel(hardware, condition, outcomes)
        for condition in hardware.conditions
        if not condition.perturbed and results(hardware, condition, outcomes)
    ]
    drawn = fronts.fronts(
        panels, {law: compared.label for law, compared in BY_LAW.items()}, "variation of the commands, A/s"
    )
    caption = f"{hardware.title}. {CAPTION}{'' if hardware.in_degrees else FULL_CURRENT}"
    return Drawing(f"rivals_{hardware.name}.png", caption, drawn)


def _panel(hardware: Hardware, condition: Condition, outcomes: Outcomes) -> Panel:
    from spheretwin.viz.figures.tracking import fronts

    scale = np.degrees(1.0) if hardware.in_degrees else 1e3
    found = [each for each in results(hardware, condition, outcomes) if not each.is_lost]
    tuned = [each for each in found if each.limit_A_s is not None]
    points = {
        law: np.array([(each.variation_A_s, scale * each.largest_rad) for each in tuned if each.law == law])
        for law in dict.fromkeys(each.law for each in tuned)
    }
    marked = {
        each.label.rpartition(" ")[2].strip("`"): (each.law, each.variation_A_s, scale * each.largest_rad)
        for each in found
        if each.limit_A_s is None
    }
    floors = () if hardware.in_degrees else current_limits_rad(condition, outcomes).values()
    unit = "degrees" if hardware.in_degrees else "mrad"
    return fronts.Panel(
        condition.name, f"largest |error|, {unit}", points, marked, [scale * each for each in floors]
    )
