"""The error budget of the tilt: what each part of the prototype costs, for every law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.laws import LAWS
from spheretwin.models import actuator
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.paper.experiment import Case, Experiment, Finding, Outcome, Outcomes, ResultTable, Section
from spheretwin.paper.rows import of_axis, spread_deg
from spheretwin.scenario.sections import HARDWARE
from spheretwin.viz.pages.markdown import Drawing

PROTOTYPE = HARDWARE["prototype"]

# What an angle is in volts: no error by itself.
VOLTS = ("sensors.potentiometer.electrical_angle_rad", "sensors.potentiometer.supply_V")

COILS = (
    "drive.resistance_ohm",
    "drive.inductance_H",
    "drive.current_limit_A",
    "drive.resistance_per_K",
    "drive.heat_capacity_J_K",
    "drive.thermal_resistance_K_W",
    "drive.ambient_degC",
    "drive.shutdown_degC",
)
ESTIMATOR = ("estimator.kind",)

WITHOUT_ERROR = ("sensors.current.noise_A", "watchdog.on")
"""Fields of the set that move nothing: no law is handed the currents, and the watchdog does not trip."""

IDEAL, WITH_RATES, ALL = "ideal", "estimator", "all"

NO_LAG: dict[str, Any] = {"drive.time_constant_s": 0.0}
AMPLE_V = 1e4  # drives 8 A through 0.9 mH in less than a microsecond
WIDE_rad_s = 1e7  # a ten-thousandth of a control period


class Stage(NamedTuple):
    """Some of the prototype's parts."""

    name: str
    fields: tuple[str, ...] = ()
    """That have the prototype's value."""
    beside: Mapping[str, Any] = {}
    """Fields that this stage needs with another value: none of them is an error."""
    draws: bool = False
    """Whether anything in it is drawn from the seed."""

    @property
    def base(self) -> str:
        """Name of the stage that it is compared with."""
        single = self.name not in (WITH_RATES, ALL)
        return WITH_RATES if single and set(ESTIMATOR) <= set(self.fields) else IDEAL

    @property
    def overrides(self) -> dict[str, Any]:
        """Fields of the scenario."""
        values = {dotted: PROTOTYPE[dotted] for dotted in self.fields}
        if self.name == ALL:
            return values  # the set has a data sheet of its own
        return {
            **_known(),
            **({} if "drive.supply_V" in {*values, *self.beside} else NO_LAG),
            **values,
            **self.beside,
        }


@cache
def _known() -> dict[str, Any]:
    """Nominal model of a single stage: all is known but the mass on the shaft."""
    inertia = tuple(actuator.load().inertia.tolist())
    return {"nominal.equals_truth": True, "nominal.inertia_kg_m2": inertia}


STAGES = (
    Stage(IDEAL),
    Stage("coil lag L/R, plain", beside={"drive.time_constant_s": None}),
    Stage("delay", ("drive.delay_s",)),
    Stage(WITH_RATES, ESTIMATOR),
    Stage(
        "quantisation",
        (
            *VOLTS, *ESTIMATOR, "sensors.adc.bits", "sensors.adc.range_V", "sensors.encoder.counts",
            "drive.dac_bits", "drive.dac_range_V", "drive.transconductance_A_V",
        ),
    ),
    Stage(
        "sensor noise",
        (
            *VOLTS, *ESTIMATOR, "sensors.potentiometer.noise_rad", "sensors.adc.noise_V",
            "sensors.adc.oversampling",
        ),
        draws=True,
    ),
    Stage(
        "sensor nonlinearity",
        (*VOLTS, *ESTIMATOR, "sensors.potentiometer.nonlinearity_rad"),
        draws=True,
    ),
    Stage(
        "sensor offset and gain",
        (*VOLTS, *ESTIMATOR, "sensors.adc.offset_V", "sensors.adc.gain_error"),
        draws=True,
    ),
    Stage(
        "drive offset and gain",
        (
            "drive.dac_bits", "drive.dac_range_V", "drive.transconductance_A_V", "drive.dac_offset_V",
            "drive.dac_gain_error", "drive.dac_inl_lsb", "drive.amplifier_offset_V", *COILS,
        ),
        beside={"drive.supply_V": AMPLE_V, "drive.bandwidth_rad_s": WIDE_rad_s},
        draws=True,
    ),
    Stage("friction", ("plant.coulomb_Nm", "plant.viscous_Nm_s")),
    Stage(
        "voltage limit",
        ("drive.supply_V", "drive.drop_up_V", "drive.drop_down_V", *COILS),
        beside={"drive.bandwidth_rad_s": WIDE_rad_s},
    ),
    Stage(
        "amplifier bandwidth",
        ("drive.bandwidth_rad_s", *COILS),
        beside={"drive.supply_V": AMPLE_V},
    ),
    Stage(ALL, tuple(PROTOTYPE), draws=True),
)  # fmt: skip


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


def _table(outcomes: Outcomes, laws: Sequence[str], axis: int) -> ResultTable:
    rows = [(stage.name, *(_cell(_found(outcomes, law, stage), axis) for law in laws)) for stage in STAGES]
    title = f"Largest true |error| of {ANGLES[axis]} in degrees: median over the seeds, and range"
    return ResultTable(title, ("switched on", *laws), rows)


def _cell(found: Sequence[Outcome], axis: int) -> str:
    return spread_deg(of_axis(found, "max_abs_error", axis)) if found else "not run"


def _found(outcomes: Outcomes, law: str, stage: Stage) -> Sequence[Outcome]:
    return outcomes.get(case(law, stage).name, ())


def _drawing(outcomes: Outcomes, laws: Sequence[str]) -> Drawing:
    from spheretwin.viz.figures import maps as figures

    by_stage = {
        stage.name: np.array([_medians_deg(_found(outcomes, law, stage)) for law in laws]) for stage in STAGES
    }
    values = np.array([by_stage[stage.name] for stage in STAGES])  # (stages, laws, 3)
    changes = values - np.array([by_stage[stage.base] for stage in STAGES])
    panels = {
        f"|error| of {name}, degrees": figures.HeatPanel(values[:, :, axis], changes[:, :, axis])
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
