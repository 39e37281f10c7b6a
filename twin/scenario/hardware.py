"""Named sets of fields: sensors, drive, bearings and supervision of a machine, and the sheet of these."""

from __future__ import annotations

from typing import Any

from spheretwin.twin.electronics.data_sheet import drive_sheet, sensor_sheet
from spheretwin.twin.electronics.driving.sections import ResolvedDrive
from spheretwin.twin.electronics.hardware import PROTOTYPE_DRIVE, PROTOTYPE_SENSORS
from spheretwin.twin.electronics.sensing.sections import SensorsSection

NOMINAL = "nominal"

# Joint bearings: assumed, as no sheet is at hand (2 mN·m is the lighter of two guesses, 5 the heavier).
PROTOTYPE_BEARINGS: dict[str, Any] = {
    "plant.coulomb_Nm": (2e-3, 2e-3, 2e-3),
    "plant.viscous_Nm_s": (1e-4, 1e-4, 1e-4),
}

# The prototype's software is not described: rates are estimated by the filter of least noise for its lag.
PROTOTYPE_ESTIMATOR: dict[str, Any] = {"estimator.kind": "kalman"}

# Assumed: a laboratory does not run such a machine without one.
PROTOTYPE_WATCHDOG: dict[str, Any] = {"watchdog.on": True}


def _section(fields: dict[str, Any]) -> dict[str, Any]:
    """Fields of one section by name, those of the sections in it as well, from fields by dotted name."""
    section: dict[str, Any] = {}
    for dotted, value in fields.items():
        _, *above, name = dotted.split(".")
        inside = section
        for part in above:
            inside = inside.setdefault(part, {})
        inside[name] = value
    return section


# The controller is built by the sheets of its own machine.
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
"""Fields by dotted name that a set gives a value to; each of them can be set alone as well."""


def left_open(fields: dict[str, Any], name: Any) -> dict[str, Any]:
    """Return the fields of a set that given fields by section do not state."""
    nominal = fields.get(NOMINAL)
    knows_truth = isinstance(nominal, dict) and nominal.get("equals_truth") is True
    return {
        dotted: value
        for dotted, value in fields_of_set(name, knows_truth).items()
        if not _said(fields, dotted)
    }


def fields_of_set(name: str, knows_truth: bool) -> dict[str, Any]:
    """Return the fields of a set; a nominal model that equals the truth takes none of its own from it."""
    return {
        dotted: value
        for dotted, value in HARDWARE.get(name, {}).items()
        if not (knows_truth and dotted.startswith(f"{NOMINAL}."))
    }


def _said(fields: Any, dotted: str) -> bool:
    for part in dotted.split("."):
        if not isinstance(fields, dict) or part not in fields:
            return False
        fields = fields[part]
    return True
