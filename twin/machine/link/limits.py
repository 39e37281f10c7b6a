"""Settings of a link, and what removes the currents: limits of a machine, and an implausible motion."""

from __future__ import annotations

import math
import sys
from typing import Annotated

import numpy as np
from pydantic import ConfigDict, Field

from spheretwin.control.supervision.watchdog import Reason
from spheretwin.electronics.drive_section import ResolvedDrive
from spheretwin.loop.external import Measurement
from spheretwin.machine.link.stream import RunningShadow
from spheretwin.machine.model import model_of
from spheretwin.machine.state_estimation import Shadow
from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.table import Table
from spheretwin.scenario.fields import SettingsModel
from spheretwin.scenario.plant_sections import ResolvedNominal
from spheretwin.scenario.sections import ResolvedScenario, Scenario

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


UNLIKELY = 1e-12
"""Probability of identical measurements of a healthy sensor at rest, below which they are a fault."""

LEAST_NOISE_rad = 1e-3
"""Noise that the check of the motion allows in each angle, whatever the scenario states (assumed)."""

MOST_MISSING = 2
"""Measurements in a row that may be missing."""


class FrozenAngles:
    """Check for measurements that are identical to the bit although their noise is expected.

    Noise is expected if a rotor at rest, in the middle between two steps of each sensor, has that many
    identical measurements with a probability below `UNLIKELY`.

    Parameters
    ----------
    nominal : ResolvedNominal
        Noise and resolution of the angles.
    ticks : int
        Identical measurements in a row that are a fault.

    Attributes
    ----------
    noise_is_expected : bool
    """

    def __init__(self, nominal: ResolvedNominal, ticks: int) -> None:
        pairs = zip(nominal.angle_noise_rad, nominal.angle_resolution_rad, strict=True)
        identical = math.prod(_share_of_a_step(noise, step) for noise, step in pairs)
        self.noise_is_expected = identical**ticks < UNLIKELY
        self.nominal, self._ticks, self._count = nominal, ticks, 0
        self._last = np.full(3, np.nan)

    def advance(self, angle_rad: Array) -> bool:
        """Take a new measurement; return True if it is one too many that is identical."""
        self._count = self._count + 1 if np.array_equal(angle_rad, self._last) else 1
        self._last = angle_rad
        return self.noise_is_expected and self._count >= self._ticks


def _share_of_a_step(noise_rad: float, step_rad: float) -> float:
    """Return the probability that noise stays within the step in whose middle an angle is."""
    return math.erf(step_rad / noise_rad / math.sqrt(8)) if noise_rad else 1.0


class MotionCheck(RunningShadow):
    """Check of the motion by a shadow of its own.

    The innovations of a block are compared with those that the model expects, with a noise of at least
    `LEAST_NOISE_rad` and a motion of one control period, since a measurement may be that old.

    Parameters
    ----------
    shadow : Shadow
    period_s : float
        Control period.

    Attributes
    ----------
    chi2 : float
        Mean square of the innovations of the last block over the expected one: the largest of the hinges.
    largest_chi2 : float
        Of all blocks.
    """

    def __init__(self, shadow: Shadow, period_s: float) -> None:
        super().__init__(shadow)
        self._period_s, self.chi2, self.largest_chi2 = period_s, 0.0, 0.0

    def restart(self) -> None:
        """Begin again: the motion during a pause is not known."""
        self.shadow, self.chi2 = Shadow(self.shadow.model), 0.0
        self._rows.clear()

    def new(self) -> MotionCheck:
        """Return a check of the same machine at its start."""
        return MotionCheck(Shadow(self.shadow.model), self._period_s)

    def _take(self, table: Table) -> None:
        innovation, rate = table["innovation_rad"], table["qdot_estimated_rad_s"]
        with np.errstate(all="ignore"):  # an estimate that has diverged
            expected = innovation / table["innovation_normalised"]
            squares = innovation**2 / (expected**2 + (self._period_s * rate) ** 2)
        used = np.isfinite(table["q_measured_rad"])
        squares = np.where(used, np.where(np.isfinite(squares), squares, np.inf), 0.0)
        squares[innovation == 0.0] = 0.0
        self.chi2 = float(np.max(squares.sum(axis=0) / np.maximum(used.sum(axis=0), 1)))
        self.largest_chi2 = max(self.largest_chi2, self.chi2)


class Plausibility:
    """Checks of the motion of a machine that is driven.

    Parameters
    ----------
    frozen : FrozenAngles
    motion : MotionCheck
    limit_chi2 : float
        As in `Limits`.
    """

    def __init__(self, frozen: FrozenAngles, motion: MotionCheck, limit_chi2: float) -> None:
        self._frozen, self._motion, self._limit_chi2 = frozen, motion, limit_chi2
        self._missing = 0

    @classmethod
    def of(cls, scenario: Scenario, resolved: ResolvedScenario, limits: MachineLimits) -> Plausibility:
        """Return the checks of the machine of a scenario."""
        model = model_of(scenario)
        shadow = Shadow(model._replace(noise_rad=np.maximum(model.noise_rad, LEAST_NOISE_rad)))
        frozen = FrozenAngles(resolved.nominal, limits.frozen_ticks)
        return cls(frozen, MotionCheck(shadow, resolved.controller.period_s), limits.chi2)

    @property
    def largest_chi2(self) -> float:
        """Largest χ² of a block so far."""
        return self._motion.largest_chi2

    def unlimited(self) -> Plausibility:
        """Return checks of the same machine that compute the same and give no reason."""
        frozen = FrozenAngles(self._frozen.nominal, sys.maxsize)
        return Plausibility(frozen, self._motion.new(), math.inf)

    def advance(self, t_s: float, current_A: Array, angle_rad: Array, *, after_pause: bool = False) -> Reason:
        """Take the currents (n,) of a tick and the angles (3,) at its start, NaN if there are no new ones.

        After a pause, and after more than `MOST_MISSING` missing measurements, the time of the motion is not
        known: its check begins again.

        Returns
        -------
        Reason
            To remove the currents, if there is one.
        """
        is_new = bool(np.isfinite(angle_rad).all())
        self._missing = 0 if is_new else self._missing + 1
        if after_pause or self._missing > MOST_MISSING:
            self._motion.restart()
        else:
            self._motion.advance(t_s, current_A, angle_rad)
        if is_new and self._frozen.advance(angle_rad):
            return Reason.FROZEN
        return Reason.MODEL if self._motion.chi2 > self._limit_chi2 else Reason.NONE
