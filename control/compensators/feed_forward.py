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
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.control.applied_torque import split_delay
from spheretwin.control.law import NonNegativeEach, each
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free
from spheretwin.models.base.history import delayed_mean, push
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.kinematics import triple, turns
from spheretwin.models.lagrangian import coriolis_rows, inertia_entries


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


class FeedForward(Record):
    """Feed-forward of a run."""

    on: bool = field("whether the feed-forward is on")
    share: Array = field("share of the inertial torque", "", 3)
    inertia: Array = field("nominal", "kg·m²", 3)
    coulomb_Nm: Array = field("share of the nominal Coulomb friction", "N·m", 3)
    viscous_Nm_s: Array = field("share of the nominal viscous friction", "N·m·s", 3)
    smoothing_rad_s: float = field("rate over which the friction changes sign", "rad/s")
    due: int = field("row of the history that acts at the end of a period: whole periods of the delay")
    fraction: float = field("share of a period in which the older torque acts")
    history: Array = field("torques fed forward, newest first", "N·m", ("delays", 3), state=True)
    torque_q: Array = field("torque fed forward in this tick", "N·m", 3, state=True)


class NominalRotor(NamedTuple):
    """Nominal inertia and friction of the rotor."""

    inertia: ArrayLike  # (3,) kg·m²
    coulomb_Nm: ArrayLike  # (3,)
    viscous_Nm_s: ArrayLike  # (3,)


def fill_feed_forward(
    rows: Rows, section: FeedForwardSection, rotor: NominalRotor, period_s: float, delay_s: float
) -> None:
    """Fill feed-forwards before the first tick.

    Parameters
    ----------
    rows : rows of `FeedForward`
    section : FeedForwardSection
    rotor : NominalRotor
    period_s, delay_s : float, s
        Control period, and the delay that the law receives.
    """
    due, fraction = split_delay(delay_s, period_s)
    put(rows, on=section.on, share=section.inertia, inertia=rotor.inertia, due=due, fraction=fraction)
    put(rows, coulomb_Nm=np.multiply(section.friction, rotor.coulomb_Nm))
    put(rows, viscous_Nm_s=np.multiply(section.friction, rotor.viscous_Nm_s))
    put(rows, smoothing_rad_s=section.smoothing_rad_s)


@allocation_free
def subtract_feed_forward(feed: FeedForward, torque_q: Array) -> None:
    """Subtract the torque fed forward from the applied torque (N·m) of the last period."""
    for i in range(3):
        torque_q[i] -= delayed_mean(feed.history, feed.due, i, feed.fraction)


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
