r"""Geometric PD and PID on rotations: ``v = −stiffness e_R − damping e_Ω − integral ∫e_R dt``.

After Lee, Leok and McClamroch, *Geometric tracking control of a quadrotor UAV on SE(3)*, IEEE Conference on
Decision and Control 2010, doi 10.1109/CDC.2010.5717652, and for the integral Goodarzi, Lee and Lee,
*Geometric nonlinear PID control of a quadrotor UAV on SE(3)*, European Control Conference 2013. Errors and
the torque that gives e_Ω' = v are those of `control.law_components.rotation`; gains are accelerations, as in
PID.

*Stability.* With the true inertia and no load, V = stiffness (1 − cos θ) + ½ |e_Ω|² has V' = −damping |e_Ω|²
for any motion of rotor and reference: the error goes to 0 from any start with V < 2 stiffness. To first
order in the error each component is ë + damping ė + stiffness e = 0. Beyond 90° the restoring torque falls
with sin θ.

*Integral.* It is a torque of the stator frame, I' = −R J integral e_R, so that it stays constant under a load
that the stator holds, such as a weight, while the rotor spins. Each component is bounded (anti-windup).

*Defaults.* Two poles at −ω, (ω², 2ω), without the integral, three with it, (3ω², 3ω, ω³); ω = 40 1/s as in
PID and computed torque. The integral is bounded to four times the weight moment of the prototype's payload.
"""

from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.control.law import Law, NominalModel, NonNegative, Positive
from spheretwin.control.law_components.feedback import triple_pole
from spheretwin.control.law_components.parameters import named
from spheretwin.control.law_components.rotation import (
    RotationLaw,
    plus,
    rotated,
    rotation_error,
    rotation_vector,
    scaled,
    times,
    write_torque,
)
from spheretwin.models.base.arrays import Array
from spheretwin.models.kinematics import triple
from spheretwin.models.telemetry.signals import AXES, Signal

BANDWIDTH_rad_s = 40.0
_STIFFNESS, _DAMPING, _INTEGRAL = triple_pole(BANDWIDTH_rad_s)

# Layout of the parameters.
STIFFNESS, DAMPING, INTEGRAL, LIMIT, INERTIA, PERIOD = 0, 1, 2, 3, 4, 7

ERROR_SIGNAL = Signal("rotation_error", "1", 3, "rotation error e_R = n sin θ in the rotor frame", AXES)
TORQUE_SIGNAL = Signal("integral_torque_S_Nm", "N·m", 3, "torque of the integral, stator frame", AXES)
TORQUE = 3  # layout of the state: error first


class GeometricPD(RotationLaw):
    """Geometric proportional-derivative law on rotations."""

    law: Literal["geometric_pd"] = named("geometric_pd")
    rotation_stiffness: Positive = Field(BANDWIDTH_rad_s**2, description="acceleration per unit of e_R, 1/s²")
    rotation_damping: NonNegative = Field(
        2 * BANDWIDTH_rad_s, description="acceleration per unit of e_Ω, 1/s"
    )

    def build(self, known: NominalModel) -> Law:
        """Return a law without memory; its state holds the logged error."""
        parameters = np.array(
            [self.rotation_stiffness, self.rotation_damping, 0.0, 0.0, *known.inertia, known.period_s]
        )
        return Law(self.law, step, parameters, np.zeros(6), (ERROR_SIGNAL,), cartesian=True)


class GeometricPID(RotationLaw):
    """Geometric proportional-integral-derivative law on rotations."""

    law: Literal["geometric_pid"] = named("geometric_pid")
    rotation_stiffness: Positive = Field(_STIFFNESS, description="acceleration per unit of e_R, 1/s²")
    rotation_damping: NonNegative = Field(_DAMPING, description="acceleration per unit of e_Ω, 1/s")
    rotation_integral: NonNegative = Field(
        _INTEGRAL, description="acceleration per unit of the integral of e_R, 1/s³"
    )
    integral_limit_Nm: Positive = Field(
        0.2,
        description="largest component of the integral's torque, N·m; four times the weight of the payload",
    )

    def build(self, known: NominalModel) -> Law:
        """Return a law whose integral starts at 0."""
        gains = [
            self.rotation_stiffness,
            self.rotation_damping,
            self.rotation_integral,
            self.integral_limit_Nm,
        ]
        parameters = np.array([*gains, *known.inertia, known.period_s])
        return Law(self.law, step, parameters, np.zeros(6), (ERROR_SIGNAL, TORQUE_SIGNAL), cartesian=True)


def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the Cartesian torque of one control tick; see `control.law.Law`."""
    inertia, limit = triple(parameters[INERTIA:PERIOD]), parameters[LIMIT]
    error = rotation_error(reference, measurement)
    turn = rotation_vector(error)
    correction = plus(scaled(-parameters[STIFFNESS], turn), scaled(-parameters[DAMPING], error.rate))
    write_torque(error, plus(error.acceleration, correction), inertia, torque)
    growth = scaled(-parameters[INTEGRAL] * parameters[PERIOD], times(inertia, turn))
    growth_S = rotated(error.pose, growth)
    for axis in range(3):
        state[axis] = turn[axis]
        torque[axis] += state[TORQUE + axis]
        state[TORQUE + axis] = min(limit, max(-limit, state[TORQUE + axis] + growth_S[axis]))
