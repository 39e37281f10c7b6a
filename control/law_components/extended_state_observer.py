r"""Extended state observer: angle, rate and disturbance torque from the measured angle and applied torque.

*Model.* The disturbance d is the torque that the nominal rotor does not explain: load, friction, and the
effect of an inertia other than the nominal one. With the torque τ of the last period,

    M̂ q̈ + Ĉ q̇ = τ + d,      d constant over a period.

*Observer.* Once a period T: predict (z₁, z₂) with τ + d̂, and correct by the innovation i = y − z₁,

    z₁ += l₁ i,      z₂ += l₂ i,      d̂ += M̂ l₃ i.

*Gains.* With ε = (z₁ − q, z₂ − q̇, M̂⁻¹ (d̂ − d)), on the exact model and to first order in ε, ε⁺ = F ε where
F = (1 − l e₁ᵀ) A and A is the matrix of a triple integrator over T. Its characteristic polynomial is
(z − a)² (z − b), a = e^(−ω_o T), b = e^(−ω_d T), for

    l₁ = 1 − a² b,   l₃ = (1 − a)² (1 − b)/T²,   l₂ = (3 − 2a − b − l₁ − ½ l₃ T²)/T.

*Error at the ticks.* Only the rate of d drives it, ν = M̂⁻¹ ḋ. Over one period, with s the remaining time,
ε⁺ = F ε − (1 − l e₁ᵀ) ∫ (s²/2, s, 1) ν ds, so that a constant load leaves no error. The response of each
component to a step of d at any instant has one sign: d̂ follows it without overshoot, as l₃ times c₀ z² + c₁
z + c₂ and a power of z over the polynomial, with 2c₀ = s², 2c₁ = T² + 2Ts − 2s² and 2c₂ = (T − s)², none
below 0; the innovation is d̂'s step over l₃; for the rate the tests check it for all a, b and s. The sum of
magnitudes is then the error under a steady rise, where l₃ i = T ν. With p = 1/(1 − a) and r = 1/(1 − b) and
for any d with |ν| ≤ N, apart from the decaying initial error,

    |ε| ≤ N (T³ a² b p² r, T² (p² + 2pr − 3p − 3r/2 + 11/6), T (2p + r − 2)).

No smaller factors hold: the steady rise attains all three. If d is constant over each period and changes by
at most N T from one to the next, ε⁺ = F ε − e₃ T ν, and the factors that a staircase attains are

    |ε| ≤ N (T³ a² b p² r, T² (p² + 2pr − 3p − 3r/2 + 7/4), T (2p + r − 3/2)).

Both are for a fixed ω_d, the exact model and a first order in ε. For T → 0 both are
N (1/(ω_o² ω_d), (2 ω_o + ω_d)/(ω_o² ω_d), 2/ω_o + 1/ω_d).

*Schedule.* ω_d may change arbitrarily from tick to tick. The left eigenvectors of the double pole a,
e₁ᵀA (A − a)⁻¹ and e₁ᵀA (A − a)⁻², do not depend on b: in their coordinates F is triangular for all b at once,
with a, a and b on its diagonal, a cascade whose error decays as that of its slowest ω_d, or faster.
"""

from math import exp
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.applied_torque import split_delay
from spheretwin.control.law import NominalModel
from spheretwin.control.law_components.nominal_motion import (
    RotorModel,
    RotorMotion,
    advance_motion,
    inertial_torque,
)
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.history import delayed_mean, push
from spheretwin.models.kinematics import Triple


class ObserverGains(NamedTuple):
    """Observer gains of one axis."""

    of_angle: float  # l1
    of_rate: float  # l2, 1/s
    of_acceleration: float  # l3, 1/s²


class ObserverState(NamedTuple):
    """State of the observer."""

    motion: RotorMotion
    disturbance: Triple  # d̂, N·m


@allocation_free
def observer_gains(
    bandwidth_rad_s: float, disturbance_bandwidth_rad_s: float, period_s: float
) -> ObserverGains:
    """Return gains with two poles at the first bandwidth and one at the second.

    Parameters
    ----------
    bandwidth_rad_s, disturbance_bandwidth_rad_s : float, rad/s
        ω_o and ω_d; with ω_d = 0 no disturbance is estimated.
    period_s : float, s
    """
    a, b = exp(-bandwidth_rad_s * period_s), exp(-disturbance_bandwidth_rad_s * period_s)
    of_angle = 1.0 - a * a * b
    of_acceleration = (1.0 - a) ** 2 * (1.0 - b) / period_s**2
    of_rate = (3.0 - 2.0 * a - b - of_angle - 0.5 * of_acceleration * period_s**2) / period_s
    return ObserverGains(of_angle, of_rate, of_acceleration)


@allocation_free
def observe(
    before: ObserverState,
    angle: Triple,
    torque: Triple,
    gains: tuple[ObserverGains, ObserverGains, ObserverGains],
    nominal: RotorModel,
    period_s: float,
) -> ObserverState:
    """Return the state of the observer one period later.

    Parameters
    ----------
    before : ObserverState
    angle : (3,) rad
        Measured now.
    torque : (3,) N·m
        Of the coils over the period.
    gains : ObserverGains of each axis
    nominal : RotorModel
    period_s : float, s
    """
    alpha, beta, gamma = gains
    predicted = advance_motion(before.motion, _sum(torque, before.disturbance), nominal, period_s)
    (q1, q2, q3), (v1, v2, v3) = predicted.angle, predicted.rate
    i1, i2, i3 = angle[0] - q1, angle[1] - q2, angle[2] - q3
    corrected = (q1 + alpha.of_angle * i1, q2 + beta.of_angle * i2, q3 + gamma.of_angle * i3)
    rate = (v1 + alpha.of_rate * i1, v2 + beta.of_rate * i2, v3 + gamma.of_rate * i3)
    unexplained = (alpha.of_acceleration * i1, beta.of_acceleration * i2, gamma.of_acceleration * i3)
    learnt = inertial_torque(corrected, unexplained, nominal)
    return ObserverState(RotorMotion(corrected, rate), _sum(before.disturbance, learnt))


@allocation_free
def _sum(x: Triple, y: Triple) -> Triple:
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


def history_layout(known: NominalModel) -> tuple[float, int]:
    """Return the share of a period in which the older command acts, and the size of the command history.

    The history holds commanded torques, three numbers a tick, newest first.
    """
    whole, fraction = split_delay(known.delay_s, known.period_s)
    return fraction, 3 * (whole + 2)


@allocation_free
def delayed_command(history: NDArray[np.float64], axis: int, fraction: float) -> float:
    """Return the torque (N·m) on an axis that was commanded for the last period."""
    rows = history.reshape((-1, 3))
    return delayed_mean(rows, rows.shape[0] - 2, axis, fraction)


@allocation_free
def store_command(history: NDArray[np.float64], torque: NDArray[np.float64]) -> None:
    """Store the torque (3,) that is commanded now."""
    for axis in range(3):
        push(history.reshape((-1, 3)), axis, torque[axis])
