"""Named sets of fields: what stands between the law and the coils, and between the joints and the law."""

from __future__ import annotations

from typing import Any

from spheretwin.twin.electronics.hardware import PROTOTYPE_DRIVE, PROTOTYPE_SENSORS

# Joint bearings: assumed, as no sheet is at hand (2 mN·m is the lighter of two guesses, 5 the heavier).
PROTOTYPE_BEARINGS: dict[str, Any] = {
    "plant.coulomb_Nm": (2e-3, 2e-3, 2e-3),
    "plant.viscous_Nm_s": (1e-4, 1e-4, 1e-4),
}

# The prototype's software is not described: rates are estimated by the filter of least noise for its lag.
PROTOTYPE_ESTIMATOR: dict[str, Any] = {"estimator.kind": "kalman"}

# Assumed: a laboratory does not run such a machine without one.
PROTOTYPE_WATCHDOG: dict[str, Any] = {"watchdog.on": True}

HARDWARE: dict[str, dict[str, Any]] = {
    "ideal": {},
    "prototype": {
        **PROTOTYPE_SENSORS,
        **PROTOTYPE_DRIVE,
        **PROTOTYPE_BEARINGS,
        **PROTOTYPE_ESTIMATOR,
        **PROTOTYPE_WATCHDOG,
    },
}
"""Fields by dotted name that a set gives a value to; each of them can be set alone as well."""


def left_open(fields: dict[str, Any], name: Any) -> dict[str, Any]:
    """Fields of a set that given fields by section say nothing of."""
    return {dotted: value for dotted, value in HARDWARE.get(name, {}).items() if not _said(fields, dotted)}


def _said(fields: Any, dotted: str) -> bool:
    for part in dotted.split("."):
        if not isinstance(fields, dict) or part not in fields:
            return False
        fields = fields[part]
    return True
