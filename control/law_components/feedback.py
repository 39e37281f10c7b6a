"""Feedback of an axis's error, rate and integral: ``v = -stiffness e - damping edot - integral ∫e dt``.

The integral is stored as a torque, with back-calculation from the applied torque:

    I' = −J integral e + (applied − commanded) √(integral/damping),

with `commanded` delayed by the nominal delay. While the allocation gives the whole command, the bracket is
the effect of the lag of the currents, and 0 at rest: a constant load leaves no error. At the current limit
the bracket stops the integral where the torque just reaches the limit (anti-windup). The time constant
√(damping/integral) is the root of integral time and derivative time, as is usual; it is √3/ω for a triple
pole at −ω. The controller does not know of a loss of torque in the drive, such as a limit below the nominal
one.
"""

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.law import Law, NominalModel
from spheretwin.control.law_components.extended_state_observer import (
    delayed_command,
    history_layout,
    store_command,
)
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.telemetry.signals import ANGLES, Signal


def tracking_rate(rate: NDArray[np.float64], known: NominalModel) -> NDArray[np.float64]:
    """Limit rates of back-calculation (1/s) to one over the control period."""
    return np.minimum(rate, 1 / known.period_s)


INTEGRAL_SIGNAL = Signal("integral_torque_Nm", "N·m", 3, "torque of the integral", ANGLES)
STIFFNESS, DAMPING, INTEGRAL, TRACKING, FRACTION, PERIOD = 0, 3, 6, 9, 12, 13  # layout of the parameters
TORQUE, HISTORY = 0, 3  # layout of the state


def triple_pole(bandwidth_rad_s: float) -> tuple[float, float, float]:
    """Return stiffness, damping and integral with all three poles of an axis at minus the bandwidth."""
    return 3 * bandwidth_rad_s**2, 3 * bandwidth_rad_s, bandwidth_rad_s**3


def tracking(damping: Array, integral: Array, known: NominalModel) -> Array:
    """Return the rates of back-calculation, (3,) in 1/s: √(integral/damping)."""
    return tracking_rate(np.sqrt(integral / damping), known)


def feedback(name: str, gains: Array, known: NominalModel) -> Law:
    """Return a law with integral, which starts at 0.

    Parameters
    ----------
    name : str
    gains : (3, 3) array
        Stiffness, damping and integral as rows, 1/s², 1/s and 1/s³: acceleration per unit of error, of its
        rate and of its integral.
    known : NominalModel
    """
    fraction, size = history_layout(known)
    torques = (gains * known.inertia).ravel()
    parameters = [*torques, *tracking(gains[1], gains[2], known), fraction, known.period_s]
    state = np.zeros(HISTORY + size)
    return Law(name, step, np.array(parameters), state, (INTEGRAL_SIGNAL,), asks_torque=True)


def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the torque of one control tick; see `control.law.Law`."""
    fraction, period, history = parameters[FRACTION], parameters[PERIOD], state[HISTORY:]
    for axis in range(3):
        error = measurement[0, axis] - reference[0, axis]
        error_rate = measurement[1, axis] - reference[1, axis]
        torque_error = measurement[2, axis] - delayed_command(history, axis, fraction)
        state[TORQUE + axis] += period * parameters[TRACKING + axis] * torque_error
        stiffness, damping = parameters[STIFFNESS + axis], parameters[DAMPING + axis]
        torque[axis] = state[TORQUE + axis] - stiffness * error - damping * error_rate
        state[TORQUE + axis] -= period * parameters[INTEGRAL + axis] * error
    store_command(history, torque)


SLIDING_SIGNAL = Signal("sliding_s", "rad/s", 3, "sliding variable s = λe + ė (30)", ANGLES)


@allocation_free
def sliding_surface(error: float, error_rate: float, slope: float) -> float:
    """Return the sliding variable of one axis, rad/s; it is 0 if the error decays at the rate `slope`."""
    return slope * error + error_rate
