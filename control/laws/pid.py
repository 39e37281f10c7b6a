r"""Proportional-integral-derivative law: ``v = -stiffness e - damping edot - integral ∫e dt``.

*Tuning by one parameter.* An axis is a double integrator to this law. The characteristic polynomial is
s³ + damping s² + stiffness s + integral. With (3ω, 3ω², ω³) all three poles are at −ω: `triple_pole`.

*Windup.* The integral is back-calculated at √(integral/damping), ω/√3 for a triple pole: see
`control.law_components.feedback`.

*Default.* ω = 40 1/s, chosen for the least error on the tilt (60) with the prototype's hardware: below it the
corners of the reference cost more, above it γ hunts between counts of its encoder. On ideal hardware a faster
one is better. `spheretwin reproduce rivals` reports the figures; the study `tuning` searches all three gains.
"""

from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.control.law import Law, NominalModel, NonNegativeEach, PositiveEach, each
from spheretwin.control.law_components.feedback import feedback, triple_pole
from spheretwin.control.law_components.parameters import LawParameters, named

BANDWIDTH_rad_s = 40.0
_STIFFNESS, _DAMPING, _INTEGRAL = triple_pole(BANDWIDTH_rad_s)


class PID(LawParameters):
    """Proportional-integral-derivative, with a triple pole."""

    law: Literal["pid"] = named("pid")
    stiffness: PositiveEach = Field(each(_STIFFNESS), description="acceleration per unit of error, 1/s²")
    damping: PositiveEach = Field(each(_DAMPING), description="acceleration per unit of its rate, 1/s")
    integral: NonNegativeEach = Field(
        each(_INTEGRAL), description="acceleration per unit of its integral, 1/s³"
    )

    def build(self, known: NominalModel) -> Law:
        """Return a law whose integral starts at 0."""
        return feedback(self.law, np.array([self.stiffness, self.damping, self.integral]), known)
