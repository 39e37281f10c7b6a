"""Plausibility of the measured motion: angles that are frozen, and a motion that contradicts the model."""

from __future__ import annotations

import math
import sys

import numpy as np

from spheretwin.control.supervision.watchdog import Reason
from spheretwin.machine.link.limits import MachineLimits
from spheretwin.machine.link.stream import RunningShadow
from spheretwin.machine.model import model_of
from spheretwin.machine.state_estimation import Shadow
from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.table import Table
from spheretwin.scenario.plant_sections import ResolvedNominal
from spheretwin.scenario.sections import ResolvedScenario, Scenario

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
