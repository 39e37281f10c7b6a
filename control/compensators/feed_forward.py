r"""Feed-forward of friction and inertia torques of the nominal model.

Both torques are computed along the reference that the law receives (after the governor, if there is one):

- *friction*: a share of ``(viscous + coulomb / √(q̇² + smoothing²)) q̇``, as in the plant. A share below 1
  avoids overcompensation if the nominal friction is too high by some percent.
- *inertia*: a share of ``M̂(q) q̈ + Ĉ(q, q̇) q̇``, for a law that does not use the acceleration itself. It
  turns the governor's bounded acceleration into a pulse of torque.

*Applied torque.* The law does not see the feed-forward: the torque fed forward, delayed by the nominal delay,
is subtracted from the applied torque. The law's balance of its own torque stays closed, for back-calculation
and for an observer. An observer of the load then estimates the remaining friction.

*Benefit.* The study `compensators` measures it on the prototype's tilt, with and without a governor.
"""

from __future__ import annotations

from math import sqrt
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.control.applied_torque import split_delay
from spheretwin.control.law import NonNegativeEach, each
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.state import delayed_mean, push
from spheretwin.models.kinematics import triple, turns
from spheretwin.models.lagrangian import coriolis_rows, inertia_entries

Array = NDArray[np.float64]


class FeedForwardSection(BaseModel):
    """Feed-forward of nominal torques; off if all shares are 0."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    friction: NonNegativeEach = Field(
        each(0.0), description="share of the nominal friction at the reference's rate that is fed forward"
    )
    inertia: NonNegativeEach = Field(
        each(0.0),
        description="share of the nominal torque for the reference's acceleration that is fed forward; 0 for"
        " a law that does so itself",
    )
    smoothing_rad_s: Annotated[float, Field(ge=1e-9, le=1e3)] = Field(
        0.01, description="rate over which the friction fed forward changes sign, rad/s"
    )

    @property
    def on(self) -> bool:
        """True if any share is above 0."""
        return any(self.friction) or any(self.inertia)


class FeedForward(NamedTuple):
    """Feed-forward of a run, for compiled code."""

    on: bool
    share: Array  # (3,) of the inertial torque
    inertia: Array  # (3,) kg·m², nominal
    coulomb_Nm: Array  # (3,) share of the nominal
    viscous_Nm_s: Array  # (3,) likewise
    smoothing_rad_s: float
    fraction: float  # share of a period in which the older torque acts
    history: Array  # (n + 2, 3) N·m, torques fed forward, newest first
    torque_q: Array  # (3,) N·m, in this tick

    def state_arrays(self) -> tuple[Array, ...]:
        """Return the arrays that hold the state."""
        return self.history, self.torque_q


class NominalRotor(NamedTuple):
    """Nominal inertia and friction of the rotor."""

    inertia: Array  # (3,) kg·m²
    coulomb_Nm: Array  # (3,)
    viscous_Nm_s: Array  # (3,)


def feed_forward(
    section: FeedForwardSection, rotor: NominalRotor, period_s: float, delay_s: float
) -> FeedForward:
    """Return the feed-forward before the first tick.

    Parameters
    ----------
    section : FeedForwardSection
    rotor : NominalRotor
    period_s, delay_s : float, s
        Control period, and the delay that the law receives.
    """
    whole, fraction = split_delay(delay_s, period_s)
    return FeedForward(
        on=section.on,
        share=np.array(section.inertia),
        inertia=rotor.inertia,
        coulomb_Nm=np.array(section.friction) * rotor.coulomb_Nm,
        viscous_Nm_s=np.array(section.friction) * rotor.viscous_Nm_s,
        smoothing_rad_s=section.smoothing_rad_s,
        fraction=fraction,
        history=np.zeros((whole + 2, 3)),
        torque_q=np.zeros(3),
    )


@allocation_free
def subtract_feed_forward(feed: FeedForward, torque_q: Array) -> None:
    """Subtract the torque fed forward from the applied torque (N·m) of the last period."""
    for i in range(3):
        torque_q[i] -= delayed_mean(feed.history, i, feed.fraction)


@allocation_free
def compute_feed_forward(feed: FeedForward, reference: Array) -> None:
    """Compute the feed-forward torque of this tick and store it in the history.

    Parameters
    ----------
    feed : FeedForward
        Changed in place.
    reference : (3, 3) array
        Angle, rate and acceleration as rows.
    """
    q, v, a = triple(reference[0]), triple(reference[1]), triple(reference[2])
    pose_turns, moments = turns(q), triple(feed.inertia)
    M, C = inertia_entries(pose_turns, moments), coriolis_rows(pose_turns, v, moments)
    inertial = (
        M.alpha * a[0] + M.alpha_beta * a[1] + M.alpha_gamma * a[2],
        M.alpha_beta * a[0] + M.beta * a[1],
        M.alpha_gamma * a[0] + M.gamma * a[2],
    )
    for i in range(3):
        k = feed.viscous_Nm_s[i] + feed.coulomb_Nm[i] / sqrt(v[i] ** 2 + feed.smoothing_rad_s**2)
        coriolis = C[i][0] * v[0] + C[i][1] * v[1] + C[i][2] * v[2]
        feed.torque_q[i] = k * v[i] + feed.share[i] * (inertial[i] + coriolis)
        push(feed.history, i, feed.torque_q[i])
