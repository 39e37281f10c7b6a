"""Adaptive fuzzy law (AF): AFSM without its switching terms, ``v = theta^T Psi - K s``.

`spheretwin reproduce figure11` reports its errors with the printed gains; the study `tuning` searches others.
"""

from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.control.law import Law, NominalModel, NonNegativeEach, PositiveEach, each
from spheretwin.control.law_components.feedback import SLIDING_SIGNAL, sliding_surface
from spheretwin.control.law_components.fuzzy import CONSEQUENTS, approximate_and_adapt
from spheretwin.control.law_components.parameters import LawParameters, Level, named, torque_factor
from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.signals import ANGLES, Signal

SIGNALS = (
    SLIDING_SIGNAL,
    Signal("fuzzy_torque_Nm", "N·m", 3, "torque of the fuzzy approximator", ANGLES),
)
SURFACE_SLOPE, REACHING_GAIN, FUZZY_RATE, FACTOR, PERIOD = 0, 3, 6, 9, 12  # layout of the parameters
SLIDING, FUZZY, THETA = 0, 3, 6  # layout of the state


class AdaptiveFuzzy(LawParameters):
    """Adaptive fuzzy, with the gains of (58)."""

    law: Literal["adaptive_fuzzy"] = named("adaptive_fuzzy")
    level: Level = "acceleration"
    surface_slope: PositiveEach = Field(each(50.0), description="λ of s = λe + ė, 1/s")
    reaching_gain: NonNegativeEach = Field(each(20.0), description="K of the reaching term K s, 1/s")
    fuzzy_rate: NonNegativeEach = Field(each(10.0), description="η, adaptation rate of the fuzzy consequents")

    def build(self, known: NominalModel) -> Law:
        """Return a law whose consequents all start at 0."""
        gains = [*self.surface_slope, *self.reaching_gain, *self.fuzzy_rate]
        parameters = np.array([*gains, *torque_factor(self.level, known), known.period_s])
        return Law(self.law, step, parameters, np.zeros(THETA + 3 * CONSEQUENTS), SIGNALS)


def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the torque of one control tick; see `control.law.Law`."""
    for axis in range(3):
        angle, rate = measurement[0, axis], measurement[1, axis]
        error, error_rate = angle - reference[0, axis], rate - reference[1, axis]
        s = sliding_surface(error, error_rate, parameters[SURFACE_SLOPE + axis])
        first = THETA + CONSEQUENTS * axis
        drive = -parameters[FUZZY_RATE + axis] * s * parameters[PERIOD]
        fuzzy = approximate_and_adapt(rate, angle, drive, state[first : first + CONSEQUENTS])
        factor = parameters[FACTOR + axis]
        torque[axis] = factor * (fuzzy - parameters[REACHING_GAIN + axis] * s)
        state[SLIDING + axis] = s
        state[FUZZY + axis] = factor * fuzzy
