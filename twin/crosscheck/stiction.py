"""Static friction: both engines against an event-driven integration of the same model, and at rest.

The reference knows neither the step nor the implicit method of `plant.bristle_friction`: DOP853 integrates
the Lagrangian between the instants at which a slider begins to slip or sticks again.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from spheretwin import assembly
from spheretwin import scenario as scenarios
from spheretwin.active_config import initial_config
from spheretwin.crosscheck.part import Part
from spheretwin.crosscheck.trajectories import ENGINES
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.checks import Check
from spheretwin.models.base.compiled import compiled
from spheretwin.models.base.errors import EngineError
from spheretwin.models.lagrangian import acceleration
from spheretwin.plant.bristle_friction import LAST, SLIP_SHARES, StictionSection
from spheretwin.plant.step import GOING, PlantOutput, plant_tick
from spheretwin.shared_buffers import shared_buffers

Array = NDArray[np.float64]

STEP_s = 5e-4  # the default physics step
DURATION_s, SAMPLE_s = 1.0, 5e-3
START_rad = (0.3, -0.4, 0.5)
COULOMB_Nm = (2e-3, 3e-3, 2e-3)
STICTION = StictionSection(on=True)
# 1.3 to 1.7 times the break-away torques.
AMPLITUDE_Nm, FREQUENCY_rad_s = np.array([5e-3, 6e-3, 4e-3]), 2 * np.pi * np.array([1.0, 1.3, 0.7])

REST_s = 20.0
LOAD = 0.5  # of the break-away torque
DRIFT_rad = 1e-9


TIGHT: dict[str, Any] = {"rtol": 1e-11, "atol": 1e-13, "max_step": SAMPLE_s, "dense_output": True}


class Stiction(NamedTuple):
    """Checks of static friction."""

    checks: list[Check]


def compare(mjcf: Path, actuator: Actuator) -> Stiction:
    """Compare both engines with the reference, and load them at rest.

    Parameters
    ----------
    mjcf : Path
        Model file that the engines read.
    actuator : Actuator
        Its inertia is that of the Lagrangian.
    """
    reference = Reference(actuator, STICTION, COULOMB_Nm)
    expected, break_aways = reference.integrate(START_rad, DURATION_s)
    checks = [
        _motion(name, by_plant(mjcf, engine), expected, break_aways, actuator)
        for name, engine in ENGINES.items()
    ]
    return Stiction([*checks, *(_rest(name, at_rest(mjcf, engine)) for name, engine in ENGINES.items())])


def torque_Nm(t_s: float) -> Array:
    """Return the torque on the hinges (3,) at a time."""
    torque: Array = AMPLITUDE_Nm * np.sin(FREQUENCY_rad_s * t_s)
    return torque


class Reference:
    """Event-driven integration of the Lagrangian with static friction.

    Parameters
    ----------
    actuator : Actuator
    stiction : StictionSection
    coulomb_Nm : (3,) tuple, N·m
    """

    def __init__(self, actuator: Actuator, stiction: StictionSection, coulomb_Nm: tuple[float, ...]) -> None:
        self._inertia, self._stiction = actuator.inertia, stiction
        self._slip = np.array(SLIP_SHARES)[:, None] * stiction.presliding_rad
        self._stiffness = stiction.break_away * np.array(coulomb_Nm) / self._slip.sum()
        # Two springs in parallel have critical damping 2 sqrt(2 k J), a half each.
        self._damping = stiction.damping_ratio * np.sqrt(2 * self._stiffness * self._inertia)
        self._direction = np.zeros((2, 3))  # of slip; 0 for a slider that sticks
        self._anchor = np.zeros((2, 3))  # pose without deflection of a slider that sticks

    def integrate(self, start_rad: tuple[float, ...], duration_s: float) -> tuple[Array, int]:
        """Return the states (n + 1, 6) at the samples from rest, and the number of break-aways.

        Raises
        ------
        EngineError
            The integrator could not hold its tolerance.
        """
        self._direction[:], self._anchor[:] = 0.0, start_rad
        t_s = SAMPLE_s * np.arange(round(duration_s / SAMPLE_s) + 1)
        events = [partial(self._margin, *place) for place in np.ndindex(2, 3)]
        for event in events:
            event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
        state, now, states, break_aways = np.concatenate([start_rad, np.zeros(3)]), 0.0, [], 0
        while len(states) < len(t_s):
            solved = solve_ivp(self._flow, (now, t_s[-1]), state, "DOP853", events=events, **TIGHT)
            if not solved.success:
                raise EngineError(f"static friction reference: expected DOP853 to converge, {solved.message}")
            now, state = float(solved.t[-1]), solved.y[:, -1]
            states += [solved.sol(t) for t in t_s[len(states) :] if t <= now]
            if solved.status == 1:
                element, hinge = divmod([len(times) > 0 for times in solved.t_events].index(True), 3)
                break_aways += self._switch(element, hinge, state)
        return np.array(states), break_aways

    def _limits(self, qdot: Array) -> Array:
        """Return the largest deflections (2, 3)."""
        share, ratio = 1 / self._stiction.break_away, qdot / self._stiction.stribeck_rad_s
        factor = np.where(self._direction[LAST] != 0, share + (1 - share) * np.exp(-(ratio**2)), 1.0)
        limits: Array = self._slip * factor
        return limits

    def _flow(self, t: float, state: Array) -> Array:
        q, qdot = state[:3].copy(), state[3:].copy()
        most = self._stiffness * self._limits(qdot)
        sticking = self._stiffness * (q - self._anchor) + self._damping * qdot
        friction = np.where(self._direction == 0, np.clip(sticking, -most, most), self._direction * most)
        torque = torque_Nm(t) - friction.sum(axis=0)
        return np.concatenate([qdot, acceleration(q, qdot, torque, self._inertia, 0.0)])

    def _margin(self, element: int, hinge: int, t: float, state: Array) -> float:
        """Return a number that falls through 0 as a slider begins to slip, or sticks again."""
        place = element, hinge
        if self._direction[place]:
            return float(self._direction[place] * state[3 + hinge])
        return float(self._limits(state[3:])[place] - abs(state[hinge] - self._anchor[place]))

    def _switch(self, element: int, hinge: int, state: Array) -> bool:
        """Let a slider slip, or all of its hinge stick; true if the hinge breaks away."""
        if self._direction[element, hinge]:
            deflection = self._direction * self._limits(state[3:])
            slipping = self._direction[:, hinge] != 0
            self._anchor[slipping, hinge] = state[hinge] - deflection[slipping, hinge]
            self._direction[:, hinge] = 0.0
            return False
        self._direction[element, hinge] = np.sign(state[hinge] - self._anchor[element, hinge])
        return element == LAST


def by_plant(mjcf: Path, engine: str) -> Array:
    """Return the states (n + 1, 6) at the samples by the plant."""
    middle_s = STEP_s * (np.arange(round(DURATION_s / STEP_s)) + 0.5)
    return _driven(mjcf, engine, np.array([torque_Nm(t) for t in middle_s]), round(SAMPLE_s / STEP_s))


def at_rest(mjcf: Path, engine: str) -> Array:
    """Return the states (n + 1, 6) at whole seconds by the plant under `LOAD`."""
    load = LOAD * STICTION.break_away * np.array(COULOMB_Nm)
    return _driven(mjcf, engine, np.tile(load, (round(REST_s / STEP_s), 1)), round(1 / STEP_s))


def _driven(mjcf: Path, engine: str, torque: Array, every: int) -> Array:
    """Return the states at every so many steps under torques (n, 3) without currents."""
    fields: dict[str, Any] = {
        "plant.mjcf": str(mjcf),
        "plant.engine": engine,
        "plant.initial_rad": START_rad,
        "plant.coulomb_Nm": COULOMB_Nm,
        "controller.period_s": STEP_s,
        **{f"plant.stiction.{name}": value for name, value in STICTION.model_dump().items()},
    }
    config = initial_config(scenarios.load("hold", fields), None, None)
    scenario, actuator = config.scenario, config.files.actuator
    groups = len(actuator.groups)
    rotor = assembly.rotor_of(scenario, config.files)  # keep it: the plant has addresses within it
    plant = assembly.plant_of(
        scenario, actuator, rotor.start(np.array(START_rad), np.zeros(3)), shared_buffers(scenario, groups)
    )
    states = np.full((len(torque) // every + 1, 6), np.nan)
    states[0] = [*START_rad, 0, 0, 0]
    output = PlantOutput(np.empty(groups), np.empty(groups), np.empty(3))
    _drive(plant, np.zeros(groups), -torque, output, every, states)
    return states


@compiled
def _drive(plant: Any, command: Array, disturbance: Array, output: Any, every: int, states: Array) -> None:
    for tick in range(disturbance.shape[0]):
        if plant_tick(plant, command, disturbance[tick], output) != GOING:
            return
        if (tick + 1) % every == 0:
            for i in range(3):
                states[(tick + 1) // every, i] = plant.rotor.q[i]
                states[(tick + 1) // every, 3 + i] = plant.rotor.qdot[i]


def _motion(name: str, states: Array, expected: Array, break_aways: int, actuator: Actuator) -> Check:
    drop = max(COULOMB_Nm) * (STICTION.break_away - 1) / float(min(actuator.inertia))
    difference = np.abs(states - expected)
    return Check(
        name=f"static friction: motion, {name}",
        compares=f"all hinges under torques of 1.3 to 1.7 of break-away for {DURATION_s:g} s: rates, with"
        " DOP853 between the instants at which a slider slips or sticks",
        states=len(expected),
        value=float(difference[:, 3:].max()),
        bound=1.5 * STEP_s * drop * break_aways,
        why="after each break-away the Stribeck effect begins a step and a half late at most; it takes the"
        f" difference of both levels at most; {break_aways} break-aways",
        unit="rad/s",
        detail={"largest difference of an angle, rad": float(difference[:, :3].max())},
    )


def _rest(name: str, states: Array) -> Check:
    settled = states[2:, :3]
    return Check(
        name=f"static friction: rest, {name}",
        compares=f"all hinges at rest under {LOAD:g} of break-away: drift from 2 to {REST_s:g} s",
        states=len(settled),
        value=float(np.ptp(settled, axis=0).max()),
        bound=DRIFT_rad,
        why="deflection does not creep; the elastic motion decays with 0.08 s, by a factor of 1e-11 in 2 s",
        unit="rad",
    )


PART = Part("static friction", lambda subject: compare(subject.mjcf, subject.actuator))
