"""Hardware sets: named values of the fields of a scenario."""

from __future__ import annotations

from math import radians
from typing import Any

from spheretwin.electronics.drive_section import ResolvedDrive, drive_sheet
from spheretwin.electronics.sensor_chain import SensorsSection, sensor_sheet

NOMINAL = "nominal"

# Electronics of the prototype: README.md in the folder `electronics` states the sources.
PROTOTYPE_SENSORS: dict[str, Any] = {
    "sensors.potentiometer.electrical_angle_rad": radians(300),
    "sensors.potentiometer.supply_V": 5.0,
    "sensors.potentiometer.nonlinearity_rad": radians(0.02),
    "sensors.potentiometer.noise_rad": radians(0.02),
    "sensors.adc.bits": 16,
    "sensors.adc.range_V": 2.5,
    "sensors.adc.offset_V": 1e-3,
    "sensors.adc.gain_error": 1e-3,
    "sensors.adc.noise_V": 5 / 2**16,  # 1 LSB
    "sensors.adc.oversampling": 1,
    "sensors.encoder.counts": 2000,
    "sensors.current.noise_A": 0.02,  # assumed: a Hall sensor's
}
"""Values by dotted name."""

PROTOTYPE_DRIVE: dict[str, Any] = {
    "drive.delay_s": 1e-3,  # assumed: one control period
    "drive.dac_bits": 16,  # sheet (AD5370)
    "drive.dac_range_V": 10.0,  # sheet: span 20 V at 5 V; centred on 0, assumed
    "drive.dac_offset_V": 2e-3,  # assumed
    "drive.dac_gain_error": 1e-3,  # assumed
    "drive.dac_inl_lsb": 4.0,  # assumed
    "drive.supply_V": 24.0,  # assumed; sheet (OPA549): 4 to 30
    "drive.drop_up_V": 4.8,  # sheet, worst at 8 A
    "drive.drop_down_V": 4.6,  # sheet, worst at 8 A
    "drive.bandwidth_rad_s": 12566.370614359172,  # assumed: 2 kHz
    "drive.transconductance_A_V": 0.8,  # assumed
    "drive.amplifier_offset_V": 1e-3,  # sheet, typical; 5e-3 at most
    "drive.current_limit_A": 8.0,  # sheet, continuous
    "drive.resistance_ohm": 1.3,  # assumed
    "drive.inductance_H": 0.9e-3,  # assumed
    "drive.resistance_per_K": 0.0039,  # property of copper
    "drive.heat_capacity_J_K": 60.0,  # assumed
    "drive.thermal_resistance_K_W": 4.0,  # assumed
    "drive.ambient_degC": 20.0,  # assumed
    "drive.shutdown_degC": 155.0,  # assumed: insulation of class F
}
"""Values by dotted name."""

# Joint bearings: assumed, as no data sheet is available (2 mN·m is the lower of two estimates, 5 the higher).
PROTOTYPE_BEARINGS: dict[str, Any] = {
    "plant.coulomb_Nm": (2e-3, 2e-3, 2e-3),
    "plant.viscous_Nm_s": (1e-4, 1e-4, 1e-4),
}

# The prototype's software is not documented: the estimator is the one with the least noise for its lag.
PROTOTYPE_ESTIMATOR: dict[str, Any] = {"estimator.kind": "kalman"}

# Assumed: a laboratory does not run such a machine without a watchdog.
PROTOTYPE_WATCHDOG: dict[str, Any] = {"watchdog.on": True}


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


# The controller is designed with the data sheets of its own machine.
PROTOTYPE_NOMINAL: dict[str, Any] = {
    f"{NOMINAL}.{name}": value
    for name, value in {
        **_section(PROTOTYPE_BEARINGS),
        **drive_sheet(ResolvedDrive.model_validate(_section(PROTOTYPE_DRIVE))),
        **sensor_sheet(SensorsSection.model_validate(_section(PROTOTYPE_SENSORS))),
    }.items()
}

HARDWARE: dict[str, dict[str, Any]] = {
    "ideal": {},
    "prototype": {
        **PROTOTYPE_SENSORS,
        **PROTOTYPE_DRIVE,
        **PROTOTYPE_BEARINGS,
        **PROTOTYPE_ESTIMATOR,
        **PROTOTYPE_WATCHDOG,
        **PROTOTYPE_NOMINAL,
    },
}
"""Hardware sets: fields by dotted name and their values; each field can also be set separately."""


def hardware_defaults(fields: dict[str, Any], name: Any) -> dict[str, Any]:
    """Return the fields of a hardware set that given fields by section do not contain."""
    nominal = fields.get(NOMINAL)
    equals_truth = isinstance(nominal, dict) and nominal.get("equals_truth") is True
    return {
        dotted: value
        for dotted, value in hardware_fields(name, equals_truth).items()
        if not _is_given(fields, dotted)
    }


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
