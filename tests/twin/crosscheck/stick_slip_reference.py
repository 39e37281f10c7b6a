"""Static friction by the plant and by an event-driven integration of the same model.

The reference knows neither the step nor the implicit method of `plant.bristle_friction`: DOP853 integrates
the Lagrangian between the instants at which a slider begins to slip or sticks again.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.crosscheck.coil_driven import drive_plant
from spheretwin.crosscheck.equations import equations_of
from spheretwin.crosscheck.scale import Scale, scale_of
from spheretwin.crosscheck.trajectories import solve
from spheretwin.models.actuator import MJCF_PATH, Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.plant.bristle_friction import LAST, SLIP_SHARES, StictionSection

STEP_s = 5e-4  # the default physics step
DURATION_s, SAMPLE_s = 1.0, 5e-3
START_rad = (0.3, -0.4, 0.5)
COULOMB_Nm = (2e-3, 3e-3, 2e-3)
STICTION = StictionSection(on=True)
# 1.3 to 1.7 times the break-away torques.
AMPLITUDE_Nm, FREQUENCY_rad_s = np.array([5e-3, 6e-3, 4e-3]), 2 * np.pi * np.array([1.0, 1.3, 0.7])

TIGHT: dict[str, Any] = {"rtol": 1e-11, "atol": 1e-13, "max_step": SAMPLE_s, "dense_output": True}


def bound_rad_s(actuator: Actuator, break_aways: int) -> float:
    """Return the bound of the rates.

    After each break-away the Stribeck effect begins a step and a half late at most; it takes the difference
    of both levels at most.
    """
    largest_Nm = max(scale_of(actuator).torques_Nm(COULOMB_Nm))
    drop = largest_Nm * (STICTION.break_away - 1) / float(min(actuator.inertia))
    return 1.5 * STEP_s * drop * break_aways


def torque_Nm(t_s: float) -> Array:
    """Return the torque on the hinges (3,) of the shipped actuator at a time."""
    torque: Array = AMPLITUDE_Nm * np.sin(FREQUENCY_rad_s * t_s)
    return torque


class Reference:
    """Event-driven integration of the Lagrangian with static friction.

    Parameters
    ----------
    actuator : Actuator
    stiction : StictionSection
    coulomb_Nm : (3,) tuple, N·m
    mjcf : Path
        Model file of the actuator.
    torque : float
        Factor of the torques on the hinges.
    """

    def __init__(
        self,
        actuator: Actuator,
        stiction: StictionSection,
        coulomb_Nm: tuple[float, ...],
        mjcf: Path = MJCF_PATH,
        torque: float = 1.0,
    ) -> None:
        self._equations, self._stiction, self._torque = equations_of(mjcf, actuator), stiction, torque
        self._slip = np.array(SLIP_SHARES)[:, None] * stiction.presliding_rad
        self._stiffness = stiction.break_away * np.array(coulomb_Nm) / self._slip.sum()
        # Two springs in parallel have critical damping 2 sqrt(2 k J), a half each.
        self._damping = stiction.damping_ratio * np.sqrt(2 * self._stiffness * actuator.inertia)
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
            vars(event).update(terminal=True, direction=-1)  # attributes that `solve_ivp` reads
        states: list[Array] = []
        state, now, break_aways = np.concatenate([start_rad, np.zeros(3)]), 0.0, 0
        while len(states) < len(t_s):
            span = now, t_s[-1]
            solved = solve("static friction reference", self._flow, span, state, events=events, **TIGHT)
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
        return self._equations.flow(state, self._torque * torque_Nm(t) - friction.sum(axis=0))

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


def by_plant(mjcf: Path, scale: Scale, engine: str, step_s: float = STEP_s, share: float = 1.0) -> Array:
    """Return the states (n + 1, 6) at the samples by the plant without currents."""
    count = round(DURATION_s / step_s)
    torque = share * scale.torque * np.array([torque_Nm(step_s * (step + 0.5)) for step in range(count)])
    fields: dict[str, Any] = {
        "plant.engine": engine,
        "plant.initial_rad": scale.pose_rad(START_rad),
        "plant.coulomb_Nm": scale.torques_Nm(COULOMB_Nm),
        "controller.period_s": step_s,
        "plant.step_s": step_s,
        **{f"plant.stiction.{name}": value for name, value in STICTION.model_dump().items()},
    }
    every = round(SAMPLE_s / step_s)
    return drive_plant(mjcf, fields, lambda groups: np.zeros((count, groups)), -torque, every)
