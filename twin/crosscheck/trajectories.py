"""Motion under given torques: the engine's steps against an integrator of a much higher order.

The torques are those of the nutation, but held over pieces of 10 ms, the same in both: MuJoCo keeps an
applied force over a whole step, so a torque that varied within the steps would measure that hold and not
the engine.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

from spheretwin.crosscheck.equations import Equations, equations_of
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.checks import Check
from spheretwin.models.base.errors import EngineError
from spheretwin.models.mjcf import read
from spheretwin.plant import lagrangian_rotor
from spheretwin.plant.lagrangian_rotor import LagrangianRotor
from spheretwin.plant.mass_properties import true_model
from spheretwin.plant.mujoco_rotor import MujocoRotor
from spheretwin.trajectories.shapes import Nutation

DURATION_s = 5.0
HOLD_s = 0.01
STEP_s = 5e-4  # the default physics step
STEPS_s = (1e-2, 5e-3, 2.5e-3, 2e-3, 1e-3)  # whole fractions of the hold

BOUND_rad = 1e-8
# implicitfast is not among them: without damping in the model it is Euler, digit for digit.
ORDERS = {"RK4": 4, "Euler": 1}
ORDER_MARGIN = 0.2
LARGEST_ERROR_rad, MOST_HALVINGS = 0.04, 5
OWN = "our own RK4"


class HeldTorques(NamedTuple):
    """Torques held one after another, from a given start."""

    start: Array  # (6,) rad and rad/s
    torque: Array  # (n, 3) N·m on the hinges


class Convergence(NamedTuple):
    """Largest error of a method at each step, and its order by regression."""

    steps_s: Array
    errors_rad: Array
    order: float


class Trajectories(NamedTuple):
    """Checks, and what they were taken from."""

    checks: list[Check]
    t_s: Array  # (n + 1,) ends of the pieces
    q_rad: Array  # (n + 1, 3) by the engine
    difference_rad: Array  # (n + 1, 3) engine less reference
    convergence: dict[str, Convergence]


def compare_trajectories(mjcf: Path, actuator: Actuator) -> Trajectories:
    """Compare whole motions, and measure orders of convergence.

    Parameters
    ----------
    mjcf : Path
        Model file that the engine reads.
    actuator : Actuator
        Its inertia is what the Lagrangian has.
    """
    motion = equations_of(mjcf, actuator)
    pieces = nutation_pieces(motion)
    reference = integrate(pieces, motion)
    engine = by_mujoco(mjcf, pieces, "RK4", STEP_s)
    difference = engine[:, :3] - reference[:, :3]
    methods: dict[str, Callable[[float], Array]] = {
        f"MuJoCo {name}": partial(by_mujoco, mjcf, pieces, name) for name in ORDERS
    }
    methods[OWN] = partial(by_own_steps, motion, pieces)
    measured = {name: convergence(method, reference) for name, method in methods.items()}
    orders = {f"MuJoCo {name}": order for name, order in ORDERS.items()} | {OWN: 4}
    return Trajectories(
        [
            _trajectory(difference, motion.neglected),
            *(_order(name, measured[name], orders[name]) for name in methods),
        ],
        HOLD_s * np.arange(len(reference), dtype=np.float64),
        engine[:, :3],
        difference,
        measured,
    )


def nutation_pieces(motion: Equations) -> HeldTorques:
    """Torques that follow the nutation (59): those of (1) at the middle of each piece."""
    nutation, count = Nutation(), round(DURATION_s / HOLD_s)
    desired = nutation.sample(HOLD_s * (np.arange(count, dtype=np.float64) + 0.5))
    torque = [motion.torque(q, qdot, qddot) for q, qdot, qddot in desired]
    return HeldTorques(nutation.sample(np.zeros(1))[0, :2].ravel(), np.array(torque))


def solve(what: str, *problem: Any, **options: Any) -> Any:
    """Return the solution of a problem of `solve_ivp` by DOP853.

    Raises
    ------
    EngineError
        It did not converge.
    """
    solution = solve_ivp(*problem, "DOP853", **options)
    if not solution.success:
        raise EngineError(f"{what}: expected DOP853 to converge, {solution.message}")
    return solution


def integrate(pieces: HeldTorques, motion: Equations) -> Array:
    """States at the ends of the pieces by DOP853, of order eight, on the Lagrangian.

    Its tolerance is near rounding, so that its error is far below any bound here.

    Raises
    ------
    EngineError
        The integrator could not hold its tolerance.
    """

    def flow(_: float, state: Array, torque: Array) -> Array:
        return motion.flow(state, torque)

    states = [pieces.start]
    for torque in pieces.torque:
        start, tight = states[-1], {"rtol": 1e-13, "atol": 1e-14}
        solved = solve("reference trajectory", flow, (0, HOLD_s), start, args=(torque,), **tight)
        states.append(solved.y[:, -1])
    return np.array(states)


def by_mujoco(mjcf: Path, pieces: HeldTorques, integrator: str, step_s: float) -> Array:
    """States at the ends of the pieces by MuJoCo."""
    rotor = MujocoRotor([true_model(read(mjcf), gravity_m_s2=0.0)], step_s, integrator)
    rotor.start(pieces.start[:3], pieces.start[3:])
    states = [pieces.start]
    for torque in pieces.torque:
        rotor.data.qfrc_applied[:] = torque
        mujoco.mj_step(rotor.model, rotor.data, nstep=round(HOLD_s / step_s))
        states.append(np.concatenate([rotor.data.qpos, rotor.data.qvel]))
    return np.array(states)


def by_own_steps(motion: Equations, pieces: HeldTorques, step_s: float) -> Array:
    """States at the ends of the pieces by the Lagrangian plant."""
    plant = LagrangianRotor(motion.joint, step_s).start(pieces.start[:3], pieces.start[3:])
    states = [pieces.start]
    for torque in pieces.torque:
        plant.torque_q[:] = torque
        for _ in range(round(HOLD_s / step_s)):
            lagrangian_rotor.step(plant)
        states.append(np.concatenate([plant.q, plant.qdot]))
    return np.array(states)


def convergence(
    method: Callable[[float], Array], reference: Array, steps_s: tuple[float, ...] = STEPS_s
) -> Convergence:
    """Largest error of any hinge angle at each step, and its order by regression.

    An order shows where errors are small: with larger ones, all steps are halved.
    """
    for halvings in range(MOST_HALVINGS + 1):
        taken_s = np.array(steps_s) / 2**halvings
        errors = np.array([np.max(np.abs((method(float(step_s)) - reference)[:, :3])) for step_s in taken_s])
        if not errors.max() > LARGEST_ERROR_rad:
            break
    order = np.polyfit(np.log(taken_s), np.log(errors), 1)[0] if np.all(np.isfinite(errors)) else np.nan
    return Convergence(taken_s, errors, float(order))


def reason_of(value: float) -> str:
    """Return the reason for a value of a run that is not finite."""
    return "" if np.isfinite(value) else "left the workspace" if np.isnan(value) else "diverged"


def order_check(name: str, measured: Convergence, order: int, why: str, motion: str, reference: str) -> Check:
    """Check of an order of convergence; `motion` and `reference` are the ends of its description."""
    longest, shortest = 1e3 * max(measured.steps_s), 1e3 * min(measured.steps_s)
    return Check(
        name=f"order of convergence: {name}",
        compares=f"{motion}slope of log error over log step, {len(measured.steps_s)} steps from {longest:g}"
        f" to {shortest:g} ms{reference}",
        states=len(measured.steps_s),
        value=measured.order,
        bound=order + ORDER_MARGIN,
        why=why,
        at_least=order - ORDER_MARGIN,
        reason=reason_of(float(measured.errors_rad.max())),
        detail={
            f"error at {1e3 * step_s:g} ms, rad": float(error)
            for step_s, error in zip(measured.steps_s, measured.errors_rad, strict=True)
        },
    )


def _trajectory(difference: Array, neglected: float) -> Check:
    return Check(
        name="trajectory: MuJoCo RK4",
        compares=f"MuJoCo RK4 at {1e3 * STEP_s:g} ms with DOP853 on the Lagrangian, torques of the nutation"
        f" held over {1e3 * HOLD_s:g} ms, {DURATION_s:g} s; largest difference of any hinge angle",
        states=len(difference),
        value=float(np.max(np.abs(difference))),
        bound=BOUND_rad + neglected,
        why="truncation of a fourth-order step, (ωh)⁴ωT/120 = 8e-10 for inertia that turns at twice the spin,"
        " with a margin of ten, and the share of the rings; an inertia wrong by 2e-8 of itself breaks it",
        unit="rad",
    )


def _order(name: str, measured: Convergence, order: int) -> Check:
    why = f"order {order} in theory; the margin is what the next power of the step adds at these steps"
    return order_check(name, measured, order, why, "", ", against DOP853")
