"""Error budget of the tilt: cost of each part of the prototype, for every law."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatch
from typing import Any

import numpy as np

from spheretwin.control.laws import HINGE_LAWS
from spheretwin.models import actuator
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.paper.cells import Numbers, of_axis, table
from spheretwin.paper.experiment import Array, Case, ExperimentSection, Outcomes, RunOutcome, Statement
from spheretwin.paper.experiment_file import BY_LAW, ExperimentFile
from spheretwin.scenario.hardware import HARDWARE, MACHINE
from spheretwin.viz.pages.markdown import Drawing

FILE = ExperimentFile("budget", law=[{"law": law} for law in HINGE_LAWS])
STAGES: Sequence[Mapping[str, Any]] = FILE["stage"]
BASES = {stage["stage"]: stage["base"] for stage in STAGES}

WARM_COILS = ("drive.resistance_per_K", "drive.shutdown_degC")
PROTOTYPE = HARDWARE["prototype"] | {name: MACHINE["prototype"][name].value for name in WARM_COILS}

WITHOUT_ERROR = ("sensors.current.noise_A", "watchdog.on")
"""Fields of the set that move nothing: no law is handed the currents, and the watchdog does not trip."""


def fields_of(stage: Mapping[str, Any]) -> list[str]:
    """Return the fields of a stage with the prototype's value."""
    named = [*HARDWARE[stage["set"]]] if "set" in stage else []
    return named + [field for pattern in stage["parts"] for field in PROTOTYPE if fnmatch(field, pattern)]


def overrides(stage: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of the scenario of a stage."""
    values, other = {field: PROTOTYPE[field] for field in fields_of(stage)}, stage.get("other", {})
    if "set" in stage:
        return values  # the sets have a data sheet of their own
    # All is known but the mass on the shaft.
    nominal = {"nominal.equals_truth": True, "nominal.inertia_kg_m2": tuple(actuator.load().inertia.tolist())}
    lag: dict[str, float | None] = (
        {} if "drive.supply_V" in {*values, *other} else {"drive.time_constant_s": 0.0}
    )
    if "plain_lag" in stage:
        lag = {"drive.time_constant_s": None}
    return {**nominal, **lag, **values, **other}


def cases() -> list[Case]:
    """Cases of every stage under every law."""
    return [case._replace(fields={**case.fields, **overrides(case.columns)}) for case in FILE.cases]


class Budget:
    """Largest errors of the laws that were run, by stage and law."""

    def __init__(self, outcomes: Outcomes) -> None:
        self._runs = {(item["law"], item["stage"]): item.runs for item in FILE.runs(outcomes)}
        self.laws = [law for law in HINGE_LAWS if any(law == of for of, _ in self._runs)]

    def runs(self, law: str, stage: str) -> Sequence[RunOutcome]:
        """Runs of a stage under a law; empty if there are none."""
        return self._runs.get((law, stage), ())

    def medians_deg(self, law: str, stage: str) -> Array:
        """Median of the largest errors, (3,) in degrees; NaN without a run."""
        runs = self.runs(law, stage)
        if not runs:
            return np.full(3, np.nan)
        return np.degrees(np.median([run.max_abs_error for run in runs], axis=0))

    def largest_change(self, law: str) -> str:
        """Name the part with the largest change of the error of any hinge; empty if not all were run."""
        parts = [stage["stage"] for stage in STAGES if stage["parts"] and "set" not in stage]
        changes = np.array(
            [self.medians_deg(law, part) - self.medians_deg(law, BASES[part]) for part in parts]
        )
        if not np.all(np.isfinite(changes)):
            return ""
        part, axis = np.unravel_index(np.argmax(np.abs(changes)), changes.shape)
        return f"{law_name(law)}, {parts[part]} ({ANGLES[axis]} {changes[part, axis]:+.3f}°)"

    def largest_changes(self) -> str:
        """Name the part with the largest change under each law."""
        return "; ".join(filter(None, map(self.largest_change, self.laws)))


def law_name(law: str) -> str:
    """Label of a law, with the preset of its gains if it has presets."""
    preset = getattr(HINGE_LAWS[law](law=law), "preset", None)
    return f"{BY_LAW[law].label}, preset {preset}" if preset else BY_LAW[law].label


def sections(outcomes: Outcomes) -> list[ExperimentSection]:
    """Section with a table for each hinge, and one figure."""
    budget = Budget(outcomes)
    title = "Largest true |error| of {} in degrees: median over the seeds, and range"
    tables = []
    for axis, angle in enumerate(ANGLES):
        cells: dict[str, Callable[[str], str]] = {"part of the prototype": str}
        cells |= {law_name(law): _cell(budget, law, axis) for law in budget.laws}
        tables.append(table(title.format(angle), BASES, cells))
    most = budget.largest_changes()
    more = f" The single part with the largest change of the error: {most}." if most else ""
    return [FILE.section("stages", tables, [lambda: _drawing(budget)], more)]


def findings(outcomes: Outcomes) -> list[Statement]:
    """Finding on the part of the prototype with the largest change of the error, under each law."""
    most = Budget(outcomes).largest_changes()
    return [Statement(None, f"single part with the largest change of the error: {most}")] if most else []


def _cell(budget: Budget, law: str, axis: int) -> Callable[[str], str]:
    def cell(stage: str) -> str:
        runs = budget.runs(law, stage)
        return f"{Numbers(of_axis(runs, 'max_abs_error', axis)):.3f deg}" if runs else "not run"

    return cell


def _drawing(budget: Budget) -> Drawing:
    from spheretwin.viz.figures import maps as figures

    laws, names = budget.laws, list(BASES)
    values = np.array([[budget.medians_deg(law, stage) for law in laws] for stage in names])
    bases = [names.index(base) for base in BASES.values()]
    changes = values - values[bases]  # (stages, laws, 3)
    panels = {
        f"|error| of {name}, degrees": figures.HeatPanel(values[:, :, axis], changes[:, :, axis])
        for axis, name in enumerate(ANGLES)
    }
    title, change = "Single parts of the prototype", "change against its base, degrees"
    figure = figures.heat(panels, names, list(map(law_name, laws)), title, change)
    return FILE.drawing("stages", figure)


EXPERIMENT = FILE.experiment(cases=cases, sections=sections, findings=findings)
