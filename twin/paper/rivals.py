"""Comparison of the tuned laws as an experiment."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from spheretwin.paper import rival_results
from spheretwin.paper.experiment import Experiment, Outcomes, Section
from spheretwin.paper.laws import BY_LAW
from spheretwin.paper.rival_conditions import HARDWARE, Condition, Hardware, cases, study
from spheretwin.paper.rival_results import current_limits_rad, results, start_error
from spheretwin.viz.pages.markdown import Drawing

if TYPE_CHECKING:
    from spheretwin.viz.figures.fronts import FrontPanel

CAPTION = (
    "Marker: a law with the gains that the search found within one limit on the variation, median over the"
    " seeds. Line: the limits of one law. Hollow marker: preset as shipped."
)
FULL_CURRENT = " Grey lines: error with full current at the start, least norm (upper) and bounded (lower)."


def figure(hardware: Hardware, outcomes: Outcomes) -> Drawing:
    """Error over variation under the conditions with a right nominal model."""
    from spheretwin.viz.figures import fronts

    panels = [
        _panel(hardware, condition, outcomes)
        for condition in hardware.conditions
        if not condition.perturbed and results(hardware, condition, outcomes)
    ]
    labels = {name: law.label for name, law in BY_LAW.items()}
    front = fronts.fronts(panels, labels, "variation of the commands, A/s")
    caption = f"{hardware.title}. {CAPTION}{'' if hardware.in_degrees else FULL_CURRENT}"
    return Drawing(f"rivals_{hardware.name}.svg", caption, front)


def _panel(hardware: Hardware, condition: Condition, outcomes: Outcomes) -> FrontPanel:
    from spheretwin.viz.figures import fronts

    scale = np.degrees(1.0) if hardware.in_degrees else 1e3
    complete = [result for result in results(hardware, condition, outcomes) if not result.is_lost]
    points = {
        law: np.array(
            [
                (result.variation_A_s, scale * result.largest_rad)
                for result in complete
                if result.law == law and result.limit_A_s is not None
            ]
        )
        for law in dict.fromkeys(result.law for result in complete if result.limit_A_s is not None)
    }
    presets = {
        result.label.rpartition(" ")[2].strip("`"): (
            result.law,
            result.variation_A_s,
            scale * result.largest_rad,
        )
        for result in complete
        if result.limit_A_s is None
    }
    floors = () if hardware.in_degrees else current_limits_rad(condition, outcomes).values()
    unit = "degrees" if hardware.in_degrees else "mrad"
    return fronts.FrontPanel(
        condition.name, f"largest |error|, {unit}", points, presets, [scale * floor for floor in floors]
    )


METHOD = (
    "The search gives every law the same budget: {draws} points of a Sobol sequence over all of its gains,"
    " then {perturbations} perturbations of the best point within each limit on the variation of the"
    " currents. All laws have the same seed. The reference governor and the feed-forward of inertia and"
    " friction are gains of every law, and each may be off. The package contains the gains;"
    " `make tune-rivals` repeats the search. The tables show medians over the seeds of this page, which the"
    " search did not use, each error with the 95 % interval of its median in brackets. Two laws whose"
    " intervals overlap are *level*: the order of their rows is that of the medians and ranks nothing."
    " A dash in a table stands for a law without gains within the limit."
)
OBJECTIVES = {
    "ideal": (
        "The search minimises the geometric mean of the largest errors at m = 0.2, L = 1 and at m = 0.5,"
        " L = 5, with the same gains; the limit applies at m = 0.2, L = 1. No law was tuned for m = 0,"
        " L = 0. *Full current* is the smallest error that ±8 A allow at the start, where the reference has"
        " a rate and the rotor is at rest: the largest error until the rates agree, with the full current"
        " against the rate error. All laws here use the least-norm allocation. A law can have a slightly"
        " smaller error than the row of the least norm, as its torque can have another direction."
    ),
    "electronics": (
        "The search minimises the larger true error of α and β without the offset and gain errors of the"
        " converter, which no law can observe. All gains of γ, whose encoder has coarse steps, may be"
        " reduced by a common ratio."
    ),
}
ROBUSTNESS = (
    "The same gains with a wrong nominal model of the controller. No law was tuned for it. Group gains are"
    " drawn from the seed of each run. *Lost*: a run did not complete."
)

PROTOTYPE_TEXT = (
    "The same gains on `--hardware prototype`: the electronics with scattered poles and coils, errors of the"
    " mass properties and hinges, static friction, a cable, coupled coils, temperatures, hysteresis of its"
    " sensors, and the offset and gain errors of its converter. Median and worst of the seeds. No law was"
    " tuned for it."
)


PREDICTIVE_TEXT = (
    "Nonlinear predictive control with IPOPT (`spheretwin.casadi`, extra `casadi`) on the tilt with the"
    " prototype's electronics, as shipped: it was not in the search. It solves once in 10 control periods and"
    " corrects the torque by the estimated disturbance at every tick. One run of each law under each"
    " condition, all with the same seed, as a run of predictive control takes half a minute. The other laws"
    " have the gains within the largest limit, or a preset."
)


def _sections(outcomes: Outcomes) -> list[Section]:
    predictive = rival_results.predictive_control(outcomes)
    return _of_tuned(outcomes) + [
        Section("Predictive control", PREDICTIVE_TEXT, [table]) for table in predictive
    ]


def _of_tuned(outcomes: Outcomes) -> list[Section]:
    return [
        section
        for hardware in HARDWARE
        if any(results(hardware, condition, outcomes) for condition in hardware.conditions)
        for section in _of_hardware(hardware, outcomes)
    ]


def _of_hardware(hardware: Hardware, outcomes: Outcomes) -> list[Section]:
    title = hardware.title.capitalize()
    optimise = study(hardware.study).optimise
    method = METHOD.format(**optimise.model_dump()) if optimise else ""
    return [
        Section(
            title,
            f"{method}\n\n{OBJECTIVES[hardware.name]}",
            rival_results.errors(hardware, outcomes),
            [lambda: figure(hardware, outcomes)],
        ),
        Section(f"{title}: robustness", ROBUSTNESS, rival_results.robustness(hardware, outcomes)),
        *(
            Section(f"{title}: every imperfection", PROTOTYPE_TEXT, [table])
            for table in rival_results.complete_prototype(hardware, outcomes)
        ),
        Section(f"{title}: gains", "", [rival_results.ranges(hardware), rival_results.gains_table(hardware)]),
    ]


EXPERIMENT = Experiment(
    name="rivals",
    title="Comparison of the laws, tuned by the same search",
    summary="A search with the same budget tuned every law for the sinusoid on ideal hardware and for the"
    " tilt with the prototype's electronics, within limits on the variation of the currents. The laws run"
    " with these gains under other seeds and with a wrong nominal model.",
    cases=cases,
    sections=_sections,
    reduce=start_error,
    findings=rival_results.findings,
)
