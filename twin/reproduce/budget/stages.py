"""The prototype part by part: fields whose values are all those of the named set.

*Ideal* is the tilt without any of them, and without the lag L/R of plain coils, which the prototype does not
have either: its amplifiers drive the current, and lag by their own bandwidth, or by what voltage is left.
The plain lag, which ideal hardware has elsewhere, is a row of its own.

The controller knows the electronics and the bearings of each stage, but not the mass on the shaft: a stage is
what a part costs a controller that is built for it.

No sensor measures a rate. The rows of single sensor errors have the estimator too, as there would be no rates
else; *estimator* is what it costs by itself, and what these rows are to be compared with.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

from spheretwin.models import actuator
from spheretwin.twin.scenario.hardware import HARDWARE

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
