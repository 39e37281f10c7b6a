"""Computed torque, with or without an integral: inverse dynamics for the correcting acceleration.

``tau = M(q) (qddot_d - damping edot - stiffness e) + C(q, qdot) qdot + I`` with the nominal M and C, after
Bai and Lee, IEEE/ASME Transactions on Mechatronics 19 (2014), doi 10.1109/TMECH.2013.2264565, and Chen and
others, Sensors and Actuators A 180 (2012), doi 10.1016/j.sna.2012.04.010; the integral is added.

*Principle.* With the true model and no disturbance, M cancels and ë + damping ė + stiffness e = 0 on each
axis, for any motion: there is no coupling. A load d leaves the error M⁻¹d/stiffness without the integral, and
none with it. I is stored as a torque, I' = −M integral e, so that it is constant under a constant load while
the rotor moves. For back-calculation see `control.law_components.feedback`. ``integral = 0`` is the law of
the two papers.

*Tuning by one parameter.* (3ω², 3ω, ω³) puts three poles at −ω; without an integral (ω², 2ω, 0) puts two.

*Default.* ω = 40 1/s, as in PID. On ideal hardware a faster one is better. `spheretwin reproduce rivals` has
the figures; the study `tuning` searches ω and the damping.
"""

from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.control.law import Law, NominalModel, NonNegativeEach, PositiveEach, each
from spheretwin.control.law_components.extended_state_observer import (
    delayed_command,
    history_layout,
    store_command,
)
from spheretwin.control.law_components.feedback import INTEGRAL_SIGNAL, tracking, triple_pole
from spheretwin.control.law_components.nominal_motion import model_torque
from spheretwin.control.law_components.parameters import LawParameters, named
from spheretwin.models.base.arrays import Array

# Layout of the parameters.
STIFFNESS, DAMPING, INTEGRAL, TRACKING, INERTIA, FRACTION, PERIOD = 0, 3, 6, 9, 12, 15, 16
TORQUE, HISTORY = 0, 3  # layout of the state

BANDWIDTH_rad_s = 40.0
_STIFFNESS, _DAMPING, _INTEGRAL = triple_pole(BANDWIDTH_rad_s)


class ComputedTorque(LawParameters):
    """Computed torque with a triple pole; without an integral if `integral` is 0."""

    law: Literal["computed_torque"] = named("computed_torque")
    stiffness: PositiveEach = Field(each(_STIFFNESS), description="acceleration per unit of error, 1/s²")
    damping: PositiveEach = Field(each(_DAMPING), description="acceleration per unit of its rate, 1/s")
    integral: NonNegativeEach = Field(
        each(_INTEGRAL), description="acceleration per unit of its integral, 1/s³"
    )

    def build(self, known: NominalModel) -> Law:
        """Return a law whose integral starts at 0."""
        fraction, size = history_layout(known)
        rates = tracking(np.array(self.damping), np.array(self.integral), known)
        gains = [*self.stiffness, *self.damping, *self.integral, *rates]
        parameters = np.array([*gains, *known.inertia, fraction, known.period_s])
        return Law(self.law, step, parameters, np.zeros(HISTORY + size), (INTEGRAL_SIGNAL,), asks_torque=True)


def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the torque of one control tick; see `control.law.Law`."""
    period, history, inertia = parameters[PERIOD], state[HISTORY:], parameters[INERTIA : INERTIA + 3]
    acceleration, growth = np.empty(3), np.empty(3)
    for axis in range(3):
        error = measurement[0, axis] - reference[0, axis]
        error_rate = measurement[1, axis] - reference[1, axis]
        pull = parameters[STIFFNESS + axis] * error + parameters[DAMPING + axis] * error_rate
        acceleration[axis] = reference[2, axis] - pull
        growth[axis] = -parameters[INTEGRAL + axis] * error
        torque_error = measurement[2, axis] - delayed_command(history, axis, parameters[FRACTION])
        state[TORQUE + axis] += period * parameters[TRACKING + axis] * torque_error
    model_torque(measurement, acceleration, measurement[1], inertia, torque)
    for axis in range(3):
        torque[axis] += state[TORQUE + axis]
    model_torque(measurement, growth, np.zeros(3), inertia, acceleration)
    for axis in range(3):
        state[TORQUE + axis] += period * acceleration[axis]
    store_command(history, torque)
