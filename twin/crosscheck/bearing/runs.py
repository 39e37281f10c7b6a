"""Runs of a hinge with friction: a slow ramp of torque, coasting to rest, a push below the level."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.twin.crosscheck.bearing.hinge import Hinge, STEP_s
from spheretwin.twin.crosscheck.bearing.moving import Motion, Mover

Array = NDArray[np.float64]

RAMP_s = 5.0  # from nothing to the level
START_rad_s = 2.0
PUSH = 0.5  # share of the level
SETTLING = 60  # relaxation times at rest: half a level makes them 1.54 times as long, and leaves exp(-39)


class Ramp(NamedTuple):
    """A slow ramp of torque up and back, from rest; a row a step."""

    torque_Nm: Array  # (n,) held over the step
    rates_rad_s: dict[str, Array]  # (n,) at its end
    ideal_rad_s: Array  # (n,)


class Coast(NamedTuple):
    """Coasting to rest; a row a step."""

    t_s: Array  # (n,)
    motions: dict[str, Motion]
    ideal_rad_s: Array  # (n,)


class Bearing(NamedTuple):
    """All runs of one bearing."""

    hinge: Hinge
    ramp: Ramp
    coast: Coast
    creep_rad_s: dict[str, float]  # pushed by `PUSH`
    settling: int  # steps until it was taken


def run(hinge: Hinge, movers: Mapping[str, Mover]) -> Bearing:
    """All runs of one bearing.

    Parameters
    ----------
    hinge : Hinge
    movers : mapping of str to Mover
        By name.
    """
    settling = ceil(SETTLING * hinge.relaxation_s() / STEP_s)
    push = np.full(settling, PUSH * hinge.coulomb_Nm)
    creep = {name: float(move(hinge, 0.0, push).qdot_rad_s[-1]) for name, move in movers.items()}
    return Bearing(hinge, _ramp(hinge, movers), _coast(hinge, movers, settling), creep, settling)


def _ramp(hinge: Hinge, movers: Mapping[str, Mover]) -> Ramp:
    up = ramp_up(hinge)
    torque = np.concatenate([up, up[-2::-1]])
    rates = {name: move(hinge, 0.0, torque).qdot_rad_s[1:] for name, move in movers.items()}
    return Ramp(torque, rates, ideal_ramp(hinge, len(up)))


def _coast(hinge: Hinge, movers: Mapping[str, Mover], settling: int) -> Coast:
    still = np.zeros(ceil(hinge.ideal_time_s(START_rad_s) / STEP_s) + settling)
    motions = {name: move(hinge, START_rad_s, still) for name, move in movers.items()}
    t_s = STEP_s * np.arange(len(still) + 1, dtype=np.float64)
    return Coast(t_s, motions, hinge.ideal_coast_rad_s(t_s, START_rad_s))


def breakaway_rate_rad_s(hinge: Hinge) -> float:
    """Rate that is called sliding: ten times whatever either way creeps at, or loses in one step."""
    step = STEP_s * hinge.coulomb_Nm / hinge.inertia_kgm2
    return 10 * max(hinge.smoothing_rad_s, step, hinge.coulomb_Nm / hinge.mujoco_soft_Nm_s())


def slope_Nm_s(hinge: Hinge) -> float:
    """Rate of the ramp."""
    return hinge.coulomb_Nm / RAMP_s


def inertia_torque_Nm(hinge: Hinge, rates_rad_s: Array | float) -> Array:
    """How far a ramp gets above what holds the hinge until the hinge has gained a rate."""
    above: Array = np.sqrt(2 * hinge.inertia_kgm2 * slope_Nm_s(hinge) * np.asarray(rates_rad_s))
    return above


def latest_breakaway_Nm(hinge: Hinge) -> float:
    """Torque at which a hinge that is held by no more than ideal friction slides at the latest."""
    rate = breakaway_rate_rad_s(hinge)
    return hinge.coulomb_Nm + hinge.viscous_Nm_s * rate + float(inertia_torque_Nm(hinge, rate))


def ramp_up(hinge: Hinge) -> Array:
    """(n,) torque of the rising half: twice as far above the level as breaking away can take."""
    peak = hinge.coulomb_Nm + 2 * (latest_breakaway_Nm(hinge) - hinge.coulomb_Nm)
    rise = slope_Nm_s(hinge) * STEP_s
    return rise * np.arange(1, ceil(peak / rise) + 1, dtype=np.float64)


def ideal_ramp(hinge: Hinge, rising: int) -> Array:
    """(2n - 1,) rate under ideal friction after each step of a ramp up and back: at rest, sliding, at rest.

    Sliding is linear, ``J dv/dt = T - coulomb - viscous v``, and has a closed form on either side.
    """
    time = hinge.inertia_kgm2 / hinge.viscous_Nm_s
    slope = slope_Nm_s(hinge)

    def sliding(t: Array, above_Nm: float, slope_Nm_s: float, from_rad_s: float) -> Array:
        gone = -np.expm1(-t / time)
        pushed = above_Nm * gone + slope_Nm_s * (t - time * gone)
        rate: Array = from_rad_s * (1 - gone) + pushed / hinge.viscous_Nm_s
        return rate

    t = STEP_s * np.arange(1, rising + 1, dtype=np.float64)
    begun = hinge.coulomb_Nm / slope
    up = np.where(t > begun, sliding(np.maximum(t - begun, 0), 0.0, slope, 0.0), 0.0)
    above = slope * t[-1] - hinge.coulomb_Nm
    down = sliding(t[:-1], above, -slope, float(up[-1]))
    return np.concatenate([up, np.where(np.cumsum(down <= 0) > 0, 0.0, down)])
