"""Hardware sets: named values of the fields of a scenario."""

from __future__ import annotations

from typing import Any

from spheretwin.electronics.drive_section import ResolvedDrive, drive_sheet
from spheretwin.electronics.prototype import PROTOTYPE_DRIVE, PROTOTYPE_SENSORS
from spheretwin.electronics.sensor_chain import SensorsSection, sensor_sheet

NOMINAL = "nominal"

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
