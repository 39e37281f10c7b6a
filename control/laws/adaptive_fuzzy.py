"""Adaptive fuzzy law (AF): AFSM without its switching terms, ``v = theta^T Psi - K s``."""

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.law import Law
from spheretwin.control.parts.fuzzy import CONSEQUENTS, approximate_and_adapt
from spheretwin.control.parts.gains import FUZZY_RATE, INERTIA, PERIOD, REACHING_GAIN, SURFACE_SLOPE, Gains
from spheretwin.control.parts.sliding import SLIDING_SIGNAL, sliding_surface
from spheretwin.models.telemetry.signals import ANGLES, Signal

SIGNALS = (
    SLIDING_SIGNAL,
    Signal("fuzzy_torque_Nm", "N·m", 3, "torque of the fuzzy approximator", ANGLES),
)
SLIDING, FUZZY, THETA = 0, 3, 6  # layout of the state


def step(t, reference, measurement, parameters, state, torque):  # type: ignore[no-untyped-def]  # noqa: D103
    for axis in range(3):
        angle, rate = measurement[0, axis], measurement[1, axis]
        error, error_rate = angle - reference[0, axis], rate - reference[1, axis]
        s = sliding_surface(error, error_rate, parameters[SURFACE_SLOPE])
        first = THETA + CONSEQUENTS * axis
        drive = -parameters[FUZZY_RATE] * s * parameters[PERIOD]
        fuzzy = approximate_and_adapt(rate, angle, drive, state[first : first + CONSEQUENTS])
        factor = parameters[INERTIA + axis]
        torque[axis] = factor * (fuzzy - parameters[REACHING_GAIN] * s)
        state[SLIDING + axis] = s
        state[FUZZY + axis] = factor * fuzzy


def adaptive_fuzzy(gains: Gains, inertia: NDArray[np.float64], period: float) -> Law:
    """Adaptive fuzzy law; every consequent starts at 0."""
    parameters = gains.pack(period, inertia)
    return Law("adaptive_fuzzy", step, parameters, np.zeros(THETA + 3 * CONSEQUENTS), SIGNALS)
