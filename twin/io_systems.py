"""Plant and closed loop as nonlinear systems of python-control, sampled at the control period."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from spheretwin.config.active_config import initial_config
from spheretwin.config.plant_model import parameters_of
from spheretwin.control.law import Law
from spheretwin.control.manual_currents import sample_currents
from spheretwin.electronics.random_streams import noise_table
from spheretwin.electronics.sensor_chain import noise_streams
from spheretwin.linear import python_control
from spheretwin.loop.closed_loop import Inputs
from spheretwin.loop.hardware_assembly import fault_streams
from spheretwin.loop.runtime import Runtime, RuntimeState
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError
from spheretwin.models.mjcf_reader import HINGES
from spheretwin.plant.plant_step import State, step
from spheretwin.scenario.sections import Scenario

STATES = tuple(f"{hinge}_{unit}" for unit in ("rad", "rad_s") for hinge in HINGES)
REFERENCE = tuple(f"{hinge}_ref_{unit}" for unit in ("rad", "rad_s", "rad_s2") for hinge in HINGES)
DISTURBANCE = tuple(f"disturbance_{hinge}_Nm" for hinge in HINGES)


def plant_system(scenario: Scenario) -> Any:
    """Return the plant of a scenario as a discrete system: currents held over a control period.

    Parameters
    ----------
    scenario : Scenario
        From `scenario.load`; its true plant, without drive, sensors and controller.

    Returns
    -------
    control.NonlinearIOSystem
        Inputs: group currents (A), then a generalised torque (N·m) that is subtracted in (1). States and
        outputs: angles (rad) and rates (rad/s).

    Raises
    ------
    InputError
        The model has physics that the plant step does not have, or python-control is not installed.
    """
    control = python_control()
    config = initial_config(scenario, None, None)
    resolved, groups = config.scenario, len(config.files.actuator.groups)
    parameters, step_s = parameters_of(resolved, config.files), resolved.plant.step_s
    substeps = round(resolved.controller.period_s / step_s)

    def update(t: float, x: Array, u: Array, params: Any) -> Array:
        state = State(np.array(x[:3]), np.array(x[3:]))
        current, disturbance = np.array(u[:groups]), np.array(u[groups:])
        for _ in range(substeps):
            state = step(state, current, disturbance, parameters, step_s)
        return np.concatenate(state)

    return control.NonlinearIOSystem(
        update,
        None,
        name=f"plant of {resolved.name}",
        inputs=[*(f"current_{j:02}_A" for j in range(groups)), *DISTURBANCE],
        outputs=list(STATES),
        states=list(STATES),
        dt=resolved.controller.period_s,
    )


class LoopSystem:
    """Closed loop of a scenario as a function of its complete state.

    Parameters
    ----------
    scenario : Scenario
        From `scenario.load`; its trajectory and its disturbance are replaced by inputs.
    law : Law, optional
        Replaces the law of the scenario.

    Raises
    ------
    InputError
        The scenario has faults or events, which depend on the time.
    """

    def __init__(self, scenario: Scenario, law: Law | None = None) -> None:
        config = initial_config(scenario, law, None)
        self.scenario = config.scenario
        if self.scenario.fault or self.scenario.event:
            raise InputError("loop: expected a scenario without faults and events, received some")
        self._runtime = Runtime(self.scenario, config.files, config.law)
        self._first = self._runtime.state()
        self._log = np.empty((1, self._runtime.row_width))
        self._groups = len(config.files.actuator.groups)
        self.start = _numbers(self._first)

    def update(self, t: float, x: ArrayLike, u: ArrayLike) -> Array:
        """Return the state (n,) one control period later.

        Parameters
        ----------
        t : float, s
            Start of the period; it selects the noise of the sensors.
        x : (n,) array
            State.
        u : (12,) array
            Reference of angles, rates and accelerations, then the disturbance (N·m), held over the period.
        """
        self._restore(x)
        given, scenario = np.asarray(u, np.float64), self.scenario
        tick = round(t / scenario.controller.period_s)
        inputs = Inputs(
            t=np.array([t]),
            reference=given[:9].reshape(1, 3, 3).copy(),
            disturbance=given[9:].reshape(1, 3).copy(),
            noise=noise_table(scenario.seed, tick, 1, noise_streams(scenario.sensors)),
            fault_noise=noise_table(scenario.seed, tick, 1, fault_streams(scenario, self._groups)),
            manual_A=sample_currents(scenario.manual, np.array([t])),
        )
        self._runtime.run(inputs, self._log)
        return _numbers(self._runtime.state())

    def output(self, x: ArrayLike) -> Array:
        """Return true angles and rates (6,) of a state."""
        self._restore(x)
        return np.concatenate([self._runtime.q_rad, self._runtime.qdot_rad_s])

    def _restore(self, x: ArrayLike) -> None:
        ends = np.cumsum([len(part) for part in self._first[:-1]])
        parts = np.split(np.array(x, np.float64), ends[:-1])
        self._runtime.restore(RuntimeState._make([*parts, self._first.last]))


def loop_system(scenario: Scenario, law: Law | None = None) -> tuple[Any, Array]:
    """Return the closed loop of a scenario as a discrete system, and its state at the start.

    Parameters
    ----------
    scenario, law
        As for `LoopSystem`.

    Returns
    -------
    control.NonlinearIOSystem
        Inputs: reference of angles (rad), rates and accelerations, then a disturbance (N·m, subtracted in
        (1)). Outputs: true angles (rad) and rates (rad/s). The states are those of rotor, drive, sensors and
        controller, with the memory of the law.
    (n,) array
        State at the start of the scenario.

    Raises
    ------
    InputError
        The scenario has faults or events, or python-control is not installed.
    """
    control, loop = python_control(), LoopSystem(scenario, law)
    system = control.NonlinearIOSystem(
        lambda t, x, u, params: loop.update(t, x, u),
        lambda t, x, u, params: loop.output(x),
        name=f"loop of {loop.scenario.name}",
        inputs=[*REFERENCE, *DISTURBANCE],
        outputs=list(STATES),
        states=len(loop.start),
        dt=loop.scenario.controller.period_s,
    )
    return system, loop.start


def reference_inputs(samples: Sequence[Any] | Array, disturbance_Nm: ArrayLike = 0.0) -> Array:
    """Return the inputs (12, k) of `loop_system` for samples (k, 3, 3) of a trajectory.

    Parameters
    ----------
    samples : (k, 3, 3) array
        Angle, rate and acceleration as rows, as of `trajectory.sample(t)`.
    disturbance_Nm : float, (3,) or (k, 3) array, N·m
    """
    rows = np.asarray(samples, np.float64).reshape(len(samples), 9)
    return np.hstack([rows, np.broadcast_to(disturbance_Nm, (len(rows), 3))]).T


def _numbers(state: RuntimeState) -> Array:
    return np.concatenate(state[:-1])
