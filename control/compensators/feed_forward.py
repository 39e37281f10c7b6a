r"""Torque that a law need not find out by its error: friction and inertia of the nominal model, fed forward.

Both are taken along the reference that the law is handed, governed where there is a governor:

- *friction*: a share of ``(viscous + coulomb / √(q̇² + smoothing²)) q̇``, as the plant has it. Less than all of
  it cannot overcompensate where the nominal friction is too high by some percent.
- *inertia*: a share of ``M̂(q) q̈ + Ĉ(q, q̇) q̇``, for a law that makes no use of the acceleration itself. It
  makes the governor's bounded acceleration a pulse of torque.

*What a law is told of it.* Nothing: what was fed forward is taken off the torque that the controller believes
its currents gave, as old as the known delay makes it. A law's account of its own torque thus closes, be it
for back-calculation or for an observer: what an observer of the load then finds is the friction that is left.

*What it is worth.* The study `compensators` measures it on the prototype's tilt, with and without a governor.
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
from spheretwin.models.lagrangian import coriolis_rows, inertia_entries, triple, turns

Array = NDArray[np.float64]


class FeedForwardSection(BaseModel):
    """Nominal torques that are fed forward; off at shares of 0."""

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
        """Whether anything is fed forward."""
        return any(self.friction) or any(self.inertia)


class FeedForward(NamedTuple):
    """Feed-forward of a run, for compiled code."""

    on: bool
    share: Array  # (3,) of the inertial torque
    inertia: Array  # (3,) kg·m², nominal
    coulomb_Nm: Array  # (3,) share of the nominal
    viscous_Nm_s: Array  # (3,) likewise
    smoothing_rad_s: float
    fraction: float  # share of a period in which the older torque still acts
    history: Array  # (n + 2, 3) N·m, what was fed forward, newest first
    torque_q: Array  # (3,) N·m, in this tick

    def state_arrays(self) -> tuple[Array, ...]:
        """Arrays that it goes on from."""
        return self.history, self.torque_q


class NominalRotor(NamedTuple):
    """What is fed forward is reckoned with."""

    inertia: Array  # (3,) kg·m²
    coulomb_Nm: Array  # (3,)
    viscous_Nm_s: Array  # (3,)


def feed_forward(
    section: FeedForwardSection, rotor: NominalRotor, period_s: float, delay_s: float
) -> FeedForward:
    """Feed-forward before the first tick.

    Parameters
    ----------
    section : FeedForwardSection
    rotor : NominalRotor
    period_s, delay_s : float, s
        Control period, and the delay that the law is told of.
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
    """Take what was fed forward off the torque (N·m) that is believed of the last period."""
    last = feed.history.shape[0] - 1
    for i in range(3):
        torque_q[i] -= (
            feed.fraction * feed.history[last, i] + (1.0 - feed.fraction) * feed.history[last - 1, i]
        )


@allocation_free
def compute_feed_forward(feed: FeedForward, reference: Array) -> None:
    """Reckon the torque of this tick.

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
        for row in range(feed.history.shape[0] - 1, 0, -1):
            feed.history[row, i] = feed.history[row - 1, i]
        feed.history[0, i] = feed.torque_q[i]
