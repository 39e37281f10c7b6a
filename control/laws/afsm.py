"""Adaptive fuzzy sliding mode law (AFSM) of the paper, one subsystem per axis (40)-(43).

``v = theta^T Psi - xi sgn(s) - zeta sgn(s) S - K s`` with ``S = 1 + |s| + s^2``; the estimates adapt as
``theta' = -eta s Psi``, ``xi' = sigma |s|``, ``zeta' = varsigma |s| S``, all from 0. As in the paper, xi and
zeta only ever grow.

On rotations the same three subsystems act on the components of the rotation error e_R and of its rate e_Ω in
the rotor frame (see `control.law_components.rotation`), which are also the inputs of the approximator.

`spheretwin reproduce figure11` reports its errors with the printed gains, `spheretwin reproduce stability`
the effects of the growth of ξ and ζ; the study `tuning` searches other gains.
"""

from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.control.law import Law, NominalModel, NonNegativeEach, PositiveEach, each
from spheretwin.control.law_components.feedback import SLIDING_SIGNAL, sliding_surface
from spheretwin.control.law_components.fuzzy import CONSEQUENTS, approximate_and_adapt
from spheretwin.control.law_components.parameters import LawParameters, Level, named, torque_factor
from spheretwin.control.law_components.rotation import (
    RotationLaw,
    rotated,
    rotation_error,
    rotation_vector,
)
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.kinematics import triple
from spheretwin.models.telemetry.signals import ANGLES, AXES, Signal

SIGNALS = (
    SLIDING_SIGNAL,
    Signal("fuzzy_torque_Nm", "N·m", 3, "torque of the fuzzy approximator", ANGLES),
    Signal("switching_torque_Nm", "N·m", 3, "torque of the two switching terms", ANGLES),
    Signal("switching_gain", "1", 3, "estimate ξ̂ of the approximation error's bound", ANGLES),
    Signal("bound_gain", "1", 3, "estimate ζ̂ of the coupling's bound", ANGLES),
)
ROTATION_SIGNALS = tuple(replace(signal, name=f"rotation_{signal.name}", labels=AXES) for signal in SIGNALS)
# Layout of the parameters.
SURFACE_SLOPE, REACHING_GAIN, FUZZY_RATE, SWITCHING_RATE, BOUND_RATE, FACTOR, PERIOD = 0, 3, 6, 9, 12, 15, 18
SLIDING, FUZZY, SWITCHING, XI, ZETA, THETA = 0, 3, 6, 9, 12, 15  # layout of the state


class _Gains(LawParameters):
    """Gains of (58)."""

    level: Level = "acceleration"
    surface_slope: PositiveEach = Field(each(50.0), description="λ of s = λe + ė, 1/s")
    reaching_gain: NonNegativeEach = Field(each(20.0), description="K of the reaching term K s, 1/s")
    fuzzy_rate: NonNegativeEach = Field(each(10.0), description="η, adaptation rate of the fuzzy consequents")
    switching_rate: NonNegativeEach = Field(each(10.0), description="σ, growth rate of the switching gain ξ̂")
    bound_rate: NonNegativeEach = Field(each(10.0), description="ς, growth rate of the coupling bound ζ̂")

    def _numbers(self, known: NominalModel) -> tuple[Array, Array]:
        """Return parameters and state; the estimates all start at 0."""
        gains = [*self.surface_slope, *self.reaching_gain, *self.fuzzy_rate]
        rates = [*self.switching_rate, *self.bound_rate]
        parameters = np.array([*gains, *rates, *torque_factor(self.level, known), known.period_s])
        return parameters, np.zeros(THETA + 3 * CONSEQUENTS)


class AFSM(_Gains):
    """Adaptive fuzzy sliding mode, with the gains of (58)."""

    law: Literal["afsm"] = named("afsm")

    def build(self, known: NominalModel) -> Law:
        """Return a law whose estimates all start at 0."""
        return Law(self.law, step, *self._numbers(known), SIGNALS)


class RotationAFSM(_Gains, RotationLaw):
    """Adaptive fuzzy sliding mode on the rotation error, with the gains of (58)."""

    law: Literal["rotation_afsm"] = named("rotation_afsm")

    def build(self, known: NominalModel) -> Law:
        """Return a law whose estimates all start at 0."""
        return Law(self.law, rotation_step, *self._numbers(known), ROTATION_SIGNALS, cartesian=True)


def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the torque of one control tick; see `control.law.Law`."""
    period = parameters[PERIOD]
    for axis in range(3):
        angle, rate = measurement[0, axis], measurement[1, axis]
        error, error_rate = angle - reference[0, axis], rate - reference[1, axis]
        s = sliding_surface(error, error_rate, parameters[SURFACE_SLOPE + axis])
        coupling = 1.0 + abs(s) + s * s
        first = THETA + CONSEQUENTS * axis
        drive = -parameters[FUZZY_RATE + axis] * s * period
        fuzzy = approximate_and_adapt(rate, angle, drive, state[first : first + CONSEQUENTS])
        switching = -np.sign(s) * (state[XI + axis] + state[ZETA + axis] * coupling)
        factor = parameters[FACTOR + axis]
        torque[axis] = factor * (fuzzy + switching - parameters[REACHING_GAIN + axis] * s)
        state[SLIDING + axis] = s
        state[FUZZY + axis] = factor * fuzzy
        state[SWITCHING + axis] = factor * switching
        state[XI + axis] += parameters[SWITCHING_RATE + axis] * abs(s) * period
        state[ZETA + axis] += parameters[BOUND_RATE + axis] * abs(s) * coupling * period


_subsystems = allocation_free(step)


def rotation_step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the Cartesian torque of one control tick; see `control.law.Law`."""
    error = rotation_error(reference, measurement)
    turn = rotation_vector(error)
    for axis in range(3):
        measurement[0, axis], measurement[1, axis] = turn[axis], error.rate[axis]
        reference[0, axis] = reference[1, axis] = 0.0
    _subsystems(t, reference, measurement, parameters, state, torque)
    torque[0], torque[1], torque[2] = rotated(error.pose, triple(torque))
