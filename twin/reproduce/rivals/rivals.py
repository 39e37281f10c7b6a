"""The rivals as an experiment: fronts of error and variation, and AFSM-ESO paired with two of them."""

from __future__ import annotations

from spheretwin.twin.reproduce.experiment import Experiment, Finding, Outcomes, Section
from spheretwin.twin.reproduce.rivals import drawing, paired, told
from spheretwin.twin.reproduce.rivals.conditions import IDEAL, PROTOTYPE, cases
from spheretwin.twin.reproduce.rivals.fronts import points

HOW = (
    "One tuning of a law says little of the law: what errs less may only be the more restless. So each runs"
    " over seven settings of one number, a factor of 1.5 apart, about the gains that are shipped. Points are"
    " medians over the seeds of the error of the worst hinge and of the variation of the commands; a setting"
    " at which any run was lost is no point. A law's *front* are its points that none of its others beats in"
    " both; the common front is that of all laws. *Behind* is a law's least error over the least of all laws,"
    " both within the larger of the two variations."
)
WHERE = (
    "True angles and rates. The reference starts with a rate, and the largest error has a floor that no law"
    " can avoid. PID and computed torque are the same law but for the coupling of the axes, and lie on each"
    " other."
)
CHAIN = (
    "The true error of the worse of α and β; sensors' offset and gain are part of it, and no law sees them."
    " AFSM-ESO's family begins at its preset `prototype` here, and its other presets are points of their own"
    " where they are on the scale. Governed: see below."
)


def tell(outcomes: Outcomes) -> list[Section]:
    """Families, fronts on either hardware, pairs."""
    of_ideal = any(points(setting, outcomes) for setting in IDEAL)
    of_prototype = any(points(setting, outcomes) for setting in PROTOTYPE)
    return [
        Section("Families", HOW, [told.families()]),
        Section(
            "Ideal hardware",
            WHERE,
            [told.table(setting, outcomes) for setting in IDEAL],
            [lambda: drawing.ideal(outcomes)] if of_ideal else [],
        ),
        Section(
            "The prototype",
            CHAIN,
            [told.table(setting, outcomes) for setting in PROTOTYPE],
            [lambda: drawing.prototype(outcomes)] if of_prototype else [],
        ),
        paired.section(outcomes),
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Of the fronts, and of the pairs."""
    return [*told.findings(outcomes), *paired.findings(outcomes)]


EXPERIMENT = Experiment(
    name="rivals",
    title="The rivals: error against variation of the currents",
    shows="Every law over a family of its own gains: the sinusoid on ideal hardware, light and heavily"
    " loaded, and the tilt on the prototype, bare and behind a governor.",
    cases=cases,
    tell=tell,
    findings=findings,
)
