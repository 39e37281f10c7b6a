"""Hardware sets: named values of the fields of a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from math import inf, radians
from typing import Any, NamedTuple

from spheretwin.electronics.drive_section import DriveSection, amplifier_sheet
from spheretwin.electronics.sensor_chain import SensorsSection, sensor_sheet
from spheretwin.models.actuator import Actuator

NOMINAL = "nominal"


class Origin(NamedTuple):
    """Value of a field of a hardware set, with its origin."""

    value: Any
    origin: str


# README.md in the folder `electronics` describes the parts.
_SENSORS = {
    "sensors.potentiometer.electrical_angle_rad": Origin(radians(300), "assumed: no sheet of the part"),
    "sensors.potentiometer.supply_V": Origin(5.0, "assumed: the input range of the ADC"),
    "sensors.potentiometer.nonlinearity_rad": Origin(radians(0.02), "assumed: residual of a calibration"),
    "sensors.potentiometer.noise_rad": Origin(radians(0.02), "assumed"),
    "sensors.adc.bits": Origin(16, "data sheet of the ADS8364"),
    "sensors.adc.range_V": Origin(2.5, "data sheet of the ADS8364"),
    "sensors.adc.offset_V": Origin(1e-3, "assumed"),
    "sensors.adc.gain_error": Origin(1e-3, "assumed"),
    "sensors.adc.noise_V": Origin(5 / 2**16, "assumed: 1 LSB"),
    "sensors.adc.oversampling": Origin(1, "assumed"),
    "sensors.encoder.counts": Origin(2000, "assumed: OME-500-2MCA with 500 pulses per turn, times 4"),
    "sensors.current.noise_A": Origin(0.02, "assumed: a Hall sensor"),
}
_DRIVE = {
    "drive.delay_s": Origin(1e-3, "assumed: one control period"),
    "drive.dac_bits": Origin(16, "data sheet of the AD5370"),
    "drive.dac_range_V": Origin(10.0, "data sheet of the AD5370: span 20 V at 5 V; centre 0 assumed"),
    "drive.dac_offset_V": Origin(2e-3, "assumed"),
    "drive.dac_gain_error": Origin(1e-3, "assumed"),
    "drive.dac_inl_lsb": Origin(4.0, "assumed"),
    "drive.supply_V": Origin(24.0, "assumed; data sheet of the OPA549: 4 to 30 V"),
    "drive.drop_up_V": Origin(4.8, "data sheet of the OPA549, worst case at 8 A"),
    "drive.drop_down_V": Origin(4.6, "data sheet of the OPA549, worst case at 8 A"),
    "drive.bandwidth_rad_s": Origin(12566.370614359172, "assumed: 2 kHz"),
    "drive.transconductance_A_V": Origin(0.8, "assumed"),
    "drive.amplifier_offset_V": Origin(1e-3, "data sheet of the OPA549, typical; 5 mV at most"),
    "drive.ambient_degC": Origin(20.0, "assumed"),
}
_BEARINGS = {
    "plant.coulomb_Nm": Origin((2e-3, 2e-3, 2e-3), "assumed: the lower of two estimates, 2 and 5 mN·m"),
    "plant.viscous_Nm_s": Origin((1e-4, 1e-4, 1e-4), "assumed"),
}
# Tolerances of the mechanical and magnetic parts, and effects that a perfect machine lacks.
_IMPERFECTIONS = {
    "sensors.potentiometer.hysteresis_rad": Origin(radians(0.02), "assumed: play of the wiper"),
    "sensors.potentiometer.repeatability_rad": Origin(
        radians(0.004), "assumed: data sheet of a precision part, the Novotechnik P2200"
    ),
    "sensors.encoder.eccentricity_rad": Origin(1e-3, "assumed: 0.01 mm on a disc of 10 mm radius"),
    "drive.coil_coupling": Origin(1.0, "computed from the geometry of the coils"),
    "plant.poles.gain_error": Origin(0.03, "assumed: tolerance of the remanence within a grade"),
    "plant.poles.angle_error_rad": Origin(3e-3, "assumed: 0.15 mm at 50 mm"),
    "plant.poles.distance_error_m": Origin(1e-4, "assumed: glued and ground"),
    "plant.coils.gain_error": Origin(0.01, "assumed: three of 320 turns"),
    "plant.coils.angle_error_rad": Origin(5e-3, "assumed: 0.3 mm at 60 mm"),
    "plant.coils.distance_error_m": Origin(2e-4, "assumed"),
    "plant.mass.centre_error_m": Origin(2e-4, "assumed: balanced by hand"),
    "plant.mass.product_error_kg_m2": Origin(2e-5, "assumed: 1 % of the moments of inertia"),
    "plant.mass.ring_inertia_kg_m2": Origin(
        ((1e-4, 2e-4, 1e-4), (1e-4, 1e-4, 1e-4)), "assumed: rings of aluminium, 6 % of the rotor's moments"
    ),
    "plant.mass.axis_tilt_error_rad": Origin(2e-3, "assumed: 0.1 mm over 50 mm"),
    "plant.mass.axis_offset_error_m": Origin(1e-4, "assumed"),
    "plant.stiction.on": Origin(True, "property of bearings: static friction"),
    "plant.stiction.break_away": Origin(1.5, "assumed"),
    "plant.stiction.presliding_rad": Origin(2e-3, "assumed: 10 µm at a radius of 5 mm"),
    "plant.stiction.damping_ratio": Origin(0.3, "assumed"),
    "plant.stiction.stribeck_rad_s": Origin(0.05, "assumed"),
    "plant.cable.stiffness_Nm_rad": Origin((2e-3, 2e-3, 1e-3), "assumed: a thin flexible cable"),
    "plant.cable.torque_error_Nm": Origin((1e-3, 1e-3, 5e-4), "assumed"),
    "plant.cable.hysteresis_Nm": Origin((3e-4, 3e-4, 1e-4), "assumed"),
    "plant.cable.hysteresis_rad": Origin(0.05, "assumed"),
    "plant.thermal.on": Origin(True, "property of NdFeB magnets"),
}
_SOFTWARE = {
    "estimator.kind": Origin("kalman", "assumed: the estimator with the least noise for its lag"),
    "watchdog.on": Origin(True, "assumed: a laboratory does not run such a machine without one"),
}


def _values(fields: Mapping[str, Origin]) -> dict[str, Any]:
    return {name: field.value for name, field in fields.items()}


PROTOTYPE_SENSORS, PROTOTYPE_DRIVE, PROTOTYPE_BEARINGS = map(_values, (_SENSORS, _DRIVE, _BEARINGS))


def _section(fields: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of one section and of its sections, from fields by dotted name."""
    section: dict[str, Any] = {}
    for dotted, value in fields.items():
        _, *above, name = dotted.split(".")
        inside = section
        for part in above:
            inside = inside.setdefault(part, {})
        inside[name] = value
    return section


# The controller is designed with the data sheets of its electronics; that of the machine is its model file.
PROTOTYPE_NOMINAL: dict[str, Any] = {
    f"{NOMINAL}.{name}": value
    for name, value in {
        **_section(PROTOTYPE_BEARINGS),
        **amplifier_sheet(DriveSection.model_validate(_section(PROTOTYPE_DRIVE))),
        **sensor_sheet(SensorsSection.model_validate(_section(PROTOTYPE_SENSORS))),
    }.items()
}

_ELECTRONICS = {
    **PROTOTYPE_SENSORS,
    **PROTOTYPE_DRIVE,
    **PROTOTYPE_BEARINGS,
    **_values(_SOFTWARE),
    **PROTOTYPE_NOMINAL,
}
HINGE_SENSORS = (
    "sensors.potentiometer.",
    "sensors.adc.",
    "sensors.encoder.",
    f"{NOMINAL}.angle_noise_rad",
    f"{NOMINAL}.angle_resolution_rad",
)
"""Beginnings of the fields of a set that a Hall array replaces."""

HARDWARE: dict[str, dict[str, Any]] = {
    "ideal": {},
    "electronics": _ELECTRONICS,
    "prototype": {**_ELECTRONICS, **_values(_IMPERFECTIONS)},
}
"""Hardware sets: fields by dotted name and their values; each field can also be set separately.

A set is electronics and tolerances. Resistance, inductance, thermal data and inertia belong to the machine:
its model file states them.
"""

_CURRENT_LIMIT = "drive.current_limit_A"
_HEAT = "plant.thermal"
_MACHINE = {
    f"{_HEAT}.remanence_per_K": Origin(-0.0011, "assumed: sintered NdFeB"),
    f"{_HEAT}.knee_degC": Origin(80.0, "assumed: NdFeB N35, catalogue of Arnold Magnetic Technologies"),
    f"{_HEAT}.stator_heat_capacity_J_K": Origin(1000.0, "assumed: 1.1 kg of aluminium"),
    f"{_HEAT}.rotor_heat_capacity_J_K": Origin(900.0, "assumed: 2 kg of steel and NdFeB"),
    f"{_HEAT}.stator_to_ambient_K_W": Origin(0.8, "assumed: 0.12 m² of free air"),
    f"{_HEAT}.air_gap_K_W": Origin(2.0, "assumed: 1 to 2 mm of air on 0.03 m²"),
    f"{_HEAT}.rotor_to_ambient_K_W": Origin(5.0, "assumed: shaft and open caps"),
    "drive.resistance_per_K": Origin(0.0, "assumed: constant resistance"),
    "drive.heat_capacity_J_K": Origin(60.0, "assumed"),
    "drive.thermal_resistance_K_W": Origin(4.0, "assumed"),
}
_OF_SETS = {
    **_MACHINE,
    "drive.resistance_per_K": Origin(0.0039, "property of copper"),
    "drive.shutdown_degC": Origin(155.0, "assumed: insulation of class F"),
    _CURRENT_LIMIT: Origin(8.0, "data sheet of the OPA549, continuous"),
}
MACHINE: dict[str, dict[str, Origin]] = {"ideal": _MACHINE, "electronics": _OF_SETS, "prototype": _OF_SETS}
"""Values of each hardware set for a machine whose model file does not state them.

Where the model file states one, it holds; of two current limits the smaller one.
"""

_STATED = {
    name: field.origin
    for name, field in {**_SENSORS, **_DRIVE, **_BEARINGS, **_IMPERFECTIONS, **_SOFTWARE}.items()
}

# Nominal values are those of the machine's own data sheets.
ORIGINS: dict[str, dict[str, str]] = {
    name: {dotted: _STATED.get(dotted, "computed from the values of the set") for dotted in fields}
    for name, fields in HARDWARE.items()
}
"""Origin of each value of each hardware set."""


SCATTER_OF_A_CURVE = (
    "plant.poles.gain_error",
    "plant.poles.angle_error_rad",
    "plant.poles.distance_error_m",
    "plant.coils.distance_error_m",
)
"""Errors that only a machine with a torque curve can have: a torque field has all poles in one."""


PER_GROUP = (
    "resistance_ohm",
    "inductance_H",
    "resistance_per_K",
    "heat_capacity_J_K",
    "thermal_resistance_K_W",
    "shutdown_degC",
    "time_constant_s",
)
"""Fields of `drive` and `nominal` with one value of all groups, or one for each."""

MODEL_FILE = {
    **{f"drive.{name}": f"group_{name}" for name in (*PER_GROUP[:5], "current_limit_A")},
    **{f"nominal.{name}": f"group_{name}" for name in (*PER_GROUP[:2], "current_limit_A")},
    "drive.shutdown_degC": "group_temperature_limit_degC",
    "nominal.inertia_kg_m2": "inertia of the body rotor",
    f"{_HEAT}.remanence_per_K": "magnet_remanence_per_K",
    f"{_HEAT}.knee_degC": "magnet_temperature_limit_degC",
    **{
        f"{_HEAT}.{name}": name
        for name in (
            "stator_heat_capacity_J_K",
            "rotor_heat_capacity_J_K",
            "stator_to_ambient_K_W",
            "air_gap_K_W",
            "rotor_to_ambient_K_W",
        )
    },
}
"""Number of the model file that is the default of a field, by the name of the field."""


def stated_value(actuator: Actuator, dotted: str) -> Any:
    """Return the value of a field that the model file of the machine states; None if it does not."""
    number = MODEL_FILE[dotted]
    name = number.removeprefix("group_")
    return actuator.heat.get(number) if name == number else getattr(actuator.group, name)


@lru_cache(maxsize=64)
def machine_values(actuator: Actuator, hardware: str, section: str) -> Mapping[str, Any]:
    """Return the values of the machine in a section, by field: those of its model file, or assumed ones."""
    values = {}
    for dotted in MODEL_FILE:
        before, _, name = dotted.rpartition(".")
        if before == section:
            value, assumed = stated_value(actuator, dotted), MACHINE[hardware].get(dotted)
            values[name] = assumed.value if value is None and assumed else value
    return values


def amplifier_limit_A(hardware: str) -> float:
    """Return the current limit of the amplifiers of a hardware set; infinity if it states none."""
    limit = MACHINE[hardware].get(_CURRENT_LIMIT)
    return limit.value if limit else inf


def hardware_defaults(fields: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of the named hardware set that given fields by section do not contain."""
    name, nominal = fields.get("hardware"), fields.get(NOMINAL)
    equals_truth = isinstance(nominal, dict) and nominal.get("equals_truth") is True
    return {
        dotted: value
        for dotted, value in hardware_fields(name if isinstance(name, str) else "", equals_truth).items()
        if not (_is_given(fields, dotted) or (_has_hall_array(fields) and dotted.startswith(HINGE_SENSORS)))
    }


def _has_hall_array(fields: Any) -> bool:
    sensors = fields.get("sensors")
    hall = sensors.get("hall") if isinstance(sensors, dict) else None
    return isinstance(hall, dict) and bool(hall.get("count") or hall.get("longitude_deg"))


def hardware_fields(name: str, equals_truth: bool) -> dict[str, Any]:
    """Return the fields of a hardware set; without nominal values if the nominal model equals the truth."""
    return {
        dotted: value
        for dotted, value in HARDWARE.get(name, {}).items()
        if not (equals_truth and dotted.startswith(f"{NOMINAL}."))
    }


def _is_given(fields: Any, dotted: str) -> bool:
    for part in dotted.split("."):
        if not isinstance(fields, dict) or part not in fields:
            return False
        fields = fields[part]
    return True
