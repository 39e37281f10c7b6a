r"""Nonlinear predictive control of the angles: IPOPT solves every few ticks, an observer acts at every tick.

*Problem.* Over N intervals of `ticks` control periods, with the nominal rotor and the estimated
disturbance d̂,

    min  Σ_k w_k (|q_k − r_k|² + |q̇_k − ṙ_k|²/λ²) + ρ² |Ĵ⁻¹ (τ_k − τ_{k−1})|²,
    M̂ q̈ + Ĉ q̇ = τ_k + d̂,      |P τ_k| ≤ I_max,

with w_k = 1, and N for the last state. P = (Eᵀ G)⁺ is the least-norm allocation at the pose of the solve. The
reference of a tick is extended by its rate and acceleration, as no law knows the future of its reference. The
cost is one of changes of the torque, and d̂ is in the model: a constant load leaves no error (offset-free
control).

*Rate.* A solve takes 10 ms, more than a control period. The law solves once in `ticks` periods and holds the
planned torque; d̂ of the extended state observer is updated at every tick, and the change of d̂ since the solve
is compensated at once. The allocation of each tick limits the currents of plan and correction to I_max. A run
waits for each solve, so that it has no dead time of the solver; the horizon begins at the end of the nominal
delay.

`spheretwin.casadi.PredictiveControl().build(known)` is a `Law`; on a command line it is
``--controller.law FILE:PredictiveControl`` as `spheretwin.casadi.nmpc_file()` returns it.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from spheretwin.casadi.functions import library, rigid_body
from spheretwin.control.law import Law, NominalModel, Positive, PositiveEach, each
from spheretwin.control.law_components.extended_state_observer import (
    ObserverState,
    history_layout,
    observe,
    observer_gains,
    store_command,
)
from spheretwin.control.law_components.nominal_motion import RotorModel, RotorMotion, advance_motion
from spheretwin.control.law_components.parameters import LawParameters, named
from spheretwin.models import actuator, magnetics
from spheretwin.models.base.arrays import Array
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.telemetry.signals import ANGLES, Signal

SIGNALS = (
    Signal("observed_disturbance_Nm", "N·m", 3, "disturbance torque estimated by the observer, d̂", ANGLES),
    Signal("planned_torque_Nm", "N·m", 3, "torque of the last solve", ANGLES),
    Signal("iterations", "1", 1, "iterations of the last solve"),
)

# Layout of the state.
DISTURBANCE, TORQUE, ITERATIONS, ANGLE, RATE, ASSUMED, TICK, PLAN = 0, 3, 6, 7, 10, 13, 16, 17

SOLVER = {
    "print_time": False,
    "error_on_fail": False,
    "ipopt": {
        "print_level": 0,
        "sb": "yes",
        "max_iter": 40,
        "tol": 1e-6,
        "warm_start_init_point": "yes",
        "mu_init": 1e-4,
    },
}


class PredictiveControl(LawParameters):
    """Nonlinear predictive control with an extended state observer."""

    law: Literal["predictive_control"] = named("predictive_control")
    ticks: int = Field(10, ge=1, le=1000, description="control periods between solves; also of an interval")
    intervals: int = Field(8, ge=2, le=100, description="intervals of the horizon")
    rate_weight_1_s: Positive = Field(
        80.0, description="λ, 1/s: an error λ e of the rate weighs as much as an error e of the angle"
    )
    torque_weight_s2: Positive = Field(3e-5, description="ρ, weight of the change of the acceleration, s²")
    current_limit_A: Positive = Field(8.0, description="I_max, of each group")  # OPA549, continuous
    # Those of the preset `prototype` of AFSM-ESO.
    observer_bandwidth_rad_s: PositiveEach = Field(
        (50.0, 50.0, 30.0), description="ω_o of the observer, rad/s"
    )
    disturbance_bandwidth_rad_s: PositiveEach = Field(each(50.0), description="ω_d of the observer, rad/s")

    def build(self, known: NominalModel) -> Law:
        """Return a law at rest, without an estimated disturbance."""
        fraction, size = history_layout(known)
        problem = _Problem(self, known, fraction)
        state = np.zeros(PLAN + problem.size + size)
        return Law(
            self.law,
            problem.step,
            np.zeros(0),
            state,
            SIGNALS,
            asks_torque=True,
            current_limit_A=self.current_limit_A,
        )


class _Solver(NamedTuple):
    """Compiled problem and its bounds."""

    solve: Any
    lower: Array
    upper: Array


class _Problem:
    """Law as a Python function: observer at each tick, solver at some."""

    def __init__(self, law: PredictiveControl, known: NominalModel, fraction: float) -> None:
        self._law, self._known, self._fraction = law, known, fraction
        self._rotor = RotorModel((known.inertia[0], known.inertia[1], known.inertia[2]), True)
        alpha, beta, gamma = (
            observer_gains(first, second, known.period_s)
            for first, second in zip(
                law.observer_bandwidth_rad_s, law.disturbance_bandwidth_rad_s, strict=True
            )
        )
        self._gains = alpha, beta, gamma
        self._actuator = actuator.load()
        self.size = 9 * law.intervals
        self._solver = _solver(law, known, len(self._actuator.groups))

    def step(
        self,
        t: float,
        reference: Array,
        measurement: Array,
        parameters: Array,
        state: Array,
        torque: Array,
    ) -> None:
        """Write the torque of one control tick; see `control.law.Law`."""
        self._observe(measurement, state)
        if state[TICK] % self._law.ticks == 0:
            self._plan(reference, state)
            state[ASSUMED : ASSUMED + 3] = state[DISTURBANCE : DISTURBANCE + 3]
        state[TICK] += 1
        for axis in range(3):
            torque[axis] = state[TORQUE + axis] - state[DISTURBANCE + axis] + state[ASSUMED + axis]
        store_command(state[PLAN + self.size :], torque)

    def _observe(self, measurement: Array, state: Array) -> None:
        if state[TICK] == 0.0:
            state[ANGLE : ANGLE + 3], state[RATE : RATE + 3] = measurement[0], measurement[1]
            return
        before = ObserverState(_motion(state), _triple(state, DISTURBANCE))
        now = observe(
            before,
            _triple(measurement[0], 0),
            _triple(measurement[2], 0),
            self._gains,
            self._rotor,
            self._known.period_s,
        )
        state[ANGLE : ANGLE + 3], state[RATE : RATE + 3] = now.motion
        state[DISTURBANCE : DISTURBANCE + 3] = now.disturbance

    def _plan(self, reference: Array, state: Array) -> None:
        """Solve from the motion at the end of the nominal delay; a plan that is not finite is not used."""
        motion, ahead_s = self._motion_ahead(state)
        pose = np.array(motion.angle)
        hinge_matrix = rate_jacobian(pose).T @ magnetics.torque_matrix(pose, self._actuator)
        given = np.concatenate(
            [
                pose,
                motion.rate,
                _ahead(reference, ahead_s).ravel(),
                state[TORQUE : TORQUE + 3],
                state[DISTURBANCE : DISTURBANCE + 3],
                np.linalg.pinv(hinge_matrix).ravel(order="F"),
            ]
        )
        plan, solver = state[PLAN : PLAN + self.size], self._solver
        guess = plan if state[TICK] else self._start(pose)
        result = solver.solve(x0=guess, p=given, lbg=solver.lower, ubg=solver.upper)
        solution = np.array(result["x"]).ravel()
        if np.all(np.isfinite(solution)):
            plan[:] = solution
            state[TORQUE : TORQUE + 3] = solution[:3]
            state[ITERATIONS] = solver.solve.stats()["iter_count"]

    def _start(self, pose: Array) -> Array:
        """Return a plan at rest: for each interval a torque, then the state at its end."""
        return np.tile(np.concatenate([np.zeros(3), pose, np.zeros(3)]), self._law.intervals)

    def _motion_ahead(self, state: Array) -> tuple[RotorMotion, float]:
        """Return the motion at the end of the nominal delay, under the pending commands, and this delay."""
        motion, period_s = _motion(state), self._known.period_s
        history = state[PLAN + self.size :].reshape(-1, 3)
        whole, ahead_s = len(history) - 2, 0.0
        for row in range(whole, -1, -1):
            time_s = self._fraction * period_s if row == whole else period_s
            total = history[row] + state[DISTURBANCE : DISTURBANCE + 3]
            motion = advance_motion(motion, _triple(total, 0), self._rotor, time_s)
            ahead_s += time_s
        return motion, ahead_s


def _solver(law: PredictiveControl, known: NominalModel, groups: int) -> _Solver:
    """Return the solver of the problem for x = (τ₀, state₁, τ₁, state₂, …) and the numbers of `_plan`."""
    ca = library()
    interval_s = law.ticks * known.period_s
    start, reference, before = ca.SX.sym("start", 6), ca.SX.sym("reference", 9), ca.SX.sym("before", 3)
    disturbance, allocation = ca.SX.sym("disturbance", 3), ca.SX.sym("allocation", groups, 3)
    advance = _advance(ca, known, interval_s)
    state, last, cost, unknowns, defects, currents = start, before, 0, [], [], []
    for k in range(law.intervals):
        torque, reached = ca.SX.sym(f"torque_{k}", 3), ca.SX.sym(f"state_{k + 1}", 6)
        unknowns += [torque, reached]
        defects.append(reached - advance(state, torque + disturbance))
        currents.append(allocation @ torque)
        r, v, a = (reference[3 * row : 3 * row + 3] for row in range(3))
        ahead_s = (k + 1) * interval_s
        angle_error = reached[:3] - r - ahead_s * (v + 0.5 * ahead_s * a)
        rate_error = reached[3:] - v - ahead_s * a
        weight = law.intervals if k == law.intervals - 1 else 1
        cost += weight * (ca.sumsqr(angle_error) + ca.sumsqr(rate_error) / law.rate_weight_1_s**2)
        cost += law.torque_weight_s2**2 * ca.sumsqr((torque - last) / ca.DM(known.inertia))
        state, last = reached, torque
    given = ca.vertcat(start, reference, before, disturbance, ca.vec(allocation))
    problem = {
        "x": ca.vertcat(*unknowns),
        "p": given,
        "f": 1e6 * cost,
        "g": ca.vertcat(*defects, *currents),
    }
    equal, limit_A = np.zeros(6 * law.intervals), np.full(groups * law.intervals, law.current_limit_A)
    return _Solver(
        ca.nlpsol("predictive_control", "ipopt", problem, SOLVER),
        np.concatenate([equal, -limit_A]),
        np.concatenate([equal, limit_A]),
    )


def _advance(ca: Any, known: NominalModel, step_s: float) -> Any:
    """Return a step of RK4 of the nominal rotor, ``(state, torque) -> state``."""
    state, torque = ca.SX.sym("state", 6), ca.SX.sym("torque", 3)
    acceleration, p = rigid_body(), ca.vertcat(ca.DM(known.inertia), 0)

    def rate(x: Any) -> Any:
        return ca.vertcat(x[3:], acceleration(x[:3], x[3:], torque, p))

    k1 = rate(state)
    k2 = rate(state + step_s / 2 * k1)
    k3 = rate(state + step_s / 2 * k2)
    k4 = rate(state + step_s * k3)
    return ca.Function("advance", [state, torque], [state + step_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])


def _ahead(reference: Array, time_s: float) -> Array:
    """Return the reference (3, 3) after some time at constant acceleration."""
    angle, rate, acceleration = reference
    return np.array(
        [angle + time_s * (rate + 0.5 * time_s * acceleration), rate + time_s * acceleration, acceleration]
    )


def _motion(state: Array) -> RotorMotion:
    return RotorMotion(_triple(state, ANGLE), _triple(state, RATE))


def _triple(numbers: Array, first: int) -> tuple[float, float, float]:
    x, y, z = numbers[first : first + 3].tolist()
    return x, y, z
