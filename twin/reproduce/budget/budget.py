"""The error budget of the tilt: what each part of the prototype costs, for every law."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.laws.registry import LAWS
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.twin.reproduce.budget.stages import ALL, STAGES, Stage
from spheretwin.twin.reproduce.experiment import Case, Experiment, Finding, Outcome, Outcomes, Section, Table
from spheretwin.twin.reproduce.rows import of_axis, spread_deg
from spheretwin.viz.figures.drawing import Drawing

HOW = (
    "The largest *true* error, which nothing can hide. *Ideal* is the motion and the mass alone: true angles"
    " and rates, no delay, no friction, and currents that are their commands at once. The plain lag L/R of"
    " the coils, which runs without amplifiers have, is no part of the prototype, whose amplifiers drive the"
    " current: it is a row of its own. The voltage limit has amplifiers of no lag of their own on ±24 V less"
    " their drops; the bandwidth has 2 kHz on ample voltage. No sensor measures a rate: the rows of single"
    " sensor errors have the estimator too, and are to be compared with its row. All laws have their default"
    " gains.\n\n"
    "Parts do not add up. A rate that lags pushes harder at a corner, and noise feeds AFSM's adaptation (ξ̂"
    " grows with |s|): both take from its error. γ's takes two parts, offsets that push it and a sensor that"
    " sees nothing within a count."
)


def cases() -> list[Case]:
    """Every stage under every law."""
    return [case(law, stage) for law in LAWS for stage in STAGES]


def case(law: str, stage: Stage) -> Case:
    """A stage under a law."""
    return Case(
        name=f"{law}: {stage.name}",
        scenario="tilt",
        fields={"controller.law": law, **stage.overrides},
        told={"stage": stage.name, "compared_with": stage.base},
        draws=stage.draws,
    )


def tell(outcomes: Outcomes) -> list[Section]:
    """A table for each hinge, and one figure."""
    laws = [law for law in LAWS if any(case(law, stage).name in outcomes for stage in STAGES)]
    tables = [_table(outcomes, laws, axis) for axis in range(len(ANGLES))]
    most = "; ".join(filter(None, (_most(outcomes, law) for law in laws)))
    text = f"{HOW} By itself changes most: {most}." if most else HOW
    return [Section("One part at a time", text, tables, [lambda: _drawing(outcomes, laws)])]


def findings(outcomes: Outcomes) -> list[Finding]:
    """The part of the prototype that changes most, under each law."""
    most = [text for law in LAWS if (text := _most(outcomes, law))]
    return [Finding(None, f"one part of the prototype alone changes most: {'; '.join(most)}")] if most else []


def _most(outcomes: Outcomes, law: str) -> str:
    """The single part that changes the error of any hinge the most; empty where not all were run."""
    medians = {stage.name: _medians_deg(_found(outcomes, law, stage)) for stage in STAGES}
    parts = [stage for stage in STAGES if stage.fields and stage.name != ALL]
    changes = np.array([medians[stage.name] - medians[stage.base] for stage in parts])
    if not np.all(np.isfinite(changes)):
        return ""
    part, axis = np.unravel_index(np.argmax(np.abs(changes)), changes.shape)
    return f"{law}, {parts[part].name} ({ANGLES[axis]} {changes[part, axis]:+.3f}°)"


def _table(outcomes: Outcomes, laws: Sequence[str], axis: int) -> Table:
    rows = [(stage.name, *(_cell(_found(outcomes, law, stage), axis) for law in laws)) for stage in STAGES]
    title = f"Largest true |error| of {ANGLES[axis]} in degrees: median over the seeds, and range"
    return Table(title, ("switched on", *laws), rows)


def _cell(found: Sequence[Outcome], axis: int) -> str:
    return spread_deg(of_axis(found, "max_abs_error", axis)) if found else "not run"


def _found(outcomes: Outcomes, law: str, stage: Stage) -> Sequence[Outcome]:
    return outcomes.get(case(law, stage).name, ())


def _drawing(outcomes: Outcomes, laws: Sequence[str]) -> Drawing:
    from spheretwin.viz.figures import heat as figures

    by_stage = {
        stage.name: np.array([_medians_deg(_found(outcomes, law, stage)) for law in laws]) for stage in STAGES
    }
    values = np.array([by_stage[stage.name] for stage in STAGES])  # (stages, laws, 3)
    changes = values - np.array([by_stage[stage.base] for stage in STAGES])
    panels = {
        f"|error| of {name}, degrees": figures.Panel(values[:, :, axis], changes[:, :, axis])
        for axis, name in enumerate(ANGLES)
    }
    names = [stage.name for stage in STAGES]
    title, change = "One part of the prototype at a time", "change against its base, degrees"
    caption = (
        "Largest true |error|, median over the seeds. Colours: what the part changes, against ideal, or for"
        " single errors of the sensors against the estimator alone."
    )
    return Drawing("budget.png", caption, figures.heat(panels, names, laws, title, change))


def _medians_deg(found: Sequence[Outcome]) -> NDArray[np.float64]:
    """(3,) in degrees; no numbers where nothing was run."""
    if not found:
        return np.full(3, np.nan)
    return np.degrees(np.median([outcome.max_abs_error for outcome in found], axis=0))


EXPERIMENT = Experiment(
    name="budget",
    title="The error budget of the tilt",
    shows="The motion of figure 11 under every law, with each part of the prototype switched on alone.",
    cases=cases,
    tell=tell,
    findings=findings,
)
