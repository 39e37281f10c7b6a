"""Failures of what all groups share: sensors, supply and controller, every mode once, by a stated value."""

from __future__ import annotations

from math import tau
from typing import NamedTuple

from spheretwin.twin.electronics.hardware import PROTOTYPE_DRIVE, PROTOTYPE_SENSORS
from spheretwin.twin.faults.targets.registry import TARGETS

COUNT_rad = tau / PROTOTYPE_SENSORS["sensors.encoder.counts"]
SUPPLY_V = PROTOTYPE_DRIVE["drive.supply_V"]

# What wants a value has one that a laboratory may meet, large beside what the healthy part does.
VALUES: dict[tuple[str, str], tuple[float, str]] = {
    ("pot", "offset"): (0.02, " rad"),  # a slip of a degree on the shaft, some 60 times the nonlinearity
    ("pot", "gain"): (0.9, ""),  # a tenth of the supply of the track is gone
    ("pot", "noise"): (0.01, " rad"),  # a worn track, some 30 times the healthy noise
    ("encoder", "offset"): (10 * COUNT_rad, " rad"),  # ten lost counts
    ("encoder", "gain"): (0.5, ""),  # every second line is missed
    ("encoder", "noise"): (COUNT_rad, " rad"),  # a count
    ("adc", "offset"): (0.1, " V"),  # a drift of its reference, 100 times the healthy offset; 0.1 rad
    ("adc", "gain"): (0.9, ""),  # a tenth of its reference
    ("adc", "noise"): (0.01, " V"),  # an open shield, some 130 times the healthy noise; 0.01 rad
    ("adc", "delay"): (5e-3, " s"),  # five control periods
    ("supply", "offset"): (-SUPPLY_V / 2, " V"),
    ("supply", "gain"): (0.5, ""),  # half of the cells
    ("supply", "noise"): (SUPPLY_V / 10, " V"),  # a dry capacitor
    ("controller", "delay"): (5e-3, " s"),  # five control periods
}
"""With their units."""


class Failure(NamedTuple):
    """One mode of one part."""

    part: str
    mode: str
    value: float | None
    """None where the mode has none, or has one by itself."""
    unit: str

    @property
    def name(self) -> str:
        """Part, mode and value."""
        return f"{self.part} {self.mode}" + ("" if self.value is None else f" {self.value:.3g}{self.unit}")


def failures() -> list[Failure]:
    """Every mode of every part that is not of a group, but modes that need a value and have none in `VALUES`."""
    return [
        Failure(part, mode, *VALUES.get((target.name, mode), (None, "")))
        for target in TARGETS.values()
        if not target.each_group
        for part in target.names(0)
        for mode, what in target.modes.items()
        if (target.name, mode) in VALUES or what.value is None or what.value.default is not None
    ]
