"""Comparison of the tuned laws as an experiment."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from spheretwin.paper import rival_results
from spheretwin.paper.experiment import ExperimentSection, Outcomes
from spheretwin.paper.laws import BY_LAW
from spheretwin.paper.rival_conditions import FILE, HARDWARE, Hardware, cases
from spheretwin.paper.rival_results import conditions, current_limits_rad, results, start_error
from spheretwin.viz.pages.markdown import Drawing

if TYPE_CHECKING:
    from spheretwin.viz.figures.fronts import FrontPanel


def figure(hardware: Hardware, outcomes: Outcomes) -> Drawing:
    """Error over variation under the conditions with a right nominal model."""
    from spheretwin.viz.figures import fronts

    panels = [
        _panel(hardware, condition, outcomes)
        for condition in conditions(hardware, perturbed=False)
        if results(hardware, condition, outcomes)
    ]
    labels = {name: law.label for name, law in BY_LAW.items()}
    front = fronts.fronts(panels, labels, "variation of the commands, A/s")
    return FILE.drawing(f"{hardware.name}_errors", front)


def _panel(hardware: Hardware, condition: str, outcomes: Outcomes) -> FrontPanel:
    from spheretwin.viz.figures import fronts

    scale = np.degrees(1.0) if hardware.in_degrees else 1e3
    tuned: dict[str, list[tuple[float, float]]] = {}
    presets: dict[str, tuple[str, float, float]] = {}
    for result in results(hardware, condition, outcomes):
        point = result.variation_A_s, float(scale * result.largest_rad)
        if result.is_lost:
            continue
        if result.preset is None:
            tuned.setdefault(result.law, []).append(point)
        else:
            presets[result.preset] = (result.law, *point)
    points = {law: np.array(of_law) for law, of_law in tuned.items()}
    floors = () if hardware.in_degrees else current_limits_rad(condition, outcomes).values()
    unit = "degrees" if hardware.in_degrees else "mrad"
    return fronts.FrontPanel(
        condition, f"largest |error|, {unit}", points, presets, [scale * floor for floor in floors]
    )


def _sections(outcomes: Outcomes) -> list[ExperimentSection]:
    predictive = rival_results.predictive_control(outcomes)
    return [
        section
        for hardware in HARDWARE
        if FILE.runs(outcomes, setting=hardware.name)
        for section in _of_hardware(hardware, outcomes)
    ] + [FILE.section("predictive_control", [table]) for table in predictive]


def _of_hardware(hardware: Hardware, outcomes: Outcomes) -> list[ExperimentSection]:
    title, search = hardware.title.capitalize(), hardware.search
    method = FILE["method"].format(draws=search.draws, perturbations=search.perturbations)
    errors = rival_results.errors(hardware, outcomes)
    complete = rival_results.complete_prototype(hardware, outcomes)
    gains = [rival_results.ranges(hardware), rival_results.gains_table(hardware)]
    return [
        FILE.section(f"{hardware.name}_errors", errors, [lambda: figure(hardware, outcomes)], method=method),
        FILE.section("robustness", rival_results.robustness(hardware, outcomes), title=title),
        *(FILE.section("prototype", [table], title=title) for table in complete),
        FILE.section("gains", gains, title=title),
    ]


EXPERIMENT = FILE.experiment(
    cases=cases, sections=_sections, reduce=start_error, findings=rival_results.findings
)
