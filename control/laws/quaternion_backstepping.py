r"""Quaternion backstepping: rotation error, then rate error, then a constant load of the stator frame.

After Kristiansen, Nicklasson and Gravdahl, *IEEE Transactions on Control Systems Technology* 17 (2009), doi
10.1109/TCST.2008.924576, on the quaternion (η, ε) of `control.law_components.rotation`; the estimate D of the
load is added. The first step wants e_Ω = −c ε; on the remainder z = e_Ω + c ε the law is

    e_Ω' = −c ε' − k ε − h z,      with the torque D added,      D' = −γ j² R J⁻¹ z,

where ε' = ½ (η e_Ω + ε × e_Ω) and j is the mean principal inertia.

*Stability.* With the true inertia and a constant load d in the stator frame, z' = −k ε − h z + J⁻¹Rᵀ(D − d).
So, with V' for any motion as long as the shorter way does not change (η > 0),

    V  = 2 k (1 − η) + ½ |z|² + |D − d|²/(2 γ j²),      V' = −k c |ε|² − h |z|²,

It changes at 180°: the law turns back instead of unwinding. Each component of D is bounded.

*Tuning by one parameter.* To first order ε is half the rotation error and the characteristic polynomial is
s³ + (h + c/2) s² + ((k + h c)/2 + γ) s + γ c/2: with c = 4ω, k = ω², h = ω and γ = ω²/2 three poles at −ω.

*Default.* ω = 40 1/s, as in the geometric PID, and its bound of 0.2 N·m.
"""

from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.control.law import Law, NominalModel, NonNegative, Positive
from spheretwin.control.law_components.parameters import named
from spheretwin.control.law_components.rotation import (
    RotationLaw,
    cross,
    plus,
    rotated,
    rotation_error,
    scaled,
    write_torque,
)
from spheretwin.models.base.arrays import Array
from spheretwin.models.kinematics import triple
from spheretwin.models.telemetry.signals import AXES, Signal

BANDWIDTH_rad_s = 40.0

SIGNALS = (
    Signal("backstepping_z", "rad/s", 3, "remainder z = e_Ω + c ε in the rotor frame", AXES),
    Signal("adapted_torque_S_Nm", "N·m", 3, "estimate D of the load, stator frame", AXES),
)
# Layout of the parameters.
ANGLE_GAIN, COUPLING, REACHING_GAIN, ADAPTATION, LIMIT, INERTIA, PERIOD = 0, 1, 2, 3, 4, 5, 8
ADAPTED = 3  # layout of the state: z first


class QuaternionBackstepping(RotationLaw):
    """Adaptive backstepping on the quaternion of the rotation error."""

    law: Literal["quaternion_backstepping"] = named("quaternion_backstepping")
    angle_gain: Positive = Field(4 * BANDWIDTH_rad_s, description="c of z = e_Ω + c ε, 1/s")
    coupling: Positive = Field(BANDWIDTH_rad_s**2, description="k, acceleration per unit of ε, 1/s²")
    rate_gain: Positive = Field(BANDWIDTH_rad_s, description="h, acceleration per unit of z, 1/s")
    load_rate: NonNegative = Field(
        BANDWIDTH_rad_s**2 / 2, description="γ, adaptation rate of the load's estimate, 1/s²"
    )
    load_limit_Nm: Positive = Field(0.2, description="largest component of the load's estimate, N·m")

    def build(self, known: NominalModel) -> Law:
        """Return a law whose estimate starts at 0."""
        rate = self.load_rate * np.mean(known.inertia) ** 2
        gains = [self.angle_gain, self.coupling, self.rate_gain, rate, self.load_limit_Nm]
        parameters = np.array([*gains, *known.inertia, known.period_s])
        return Law(self.law, step, parameters, np.zeros(6), SIGNALS, cartesian=True)


def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the Cartesian torque of one control tick; see `control.law.Law`."""
    J1, J2, J3 = inertia = triple(parameters[INERTIA:PERIOD])
    c, limit = parameters[ANGLE_GAIN], parameters[LIMIT]
    error = rotation_error(reference, measurement)
    eta, epsilon = error.quaternion.scalar, error.quaternion.vector
    growth = scaled(0.5, plus(scaled(eta, error.rate), cross(epsilon, error.rate)))
    z = plus(error.rate, scaled(c, epsilon))
    correction = plus(scaled(-c, growth), scaled(-parameters[COUPLING], epsilon))
    wanted = plus(error.acceleration, plus(correction, scaled(-parameters[REACHING_GAIN], z)))
    write_torque(error, wanted, inertia, torque)
    step_R = scaled(-parameters[ADAPTATION] * parameters[PERIOD], (z[0] / J1, z[1] / J2, z[2] / J3))
    step_S = rotated(error.pose, step_R)
    for axis in range(3):
        state[axis] = z[axis]
        torque[axis] += state[ADAPTED + axis]
        state[ADAPTED + axis] = min(limit, max(-limit, state[ADAPTED + axis] + step_S[axis]))
