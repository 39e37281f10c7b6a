"""Proportional-derivative law, the paper's baseline: ``v = -lambda e - K edot``."""

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.law import Law
from spheretwin.control.parts.gains import INERTIA, REACHING_GAIN, SURFACE_SLOPE, Gains


def step(t, reference, measurement, parameters, state, torque):  # type: ignore[no-untyped-def]  # noqa: D103
    stiffness, damping = parameters[SURFACE_SLOPE], parameters[REACHING_GAIN]
    for axis in range(3):
        error = measurement[0, axis] - reference[0, axis]
        error_rate = measurement[1, axis] - reference[1, axis]
        torque[axis] = -parameters[INERTIA + axis] * (stiffness * error + damping * error_rate)


def pd(gains: Gains, inertia: NDArray[np.float64], period: float) -> Law:
    """PD law with stiffness `surface_slope` (1/s²) and damping `reaching_gain` (1/s)."""
    return Law("pd", step, gains.pack(period, inertia), np.zeros(0))
