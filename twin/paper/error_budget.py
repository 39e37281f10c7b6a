"""Error budget of the tilt: cost of each part of the prototype, for every law."""

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
from spheretwin.paper.laws import BY_LAW
from spheretwin.paper.page import of_axis, spread_deg
from spheretwin.scenario.hardware import HARDWARE, MACHINE
from spheretwin.viz.pages.markdown import Drawing

Array = NDArray[np.float64]

WARM_COILS = ("drive.resistance_per_K", "drive.shutdown_degC")
PROTOTYPE = HARDWARE["prototype"] | {name: MACHINE["prototype"][name].value for name in WARM_COILS}

# What an angle is in volts: no error by itself.
VOLTS = ("sensors.potentiometer.electrical_angle_rad", "sensors.potentiometer.supply_V")

COILS = (*WARM_COILS, "drive.ambient_degC")
ESTIMATOR = ("estimator.kind",)
BEARINGS = ("plant.coulomb_Nm", "plant.viscous_Nm_s")

WITHOUT_ERROR = ("sensors.current.noise_A", "watchdog.on")
"""Fields of the set that move nothing: no law is handed the currents, and the watchdog does not trip."""

IDEAL, WITH_RATES, ELECTRONICS, ALL = "ideal", "estimator", "electronics", "prototype"

NO_LAG: dict[str, Any] = {"drive.time_constant_s": 0.0}
AMPLE_V = 1e4  # drives 8 A through 0.9 mH in less than a microsecond
WIDE_rad_s = 1e7  # a ten-thousandth of a control period


def _all_of(section: str) -> tuple[str, ...]:
    """Return the fields of a section of the plant in the set."""
    return tuple(dotted for dotted in PROTOTYPE if dotted.startswith(f"{section}."))


class Stage(NamedTuple):
    """Set of parts of the prototype."""

    name: str
    fields: tuple[str, ...] = ()
    """Fields with the prototype's value."""
    other_fields: Mapping[str, Any] = {}
    """Fields with another value that the stage needs; none of them is an error."""
    is_random: bool = False
    """Whether anything in it depends on the seed."""

    @property
    def base(self) -> str:
        """Name of the stage that it is compared with."""
        single = self.name not in (WITH_RATES, ELECTRONICS, ALL)
        return WITH_RATES if single and set(ESTIMATOR) <= set(self.fields) else IDEAL

    @property
    def overrides(self) -> dict[str, Any]:
        """Fields of the scenario."""
        values = {dotted: PROTOTYPE[dotted] for dotted in self.fields}
        if self.name in (ELECTRONICS, ALL):
            return values  # the sets have a data sheet of their own
        return {
            **_nominal(),
            **({} if "drive.supply_V" in {*values, *self.other_fields} else NO_LAG),
            **values,
            **self.other_fields,
        }


@cache
def _nominal() -> dict[str, Any]:
    """Nominal model of a single stage: all is known but the mass on the shaft."""
    inertia = tuple(actuator.load().inertia.tolist())
    return {"nominal.equals_truth": True, "nominal.inertia_kg_m2": inertia}


STAGES = (
    Stage(IDEAL),
    Stage("coil lag L/R, plain", other_fields={"drive.time_constant_s": None}),
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
        is_random=True,
    ),
    Stage(
        "sensor nonlinearity",
        (*VOLTS, *ESTIMATOR, "sensors.potentiometer.nonlinearity_rad"),
        is_random=True,
    ),
    Stage(
        "sensor offset and gain",
        (*VOLTS, *ESTIMATOR, "sensors.adc.offset_V", "sensors.adc.gain_error"),
        is_random=True,
    ),
    Stage(
        "drive offset and gain",
        (
            "drive.dac_bits", "drive.dac_range_V", "drive.transconductance_A_V", "drive.dac_offset_V",
            "drive.dac_gain_error", "drive.dac_inl_lsb", "drive.amplifier_offset_V", *COILS,
        ),
        other_fields={"drive.supply_V": AMPLE_V, "drive.bandwidth_rad_s": WIDE_rad_s},
        is_random=True,
    ),
    Stage(
        "sensor hysteresis",
        (
            *VOLTS, *ESTIMATOR, "sensors.potentiometer.hysteresis_rad",
            "sensors.potentiometer.repeatability_rad", "sensors.encoder.eccentricity_rad",
        ),
        is_random=True,
    ),
    Stage("friction", BEARINGS),
    Stage("static friction", (*BEARINGS, *_all_of("plant.stiction"))),
    Stage("cable", _all_of("plant.cable"), is_random=True),
    Stage("scatter of poles and coils", (*_all_of("plant.poles"), *_all_of("plant.coils")), is_random=True),
    Stage("mass properties", _all_of("plant.mass"), is_random=True),
    Stage(
        "magnets at 60 °C",
        ("plant.thermal.on", "drive.supply_V", *COILS),
        other_fields={"plant.thermal.rotor_degC": 60.0, "drive.bandwidth_rad_s": WIDE_rad_s},
    ),
    Stage(
        "coil coupling",
        ("drive.coil_coupling", "drive.supply_V", "drive.drop_up_V", "drive.drop_down_V", *COILS),
        other_fields={"drive.bandwidth_rad_s": WIDE_rad_s},
    ),
    Stage(
        "voltage limit",
        ("drive.supply_V", "drive.drop_up_V", "drive.drop_down_V", *COILS),
        other_fields={"drive.bandwidth_rad_s": WIDE_rad_s},
    ),
    Stage(
        "amplifier bandwidth",
        ("drive.bandwidth_rad_s", *COILS),
        other_fields={"drive.supply_V": AMPLE_V},
    ),
    Stage(ELECTRONICS, (*HARDWARE["electronics"], *WARM_COILS), is_random=True),
    Stage(ALL, tuple(PROTOTYPE), is_random=True),
)  # fmt: skip


METHOD = (
    "The tables show the largest *true* error. *Ideal* is the motion and the mass alone: true angles"
    " and rates, no delay, no friction, and currents that are their commands at once. The plain lag L/R of"
    " the coils, which runs without amplifiers have, is no part of the prototype, whose amplifiers drive the"
    " current: it is a row of its own. Coil coupling and hot magnets need amplifiers with a supply; the"
    " prototype starts with magnets at the ambient temperature. The voltage limit has amplifiers of no lag"
    " of their own on ±24 V less their drops; the bandwidth has 2 kHz on ample voltage. No sensor measures a"
    " rate: the rows of single"
    " sensor errors have the estimator too, and are to be compared with its row. All laws have their default"
    " gains.\n\n"
    "Parts do not add up. A rate that lags pushes harder at a corner, and noise feeds AFSM's adaptation (ξ̂"
    " grows with |s|): both take from its error. γ's takes two parts, offsets that push it and a sensor that"
    " sees nothing within a count."
)


def cases() -> list[Case]:
    """Cases of every stage under every law."""
    return [case(law, stage) for law in LAWS for stage in STAGES]


def case(law: str, stage: Stage) -> Case:
    """Case of a stage under a law."""
    return Case(
        name=f"{law}: {stage.name}",
        scenario="tilt",
        fields={"controller.law": law, **stage.overrides},
        details={"stage": stage.name, "compared_with": stage.base},
        is_random=stage.is_random,
    )


def sections(outcomes: Outcomes) -> list[Section]:
    """Section with a table for each hinge, and one figure."""
    laws = [law for law in LAWS if any(outcomes.runs(case(law, stage)) for stage in STAGES)]
    tables = [_table(outcomes, laws, axis) for axis in range(len(ANGLES))]
    most = "; ".join(filter(None, (_most(outcomes, law) for law in laws)))
    text = f"{METHOD} The single part with the largest change of the error: {most}." if most else METHOD
    return [Section("Single parts of the prototype", text, tables, [lambda: _drawing(outcomes, laws)])]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Finding on the part of the prototype with the largest change of the error, under each law."""
    most = [text for law in LAWS if (text := _most(outcomes, law))]
    return (
        [Finding(None, f"single part with the largest change of the error: {'; '.join(most)}")]
        if most
        else []
    )


def law_name(law: str) -> str:
    """Label of a law, with the preset of its gains if it has presets."""
    preset = getattr(LAWS[law](law=law), "preset", None)
    return f"{BY_LAW[law].label}, preset {preset}" if preset else BY_LAW[law].label


def _most(outcomes: Outcomes, law: str) -> str:
    """Name the part with the largest change of the error of any hinge; empty if not all were run."""
    medians = {stage.name: _medians_deg(outcomes.runs(case(law, stage))) for stage in STAGES}
    parts = [stage for stage in STAGES if stage.fields and stage.name not in (ELECTRONICS, ALL)]
    changes = np.array([medians[stage.name] - medians[stage.base] for stage in parts])
    if not np.all(np.isfinite(changes)):
        return ""
    part, axis = np.unravel_index(np.argmax(np.abs(changes)), changes.shape)
    return f"{law_name(law)}, {parts[part].name} ({ANGLES[axis]} {changes[part, axis]:+.3f}°)"


def _table(outcomes: Outcomes, laws: Sequence[str], axis: int) -> ResultTable:
    rows = [(stage.name, *(_cell(outcomes.runs(case(law, stage)), axis) for law in laws)) for stage in STAGES]
    title = f"Largest true |error| of {ANGLES[axis]} in degrees: median over the seeds, and range"
    return ResultTable(title, ("part of the prototype", *map(law_name, laws)), rows)


def _cell(runs: Sequence[Outcome], axis: int) -> str:
    return spread_deg(of_axis(runs, "max_abs_error", axis)) if runs else "not run"


def _drawing(outcomes: Outcomes, laws: Sequence[str]) -> Drawing:
    from spheretwin.viz.figures import maps as figures

    by_stage = {
        stage.name: np.array([_medians_deg(outcomes.runs(case(law, stage))) for law in laws])
        for stage in STAGES
    }
    values = np.array([by_stage[stage.name] for stage in STAGES])  # (stages, laws, 3)
    changes = values - np.array([by_stage[stage.base] for stage in STAGES])
    panels = {
        f"|error| of {name}, degrees": figures.HeatPanel(values[:, :, axis], changes[:, :, axis])
        for axis, name in enumerate(ANGLES)
    }
    names = [stage.name for stage in STAGES]
    title, change = "Single parts of the prototype", "change against its base, degrees"
    caption = (
        "Largest true |error|, median over the seeds. Colours: what the part changes, against ideal, or for"
        " single errors of the sensors against the estimator alone."
    )
    return Drawing(
        "budget.svg", caption, figures.heat(panels, names, list(map(law_name, laws)), title, change)
    )


def _medians_deg(runs: Sequence[Outcome]) -> Array:
    """Median of the largest errors, (3,) in degrees; NaN without a run."""
    if not runs:
        return np.full(3, np.nan)
    return np.degrees(np.median([run.max_abs_error for run in runs], axis=0))


EXPERIMENT = Experiment(
    name="budget",
    title="The error budget of the tilt",
    summary="The motion of figure 11 under every law, with each part of the prototype switched on alone,"
    " with all of its electronics, and with all of it.",
    cases=cases,
    sections=sections,
    findings=findings,
)
