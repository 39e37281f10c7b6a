"""Comparison of the laws as an experiment."""

from __future__ import annotations

from spheretwin.twin.reproduce.experiment import Experiment, Outcomes, Section
from spheretwin.twin.reproduce.rivals import drawing, tables
from spheretwin.twin.reproduce.rivals.conditions import HARDWARE, Hardware, cases
from spheretwin.twin.reproduce.rivals.results import results, start_error
from spheretwin.twin.reproduce.rivals.tuned_gains import study

METHOD = (
    "Every law is tuned with the same budget: {draws} points of a Sobol sequence over all of its gains, then"
    " {perturbations} perturbations of the best within each limit on the variation of the currents, under the"
    " same seed for all. The reference governor and the feed-forward of inertia and friction are gains of"
    " every law: each may be off. The gains are frozen in the package; `make tune-rivals` searches them"
    " again. The figures below are medians over the seeds of this page, which the search did not use."
)
OBJECTIVES = {
    "ideal": (
        "Objective: the geometric mean of the largest errors at m = 0.2, L = 1 and at m = 0.5, L = 5, with"
        " the same gains; the limit holds at m = 0.2, L = 1. m = 0, L = 0 was not tuned for. *Full current*"
        " is what ±8 A allow at the start, where the reference has a rate and the rotor is at rest: the"
        " largest error until the rates agree, with all of the current against the error of the rate. Least"
        " norm is the allocation of all laws here; a law can be some percent below its row, as it may"
        " share the torque among the hinges in another way."
    ),
    "prototype": (
        "Objective: the true error of the worse of α and β without the offset and gain errors of the"
        " converter, which no law can observe. All gains of γ, whose encoder is coarse, may be lower by a"
        " common ratio."
    ),
}
ROBUSTNESS = (
    "The same gains while the controller's nominal model is wrong. None was tuned for. Group gains are drawn"
    " from the seed of each run; *lost* means that a run did not complete."
)


def _sections(outcomes: Outcomes) -> list[Section]:
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
            f"{method} {OBJECTIVES[hardware.name]}",
            [tables.errors(hardware, outcomes)],
            [lambda: drawing.figure(hardware, outcomes)],
        ),
        Section(f"{title}: robustness", ROBUSTNESS, [tables.robustness(hardware, outcomes)]),
        Section(f"{title}: gains", "", [tables.ranges(hardware), tables.gains(hardware)]),
    ]


EXPERIMENT = Experiment(
    name="rivals",
    title="The laws compared: the same search for all",
    shows="Every law tuned with the same budget for the sinusoid on ideal hardware and for the tilt on the"
    " prototype, within limits on the variation of the currents, and run under other seeds and with a wrong"
    " nominal model.",
    cases=cases,
    tell=_sections,
    keep=start_error,
    findings=tables.findings,
)
