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
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from spheretwin import scenario as scenarios
from spheretwin.crosscheck.dynamics import MASS
from spheretwin.crosscheck.equations import Equations, equations_of, ring_share
from spheretwin.crosscheck.scale import Scale, scale_of
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.checks import Check
from spheretwin.models.base.errors import EngineError
from spheretwin.models.mjcf import read
from spheretwin.models.telemetry.table import Table
from spheretwin.plant import lagrangian_rotor
from spheretwin.plant.lagrangian_rotor import LagrangianRotor
from spheretwin.plant.mass_properties import true_model
from spheretwin.plant.mujoco_rotor import MujocoRotor
from spheretwin.scenario.changes import with_change
from spheretwin.simulation import simulate
from spheretwin.trajectories.shapes import Nutation

Array = NDArray[np.float64]

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


SCENARIO = "nutation"

# At the scenario's load of 2, PD lags so far behind that the currents saturate and the rotor leaves the
# workspace, on either plant; at a quarter of it, it completes.
CONDITIONS: dict[str, dict[str, Any]] = {
    "PD": {"controller.law": "pd", "disturbance.load": 0.5},
    "AFSM": {"controller.law": "afsm"},
    "PD, general joint": {
        "controller.law": "pd",
        "disturbance.load": 0.5,
        "plant.coulomb_Nm": [2e-3] * 3,
        **{f"plant.mass.{name}": value for name, value in MASS},
    },
}

TRACE_BOUND_rad = 1e-9
RING_FACTOR_rad = 3.0  # an inertia wrong by a share moves a trace by a third of it
LOAD = 2.0  # of the scenario
STATUS = {"left_workspace": "left the workspace"}

WHY = {
    "PD": "a smooth law takes both runs to the same motion: only rounding and the gimbal rings (1e-12) part"
    " them; an inertia wrong by 1e-8 of itself moves the trace by 3e-9",
    "AFSM": "rounding and the gimbal rings (1e-12) as under PD, as long as they decide no sign of s: one"
    " flipped sign moves the trace by 1e-5. For that |s| must be below 1e-10 at a tick, where it moves by"
    " 1e-2 from tick to tick: less than once in a thousand runs",
    "PD, general joint": "a smooth law and smooth friction, as under PD; both engines have the same rings",
}

# What the step size costs: a smooth law, and no random torque, so that the runs differ in nothing else.
ENGINES = {"MuJoCo": "mujoco", "Lagrangian": "lagrangian"}
LOOP_STEP_s, FINE_s = 5e-4, 5e-5
SMOOTH: dict[str, Any] = {
    "controller.law": "afsm_eso",
    "controller.preset": "ideal",
    "disturbance.random_bound_Nm": 0.0,
    "seed": 101,
}
STEP_BOUND_rad = 2e-5


class Pair(NamedTuple):
    """One run on both plants."""

    mujoco: Table
    lagrangian: Table
    same_end: bool
    status: str  # on MuJoCo

    @property
    def difference_rad(self) -> Array:
        """(n,) largest difference of any hinge angle, up to where the shorter run ended."""
        rows = min(len(self.mujoco), len(self.lagrangian))
        apart: Array = np.abs(self.mujoco["q_rad"][:rows] - self.lagrangian["q_rad"][:rows])
        return np.max(apart, axis=1)


class ClosedLoop(NamedTuple):
    """Checks, and the runs they were taken from, by law."""

    checks: list[Check]
    pairs: dict[str, Pair]


def compare_closed_loop(mjcf: Path, actuator: Actuator) -> ClosedLoop:
    """Run the nutation under both laws on both plants, and under a smooth law at two physics steps.

    Parameters
    ----------
    mjcf : Path
        Model file that both engines read.
    actuator : Actuator
        Reference and load are scaled to its range, inertia and torque.
    """
    scale = scale_of(actuator)
    neglected = ring_share(mjcf, actuator) if read(mjcf).has_ideal_joint else 0.0
    pairs = {law: _run(mjcf, scale, overrides) for law, overrides in CONDITIONS.items()}
    traces = [_trace(law, pair, neglected) for law, pair in pairs.items()]
    return ClosedLoop([*traces, *(_step_size(mjcf, scale, name) for name in ENGINES)], pairs)


def closed_loop_fields(mjcf: Path, scale: Scale, overrides: dict[str, Any]) -> dict[str, Any]:
    """Return the overrides of the nutation of a machine."""
    load, torques = overrides.get("disturbance.load", LOAD), scale.load * np.array([2e-3, 1e-3, 1e-3])
    return {
        "plant.modelling_torque_Nm": torques.tolist(),
        "disturbance.random_bound_Nm": 0.05 * scale.load,
        "trajectory.alpha_amplitude_rad": 0.2 * scale.tilt,
        "trajectory.beta_growth_rad_s": 0.2 * scale.tilt,
        "trajectory.spin_rate_rad_s": 2 * np.pi * scale.spin,
        **{name: scale.field(name, value) for name, value in overrides.items()},
        "disturbance.load": load * scale.load,
        "plant.mjcf": str(mjcf),
    }


def _run(mjcf: Path, scale: Scale, overrides: dict[str, Any]) -> Pair:
    scenario = scenarios.load(SCENARIO, closed_loop_fields(mjcf, scale, overrides))
    on_mujoco = simulate(scenario)
    on_lagrangian = simulate(with_change(scenario, "plant.engine", "lagrangian"))
    tables = on_mujoco.telemetry, on_lagrangian.telemetry
    same_end = on_mujoco.status == on_lagrangian.status and len(tables[0]) == len(tables[1])
    return Pair(*tables, same_end, on_mujoco.status)


def _trace(law: str, pair: Pair, neglected: float) -> Check:
    load = CONDITIONS[law].get("disturbance.load", LOAD)
    status = "" if pair.status == "completed" else f"; {STATUS.get(pair.status, pair.status)}"
    return Check(
        name=f"closed loop under {law}: trace",
        compares=f"nutation at load {load:g} on MuJoCo with that on the Lagrangian, largest difference of any"
        f" hinge angle at any tick{status}",
        states=len(pair.difference_rad),
        value=float(np.max(pair.difference_rad)) if pair.same_end else float("inf"),
        bound=TRACE_BOUND_rad + RING_FACTOR_rad * neglected,
        why=WHY[law],
        reason="" if pair.same_end else "ended apart",
        unit="rad",
        detail=_figures(pair),
    )


def _step_size(mjcf: Path, scale: Scale, name: str) -> Check:
    fields = closed_loop_fields(mjcf, scale, SMOOTH) | {"plant.engine": ENGINES[name]}
    runs = [simulate(scenarios.load(SCENARIO, {**fields, "plant.step_s": h})) for h in (LOOP_STEP_s, FINE_s)]
    coarse, fine = (run.telemetry["q_rad"] for run in runs)
    same_end = runs[0].status == runs[1].status and len(coarse) == len(fine)
    status = "" if runs[0].status == "completed" else f"; {STATUS.get(runs[0].status, runs[0].status)}"
    return Check(
        name=f"closed loop: step size, {name}",
        compares=f"nutation under AFSM-ESO at {1e3 * LOOP_STEP_s:g} ms with that at {1e3 * FINE_s:g} ms,"
        f" largest difference of any hinge angle at any tick{status}",
        states=len(coarse),
        value=float(np.max(np.abs(coarse - fine))) if same_end else float("inf"),
        bound=STEP_BOUND_rad,
        why="a step of second order, with a margin of two; a torque matrix taken at the start of each step"
        " gives 6e-4",
        unit="rad",
        reason="" if same_end else "ended apart",
    )


def _figures(pair: Pair) -> dict[str, float]:
    ours, theirs = np.abs(pair.mujoco["error_rad"]), np.abs(pair.lagrangian["error_rad"])
    rms = np.sqrt(np.mean(ours**2, axis=0)), np.sqrt(np.mean(theirs**2, axis=0))
    largest = ours.max(axis=0), theirs.max(axis=0)
    return {
        "rms error, relative": float(np.max(np.abs(rms[0] / rms[1] - 1))),
        "largest error, relative": float(np.max(np.abs(largest[0] / largest[1] - 1))),
    }
