"""Adaptive fuzzy sliding mode law (AFSM) of the paper, one subsystem an axis (40)-(43).

``v = theta^T Psi - xi sgn(s) - zeta sgn(s) S - K s`` with ``S = 1 + |s| + s^2``; the estimates adapt as
``theta' = -eta s Psi``, ``xi' = sigma |s|``, ``zeta' = varsigma |s| S``, all from 0. As in the paper, xi and
zeta only ever grow.
"""

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.law import Law
from spheretwin.control.parts.fuzzy import CONSEQUENTS, approximate_and_adapt
from spheretwin.control.parts.gains import (
    BOUND_RATE,
    FUZZY_RATE,
    INERTIA,
    PERIOD,
    REACHING_GAIN,
    SURFACE_SLOPE,
    SWITCHING_RATE,
    Gains,
)
from spheretwin.control.parts.sliding import SLIDING_SIGNAL, sliding_surface
from spheretwin.models.telemetry.signals import ANGLES, Signal

SIGNALS = (
    SLIDING_SIGNAL,
    Signal("fuzzy_torque_Nm", "N·m", 3, "torque of the fuzzy approximator", ANGLES),
    Signal("switching_torque_Nm", "N·m", 3, "torque of the two switching terms", ANGLES),
    Signal("switching_gain", "1", 3, "estimate ξ̂ of the approximation error's bound", ANGLES),
    Signal("bound_gain", "1", 3, "estimate ζ̂ of the coupling's bound", ANGLES),
)
SLIDING, FUZZY, SWITCHING, XI, ZETA, THETA = 0, 3, 6, 9, 12, 15  # layout of the state


def step(t, reference, measurement, parameters, state, torque):  # type: ignore[no-untyped-def]  # noqa: D103
    period = parameters[PERIOD]
    for axis in range(3):
        angle, rate = measurement[0, axis], measurement[1, axis]
        error, error_rate = angle - reference[0, axis], rate - reference[1, axis]
        s = sliding_surface(error, error_rate, parameters[SURFACE_SLOPE])
        coupling = 1.0 + abs(s) + s * s
        first = THETA + CONSEQUENTS * axis
        drive = -parameters[FUZZY_RATE] * s * period
        fuzzy = approximate_and_adapt(rate, angle, drive, state[first : first + CONSEQUENTS])
        switching = -np.sign(s) * (state[XI + axis] + state[ZETA + axis] * coupling)
        factor = parameters[INERTIA + axis]
        torque[axis] = factor * (fuzzy + switching - parameters[REACHING_GAIN] * s)
        state[SLIDING + axis] = s
        state[FUZZY + axis] = factor * fuzzy
        state[SWITCHING + axis] = factor * switching
        state[XI + axis] += parameters[SWITCHING_RATE] * abs(s) * period
        state[ZETA + axis] += parameters[BOUND_RATE] * abs(s) * coupling * period


def afsm(gains: Gains, inertia: NDArray[np.float64], period: float) -> Law:
    """AFSM law; every estimate starts at 0."""
    parameters = gains.pack(period, inertia)
    return Law("afsm", step, parameters, np.zeros(THETA + 3 * CONSEQUENTS), SIGNALS)
