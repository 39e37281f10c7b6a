"""Watchdog: checks each measurement and command, and removes the currents if one is implausible.

It trips once, for one of the reasons below. From then on the drive receives no current command, whatever is
pending, or it shorts the coils so that their back-EMF brakes the rotor. After a given time the run ends. The
law is not called again.

*Jump.* In a control period an angle moves at most by the largest rate times the period, plus noise and
resolution of its sensor: six standard deviations of the difference of two samples, and one step. If samples
were missing, the time since the last one counts.
"""

from __future__ import annotations

from enum import IntEnum
from math import isfinite, sqrt
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.record import Record, Rows, field, put

DEVIATIONS = 6.0


class Reason(IntEnum):
    """Reason of a trip: a number for the telemetry, a text for the summary."""

    text: str

    def __new__(cls, code: int, text: str) -> Reason:
        """Create a number with its text."""
        reason = int.__new__(cls, code)
        reason._value_ = code
        reason.text = text
        return reason

    NONE = 0, "nothing"
    STALE = 1, "no fresh measurement"
    JUMP = 2, "a measurement jumped further than the rotor can"
    MEASUREMENT = 3, "a measurement is no number"
    COMMAND = 4, "a command is no number"
    TEMPERATURE = 5, "a coil is too hot"
    SPEED = 6, "the rotor is too fast"
    EDGE = 7, "the rotor is at the edge of its workspace"
    CURRENT = 8, "a measured current is above its limit"
    MACHINE = 9, "the machine has switched off its currents"
    FROZEN = 10, "the measured angles are frozen"
    MODEL = 11, "the motion contradicts the model"


REASONS = {int(reason): reason for reason in Reason}
"""Reasons by number."""

GO, RELEASE, SHORT = 0, 1, 2
"""Commands to the drive: go on, no currents, shorted coils."""

_STALE, _JUMP, _MEASUREMENT, _SPEED, _EDGE = (
    int(Reason.STALE),
    int(Reason.JUMP),
    int(Reason.MEASUREMENT),
    int(Reason.SPEED),
    int(Reason.EDGE),
)


class WatchdogSection(BaseModel):
    """Watchdog of the controller; off by default."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    on: bool = Field(False, description="whether the watchdog is on (prototype: assumed)")
    action: Literal["release", "short"] = Field(
        "release",
        description="action: release the rotor (currents to zero), or short the coils (brake)",
    )
    rundown_s: Annotated[float, Field(ge=0, le=1e3)] = Field(
        0.05, description="time from the trip to the end of the run, s (assumed)"
    )
    stale_ticks: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        5, description="control ticks in a row without a fresh measurement of an angle (assumed)"
    )
    largest_rate_rad_s: Annotated[float, Field(ge=1e-3, le=1e6)] = Field(
        60.0, description="largest plausible rate of a hinge, rad/s (assumed; the nutation has 7)"
    )
    edge_margin_rad: Annotated[float, Field(ge=-10, le=10)] = Field(
        0.02, description="distance to keep from the end of a hinge's range, rad (assumed)"
    )


class Watchdog(Record):
    """Watchdog of a run."""

    on: bool = field("whether the watchdog is on")
    action: int = field("command to the drive after a trip")
    rundown_ticks: int = field("ticks from the trip to the end of the run")
    stale_ticks: int = field("ticks in a row without a fresh angle that trip")
    largest_rate_rad_s: float = field("largest plausible rate", "rad/s")
    step_rad: float = field("angle at the largest rate in a control period", "rad")
    noise_rad: Array = field("further difference of two samples by noise and resolution", "rad", 3)
    lowest_rad: Array = field("lowest plausible angles", "rad", 3)
    highest_rad: Array = field("highest plausible angles", "rad", 3)
    last_rad: Array = field("last fresh measurement; NaN before the first", "rad", 3, state=True)
    missing: NDArray[np.int64] = field("ticks since the last fresh measurement", "", 3, state=True)
    halt: int = field("`GO`, `RELEASE` or `SHORT`: the drive reads it", state=True)
    reason: int = field("reason of the trip", state=True)
    ticks_since_trip: int = field("ticks since the trip", state=True)


class MeasurementLimits(NamedTuple):
    """Sampling, sensor errors and hinge ranges that bound a plausible measurement."""

    period_s: float
    noise_rad: ArrayLike  # (3,) standard deviation of each measured angle
    quantum_rad: ArrayLike  # (3,)
    hinge_range_rad: Array  # (3, 2) nominal


def fill_watchdog(rows: Rows, section: WatchdogSection, limits: MeasurementLimits) -> None:
    """Fill watchdogs before the first measurement."""
    rate_rad_s, margin_rad = section.largest_rate_rad_s, section.edge_margin_rad
    low_rad, high_rad = limits.hinge_range_rad[..., 0], limits.hinge_range_rad[..., 1]
    put(rows, on=section.on, action=SHORT if section.action == "short" else RELEASE, last_rad=np.nan)
    put(rows, rundown_ticks=np.rint(section.rundown_s / limits.period_s), stale_ticks=section.stale_ticks)
    put(rows, largest_rate_rad_s=rate_rad_s, step_rad=rate_rad_s * limits.period_s)
    put(rows, noise_rad=np.multiply(DEVIATIONS * sqrt(2), limits.noise_rad) + limits.quantum_rad)
    put(rows, lowest_rad=low_rad + margin_rad, highest_rad=high_rad - margin_rad)


@allocation_free
def watch(watchdog: Watchdog, fresh: Array, angle: Array, rate: Array) -> None:
    """Check a measurement.

    Parameters
    ----------
    watchdog : Watchdog
        Changed in place.
    fresh : (3,) array
        1 if the measurement of an angle is new, 0 if it repeats the last one.
    angle, rate : (3,) arrays, rad and rad/s
        Finite angles, and the rates that the law receives.
    """
    for i in range(3):
        if fresh[i] == 0.0:
            watchdog.missing[i] += 1
            if watchdog.missing[i] >= watchdog.stale_ticks:
                trip(watchdog, _STALE)
            continue
        if not isfinite(rate[i]):
            rate[i] = 0.0  # telemetry holds numbers
            trip(watchdog, _MEASUREMENT)
        # A first measurement is compared with NaN: the comparison is False.
        moved = abs(angle[i] - watchdog.last_rad[i])
        if moved > watchdog.step_rad * (watchdog.missing[i] + 1) + watchdog.noise_rad[i]:
            trip(watchdog, _JUMP)
        if abs(rate[i]) > watchdog.largest_rate_rad_s:
            trip(watchdog, _SPEED)
        if angle[i] < watchdog.lowest_rad[i] or angle[i] > watchdog.highest_rad[i]:
            trip(watchdog, _EDGE)
        watchdog.last_rad[i], watchdog.missing[i] = angle[i], 0


@allocation_free
def replace_invalid(watchdog: Watchdog, measurement: Array) -> bool:
    """Replace values of a measurement (3, 3) that are not finite by the last angle and rate 0, and trip.

    Returns
    -------
    bool
        True if the watchdog is on.
    """
    if not watchdog.on:
        return False
    for i in range(3):
        if not (isfinite(measurement[0, i]) and isfinite(measurement[1, i])):
            measurement[0, i] = watchdog.last_rad[i] if isfinite(watchdog.last_rad[i]) else 0.0
            measurement[1, i] = 0.0
            trip(watchdog, _MEASUREMENT)
    return True


@allocation_free
def trip(watchdog: Watchdog, reason: int) -> None:
    """Remove the currents for a reason; a second reason has no effect."""
    if watchdog.halt == GO:
        watchdog.halt, watchdog.reason = watchdog.action, reason


@allocation_free
def count_rundown(watchdog: Watchdog) -> bool:
    """Count a tick after a trip; return True if it was the last one of the run."""
    if watchdog.halt == GO:
        return False
    watchdog.ticks_since_trip += 1
    return watchdog.ticks_since_trip > watchdog.rundown_ticks


def transfer_trip(before: Rows, after: Rows) -> None:
    """Copy a trip into a watchdog with other limits, also into or from one that is off."""
    for name in ("halt", "reason", "ticks_since_trip"):
        after[name] = before[name]
