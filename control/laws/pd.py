"""Proportional-derivative law, the paper's baseline: ``v = -stiffness e - damping edot``.

The gains are λ and K of (58), as the paper gives none for PD. `spheretwin reproduce figure11` reports the
errors with them; the study `tuning` searches others.
"""

from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.control.law import Law, NominalModel, NonNegativeEach, PositiveEach, each
from spheretwin.control.law_components.parameters import LawParameters, Level, named, torque_factor
from spheretwin.models.base.arrays import Array

STIFFNESS, DAMPING, FACTOR = 0, 3, 6  # layout of the parameters


class PD(LawParameters):
    """Proportional-derivative."""

    law: Literal["pd"] = named("pd")
    level: Level = "acceleration"
    stiffness: PositiveEach = Field(each(50.0), description="torque or acceleration per unit of error, 1/s²")
    damping: NonNegativeEach = Field(each(20.0), description="the same per unit of its rate, 1/s")

    def build(self, known: NominalModel) -> Law:
        """Return a law without memory."""
        factor = torque_factor(self.level, known)
        return Law(self.law, step, np.array([*self.stiffness, *self.damping, *factor]), np.zeros(0))


def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the torque of one control tick; see `control.law.Law`."""
    for axis in range(3):
        error = measurement[0, axis] - reference[0, axis]
        error_rate = measurement[1, axis] - reference[1, axis]
        stiffness, damping = parameters[STIFFNESS + axis], parameters[DAMPING + axis]
        torque[axis] = -parameters[FACTOR + axis] * (stiffness * error + damping * error_rate)
