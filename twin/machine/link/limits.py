"""Settings of a link, and limits of a machine: each one that is exceeded removes the currents."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import ConfigDict, Field

from spheretwin.control.supervision.watchdog import Reason
from spheretwin.electronics.drive_section import ResolvedDrive
from spheretwin.loop.external import Measurement
from spheretwin.models.base.arrays import Array
from spheretwin.scenario.fields import SettingsModel

Positive = Annotated[float, Field(gt=0, le=1e6)]


class LinkSettings(SettingsModel):
    """Settings of the drive of a machine."""

    model_config = ConfigDict(strict=True)

    armed: bool = Field(False, description="whether currents are sent; otherwise all are 0: a dry run")
    ramp_s: Annotated[float, Field(ge=0, le=1e3)] = Field(
        1.0, description="time in which the share of the commands that is sent rises from 0 to 1, s"
    )
    timeout_s: Annotated[float, Field(gt=0, le=1e3)] = Field(
        0.01, description="age of the newest measurement at which the currents are removed, s (assumed)"
    )
    connect_s: Annotated[float, Field(gt=0, le=1e3)] = Field(
        60.0, description="longest wait for the first measurement, s: a machine may have to compile first"
    )
    lockstep: bool = Field(
        False, description="whether a tick waits for the reply of the machine instead of the clock"
    )


class MachineLimits(SettingsModel):
    """Limits of the measurements of a machine."""

    model_config = ConfigDict(strict=True)

    current_A: Positive = Field(description="largest commanded current of a group, A")
    current_excess_A: Positive = Field(
        1.0, description="excess of a measured current over current_A, A (assumed: overshoot and noise)"
    )
    tilt_rad: Positive | None = Field(
        None, description="largest magnitude of α and β, rad; the range of the hinges unless given"
    )
    temperature_degC: Positive = Field(120.0, description="highest temperature of a coil, °C (assumed)")

    frozen_ticks: Annotated[int, Field(ge=2, le=1_000_000)] = Field(
        20, description="measurements of all angles in a row, identical to the bit while noise is expected"
    )
    chi2: Annotated[float, Field(gt=0, le=1e12)] = Field(
        50.0,
        description="mean square of the innovations of 20 ticks over that expected by the model, while armed"
        " (assumed: a healthy machine has up to 5, a frozen sensor 90 to 700)",
    )

    def exceeded(self, measurement: Measurement, temperature_degC: float) -> Reason:
        """Return the reason to remove the currents for a finite measurement, if there is one."""
        angle, current = measurement.angle_rad, measurement.current_A
        if self.tilt_rad is not None and not np.all(np.abs(angle[:2]) <= self.tilt_rad):
            return Reason.EDGE
        if current is not None and np.any(np.abs(current) > self.current_A + self.current_excess_A):
            return Reason.CURRENT
        if temperature_degC > self.temperature_degC:
            return Reason.TEMPERATURE
        return Reason.NONE


class CoilHeat:
    """Temperatures of the coils by the currents that were sent, for a machine that reports none.

    The resistance is that of the highest allowed temperature, so that the estimate is on the safe side.

    Parameters
    ----------
    drive : ResolvedDrive
        Resistance, heat capacity and thermal resistance of each group.
    limits : MachineLimits
    period_s : float
    """

    def __init__(self, drive: ResolvedDrive, limits: MachineLimits, period_s: float) -> None:
        hot = 1 + np.multiply(drive.resistance_per_K, max(limits.temperature_degC - drive.ambient_degC, 0.0))
        time_constants_s = np.multiply(drive.heat_capacity_J_K, drive.thermal_resistance_K_W)
        with np.errstate(divide="ignore"):
            self._decay = np.exp(-period_s / time_constants_s)
        self._rise_K_A2 = np.multiply(drive.resistance_ohm, hot) * drive.thermal_resistance_K_W
        self._ambient_degC = drive.ambient_degC
        self._rise_K: Array | float = 0.0

    def advance(self, current_A: Array) -> float:
        """Advance by a control period with the currents (n,); return the highest temperature, °C."""
        final_K = self._rise_K_A2 * current_A**2
        self._rise_K = final_K + self._decay * (self._rise_K - final_K)
        return self._ambient_degC + float(np.max(self._rise_K))
