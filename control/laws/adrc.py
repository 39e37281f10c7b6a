"""Active disturbance rejection control (ADRC): a disturbance observer and its compensation.

After Liu and others, *IET Control Theory and Applications* 11 (2017), doi 10.1049/iet-cta.2016.0551, linear,
with two bandwidths as the only gains. Each axis is a double integrator 1/J. Coupling, load and model error
are one torque d, which extends the state of the observer:

    τ = J (q̈_d − ω² (x − q_d) − 2ω (v − q̇_d)) − d.

*Observer.* It uses the angle alone. Over a period T it predicts x and v with the applied torque and d. The
innovation m of the angle corrects x by l₁ m, v by l₂ m and d by J l₃ m. With a = e^(−ω_o T) and

    l₁ = 1 − a³,   l₃ = (1 − a)³/T²,   l₂ = (3(1 − a) − l₁ − ½ l₃ T²)/T

all three poles of its error are at a, sampled exactly. As the applied torque is that of the coils, neither
the current limit nor the delay of the commands enters d: there is no windup. Under a constant load its error
goes to 0, and with it that of the angle.

*Poles.* Feedback and observer separate: the poles are two at −ω and three at −ω_o, in either order.

*Default.* ω = 140 1/s before an observer of 80, and of 40 for γ, which has an encoder: a slow
observer filters enough noise for a fast feedback. Slower pairs vary the currents less on the prototype's
tilt, and err more where loads come at once; on ideal hardware a fast observer is better. `spheretwin
reproduce rivals` has the figures; the study `tuning` searches both bandwidths.
"""

from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.control.law import Law, NominalModel, PositiveEach, each
from spheretwin.control.law_components.parameters import LawParameters, named
from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.signals import ANGLES, Signal

SIGNALS = (Signal("observed_torque_Nm", "N·m", 3, "disturbance torque estimated by the observer, d", ANGLES),)
BANDWIDTH, FIRST, SECOND, THIRD, INERTIA, PERIOD = 0, 3, 6, 9, 12, 15  # layout of the parameters
OBSERVED, ANGLE, RATE, STARTED = 0, 3, 6, 9  # layout of the state

BANDWIDTH_rad_s = 140.0
OBSERVER_rad_s = (80.0, 80.0, 40.0)


def observer_gains(bandwidth_rad_s: Array, period_s: float) -> tuple[Array, Array, Array]:
    """Return the gains of the sampled observer: all three poles at ``exp(-bandwidth period)``."""
    left = -np.expm1(-bandwidth_rad_s * period_s)  # 1 - a
    first = left * (3 - 3 * left + left**2)  # 1 - a³
    third = left**3 / period_s**2
    second = (3 * left - first - 0.5 * third * period_s**2) / period_s
    return first, second, third


class ADRC(LawParameters):
    """Active disturbance rejection."""

    law: Literal["adrc"] = named("adrc")
    bandwidth: PositiveEach = Field(each(BANDWIDTH_rad_s), description="ω of the feedback's double pole, 1/s")
    observer_bandwidth: PositiveEach = Field(
        OBSERVER_rad_s, description="ω_o of the observer's triple pole, 1/s"
    )

    def build(self, known: NominalModel) -> Law:
        """Return a law whose observer starts at the first measurement."""
        gains = observer_gains(np.array(self.observer_bandwidth), known.period_s)
        parameters = np.array([*self.bandwidth, *np.concatenate(gains), *known.inertia, known.period_s])
        return Law(self.law, step, parameters, np.zeros(STARTED + 1), SIGNALS, asks_torque=True)


def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the torque of one control tick; see `control.law.Law`."""
    T, started = parameters[PERIOD], state[STARTED] != 0.0
    for axis in range(3):
        inertia, bandwidth = parameters[INERTIA + axis], parameters[BANDWIDTH + axis]
        observed, angle, rate = state[OBSERVED + axis], state[ANGLE + axis], state[RATE + axis]
        if started:
            push = (measurement[2, axis] + observed) / inertia
            angle += T * rate + 0.5 * T * T * push
            rate += T * push
        else:
            angle, rate = measurement[0, axis], measurement[1, axis]
        missed = measurement[0, axis] - angle
        angle += parameters[FIRST + axis] * missed
        rate += parameters[SECOND + axis] * missed
        observed += inertia * parameters[THIRD + axis] * missed
        pull = bandwidth * bandwidth * (angle - reference[0, axis])
        pull += 2.0 * bandwidth * (rate - reference[1, axis])
        torque[axis] = inertia * (reference[2, axis] - pull) - observed
        state[OBSERVED + axis], state[ANGLE + axis], state[RATE + axis] = observed, angle, rate
    state[STARTED] = 1.0
