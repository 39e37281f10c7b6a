"""Friction of a hinge: our stage, and MuJoCo's own friction loss and damping, each against ideal friction.

A slow ramp of torque to above the Coulomb level and back tells how each sticks and breaks away; coasting
tells how each slides and stops. Every bound is what the model itself makes of ideal friction: our stage is
late by its smoothing and by its error of second order, MuJoCo's by the softness of its constraint.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from math import asinh, hypot, isfinite, log, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.crosscheck.hinge import (
    GAMMA,
    PUSH,
    Bearing,
    Hinge,
    Mover,
    RAMP_s,
    START_rad_s,
    STEP_s,
    breakaway_rate_rad_s,
    by_mujoco,
    by_stage,
    inertia_torque_Nm,
    latest_breakaway_Nm,
    run,
    slope_Nm_s,
)
from spheretwin.crosscheck.scale import scale_of
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.checks import Check
from spheretwin.scenario.hardware import PROTOTYPE_BEARINGS
from spheretwin.scenario.plant_sections import PlantSection

Array = NDArray[np.float64]

# The prototype's bearing, and the heavier of the two guesses that its figure is the lighter of; those of a
# machine are in proportion to its inertia.
LEVELS_Nm: tuple[float, ...] = (PROTOTYPE_BEARINGS["plant.coulomb_Nm"][GAMMA], 5e-3)
VISCOUS_Nm_s: float = PROTOTYPE_BEARINGS["plant.viscous_Nm_s"][GAMMA]
SMOOTHING_rad_s: float = PlantSection.model_fields["friction_smoothing_rad_s"].default

REST_rad_s = 1e-3 * START_rad_s  # what is called rest
VISCOUS_s = 2.0  # of coasting under viscous friction alone

OURS, MUJOCO = "our stage", "MuJoCo"
HALVES = {OURS: 2, MUJOCO: 1}  # parts of a step in which friction acts
_EPSILON = float(np.finfo(np.float64).eps)


class HingeFriction(NamedTuple):
    """Checks, and the runs they were taken from, by bearing."""

    checks: list[Check]
    bearings: dict[str, Bearing]


def compare(mjcf: Path, actuator: Actuator) -> HingeFriction:
    """Run every bearing both ways.

    Parameters
    ----------
    mjcf : Path
        Model file that the engine reads.
    actuator : Actuator
        Its inertia is the hinge's: J3 of the upright rotor.
    """
    movers: dict[str, Mover] = {
        OURS: lambda *motion: by_stage(actuator, *motion),
        MUJOCO: lambda *motion: by_mujoco(mjcf, actuator, *motion),
    }
    inertia, share = float(actuator.inertia[GAMMA]), scale_of(actuator).inertia
    viscous = share * VISCOUS_Nm_s
    bearings = {
        f"{1e3 * share * level:.4g} mN·m": run(
            Hinge(inertia, share * level, viscous, SMOOTHING_rad_s), movers
        )
        for level in LEVELS_Nm
    }
    checks = [
        _worst(figure(way, name, bearing) for name, bearing in bearings.items())
        for figure in (_creep, _breakaway, _stopping_time, _stopping_angle)
        for way in movers
    ]
    alone = Hinge(inertia, 0.0, viscous, SMOOTHING_rad_s)
    return HingeFriction(
        [
            *checks,
            _worst(_sliding(name, bearing) for name, bearing in bearings.items()),
            *(_viscous(way, move, alone) for way, move in movers.items()),
        ],
        bearings,
    )


_HELD: dict[str, Callable[[Hinge, Array], Array]] = {OURS: Hinge.stage_Nm, MUJOCO: Hinge.mujoco_Nm}
_CREEP = {
    OURS: "T = J/h (P⁻¹(v) - P(v)) with the rate P(v) that half a step leaves, v = smoothing T/√(level² - T²)"
    " in the limit of a small step",
    MUJOCO: "v = (1 - d) T/(d b J) of its soft constraint (impedance d, reference damping b)",
}


def _creep(way: str, name: str, bearing: Bearing) -> Check:
    hinge, rate = bearing.hinge, bearing.creep_rad_s[way]
    detail = {f"{name}: rad/s": rate}
    if way == OURS:
        limit = hinge.smoothing_rad_s * PUSH / sqrt(1 - PUSH**2)
        detail[f"{name}: limit of a small step, rad/s"] = limit
    return Check(
        name=f"friction: creep, {way}",
        compares=f"γ pushed by {PUSH:g} of the Coulomb level, where ideal friction holds: torque that creeps"
        f" at the rate v found, by {_CREEP[way]}, with that applied, relative",
        states=bearing.settling,
        value=abs(float(_HELD[way](hinge, np.array(rate))) / (PUSH * hinge.coulomb_Nm) - 1),
        bound=1e-15 * (10 + hinge.relaxation_s() / STEP_s),
        why="the formula is exact for any step; rounding, 2e-16 a step, of the steps that are not forgotten,"
        " which are as many as there are in the relaxation time J/k(0) or 1/(d b), with a margin of five",
        detail=detail,
    )


def _breakaway(way: str, name: str, bearing: Bearing) -> Check:
    hinge, ramp = bearing.hinge, bearing.ramp
    level, rate, rise = hinge.coulomb_Nm, breakaway_rate_rad_s(hinge), slope_Nm_s(hinge) * STEP_s
    before = np.linspace(0.0, rate, 1001)
    earliest = np.max(_HELD[way](hinge, before) + inertia_torque_Nm(hinge, rate - before))
    passed = _torque_at(rate, ramp.torque_Nm, ramp.rates_rad_s[way])
    return Check(
        name=f"friction: breakaway, {way}",
        compares=f"torque of a ramp (level in {RAMP_s:g} s) at which γ is ten times faster than friction's"
        " smoothing, or than MuJoCo's creep at the level, over the Coulomb level",
        states=len(ramp.torque_Nm),
        value=passed / level,
        bound=(latest_breakaway_Nm(hinge) + rise) / level,
        at_least=(float(earliest) - rise) / level,
        why="not after ideal friction, which takes √(2 J v dT/dt) above the level to reach the rate v; not"
        " before a hinge that crept up to any lower rate, and from there on met no more friction than there",
        detail={
            f"{name}: N·m": passed,
            f"{name}: ideal, N·m": _torque_at(rate, ramp.torque_Nm, ramp.ideal_rad_s),
            f"{name}: at the rate, rad/s": rate,
        },
    )


def _torque_at(rate_rad_s: float, torque_Nm: Array, rates_rad_s: Array) -> float:
    passed = rates_rad_s >= rate_rad_s
    return float(torque_Nm[np.argmax(passed)]) if np.any(passed) else float("nan")


_LATE = {
    OURS: "late by what the level lacks, 1 - v/√(v² + smoothing²) of it, summed up over the motion, and by"
    " the error of the stage: r² h/2 at most while half a step takes the share r of the rate, which sums up"
    " to r h/2, and two steps for the rest",
    MUJOCO: "below level/(d b J) its soft constraint no longer brakes by the level, but exponentially at d b",
}


def _stopping_time(way: str, name: str, bearing: Bearing) -> Check:
    hinge, coast = bearing.hinge, bearing.coast
    ideal = hinge.ideal_time_s(START_rad_s, REST_rad_s)
    stopped = float(coast.t_s[np.argmax(coast.motions[way].qdot_rad_s <= REST_rad_s)])
    return Check(
        name=f"friction: stopping time, {way}",
        compares=f"γ coasting from {START_rad_s:g} rad/s to a thousandth of that: time, with the exact"
        " solution under ideal Coulomb and viscous friction",
        states=len(coast.t_s),
        value=abs(stopped - ideal),
        bound=_late_s(way, hinge, REST_rad_s) + STEP_s,
        why=f"{_LATE[way]}; and a step, the grain of the time",
        unit="s",
        detail={f"{name}: s": stopped, f"{name}: ideal, s": ideal},
    )


def _late_s(way: str, hinge: Hinge, to_rad_s: float) -> float:
    """Return the delay of the hinge at a rate, compared with ideal friction."""
    if way == OURS:
        lacking = _lacking_rad_s(hinge, START_rad_s) - _lacking_rad_s(hinge, to_rad_s)
        error = STEP_s * min(0.5 * hinge.stage_loss_rad_s() / to_rad_s, 2.0)
        return error + hinge.inertia_kgm2 / hinge.coulomb_Nm * lacking
    grip = max(min(hinge.mujoco_grip_rad_s(), START_rad_s), to_rad_s)
    return log(grip / to_rad_s) / hinge.mujoco_relaxation_1_s() - hinge.ideal_time_s(grip, to_rad_s)


def _lacking_rad_s(hinge: Hinge, rate_rad_s: float) -> float:
    """An integral of √(1 + (smoothing/v)²) - 1 over the rate v."""
    smoothing = hinge.smoothing_rad_s
    return hypot(rate_rad_s, smoothing) - rate_rad_s - smoothing * asinh(smoothing / rate_rad_s)


def _stopping_angle(way: str, name: str, bearing: Bearing) -> Check:
    hinge, coast = bearing.hinge, bearing.coast
    ideal, turned = hinge.ideal_angle_rad(START_rad_s), float(coast.motions[way].q_rad[-1])
    return Check(
        name=f"friction: stopping angle, {way}",
        compares=f"γ coasting from {START_rad_s:g} rad/s until nothing is left: angle, with the exact"
        " solution under ideal Coulomb and viscous friction",
        states=len(coast.t_s),
        value=abs(turned - ideal),
        bound=_far_rad(way, hinge),
        why=_LATE[way],
        unit="rad",
        detail={f"{name}: rad": turned, f"{name}: ideal, rad": ideal},
    )


def _far_rad(way: str, hinge: Hinge) -> float:
    """Return the additional angle of the hinge until it rests, compared with ideal friction."""
    if way == OURS:
        v, smoothing = START_rad_s, hinge.smoothing_rad_s
        # The integral of √(v² + smoothing²) - v over the rate.
        lacking = 0.5 * (v * hypot(v, smoothing) + smoothing**2 * asinh(v / smoothing) - v**2)
        loss = hinge.stage_loss_rad_s()  # the delay at each rate, summed up, and two steps at the loss
        error = STEP_s * min(loss, v) * (2.0 + 0.5 * log(1 + v / loss))
        return error + hinge.inertia_kgm2 / hinge.coulomb_Nm * lacking
    grip = min(hinge.mujoco_grip_rad_s(), START_rad_s)
    # The force has a corner within a step, which RK4 does not see.
    corner = STEP_s**2 * (hinge.coulomb_Nm + hinge.viscous_Nm_s * grip) / hinge.inertia_kgm2
    return grip / hinge.mujoco_relaxation_1_s() - hinge.ideal_angle_rad(grip) + corner


def _sliding(name: str, bearing: Bearing) -> Check:
    hinge, motions = bearing.hinge, bearing.coast.motions
    slowest = min(max(breakaway_rate_rad_s(hinge), hinge.mujoco_grip_rad_s()), START_rad_s)
    slides = motions[MUJOCO].qdot_rad_s >= slowest
    apart = np.abs(motions[OURS].qdot_rad_s - motions[MUJOCO].qdot_rad_s)[slides]
    deceleration = (hinge.coulomb_Nm + hinge.viscous_Nm_s * START_rad_s) / hinge.inertia_kgm2
    return Check(
        name="friction: sliding",
        compares="γ coasting, our stage with MuJoCo as long as both slide: largest difference of the rate",
        states=len(apart),
        value=float(np.max(apart)),
        bound=deceleration * _late_s(OURS, hinge, slowest) + len(apart) * _EPSILON * START_rad_s,
        why="the largest deceleration times what our stage is late by, as in its stopping time; MuJoCo brakes"
        " by the level itself",
        unit="rad/s",
        detail={f"{name}: rad/s": float(np.max(apart))},
    )


def _viscous(way: str, move: Mover, hinge: Hinge) -> Check:
    count = round(VISCOUS_s / STEP_s)
    share = hinge.viscous_Nm_s * STEP_s / hinge.inertia_kgm2
    steps = np.arange(count + 1, dtype=np.float64)
    exact = START_rad_s * np.exp(-share * steps)
    truncation = {
        OURS: float(np.max(exact * np.expm1((0.5 * share) ** 3 / 3 * steps))),
        MUJOCO: count * START_rad_s * share**5 / 120,
    }
    why = {
        OURS: "half a step leaves 1/(1 + x + x²/2) of the rate, x = viscous h/2J, which is exp(-x) times"
        " exp(x³/6) at most; and rounding, 2e-16 in each half of a step",
        MUJOCO: "rounding, 2e-16 a step, and truncation of RK4, x⁵/120 a step at x = viscous h/J",
    }
    return Check(
        name=f"friction: viscous alone, {way}",
        compares=f"γ coasting for {VISCOUS_s:g} s from {START_rad_s:g} rad/s under viscous friction (in"
        " MuJoCo, damping) alone: rate, with the exact decay",
        states=count,
        value=float(np.max(np.abs(move(hinge, START_rad_s, np.zeros(count)).qdot_rad_s - exact))),
        bound=truncation[way] + HALVES[way] * count * _EPSILON * START_rad_s,
        why=why[way],
        unit="rad/s",
    )


def _worst(checks: Iterable[Check]) -> Check:
    """Return the check that takes up most of its bound, with the figures and the states of all."""
    every = list(checks)
    figures = {name: figure for each in every for name, figure in each.detail.items()}
    return replace(max(every, key=_share), detail=figures, states=sum(each.states for each in every))


def _share(check: Check) -> float:
    """Value over bound, or least value over value where that is more; endless without a number."""
    value, bound = float(check.value or 0), float(check.bound or 0)
    share = max(value / bound, check.at_least / value if check.at_least is not None else 0.0)
    return share if isfinite(value) and isfinite(share) else float("inf")
