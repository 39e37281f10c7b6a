"""Motion driven by coils: the plant's own tick under prescribed currents and commands, without a controller.

Two questions. *Is the field where the rotor is?* Currents are functions of time, and DOP853 integrates the
Lagrangian with ``G_t(q) I(t)`` taken anew at every evaluation, from the torque curve itself. *Is the complete
plant of second order?* Voltage limit, back-EMF, delay, friction, payload and disturbance act at once; a fine
step of the same plant is the reference. Both engines answer both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.crosscheck.equations import equations_of
from spheretwin.crosscheck.scale import Scale, scale_of
from spheretwin.crosscheck.trajectories import (
    Convergence,
    convergence,
    order_check,
    reason_of,
    solve,
)
from spheretwin.linear import Magnetics
from spheretwin.loop import assembly
from spheretwin.loop.stages import PlantStage, call_advance, plant_stage
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.checks import Check, Checks
from spheretwin.models.base.compiled import compiled
from spheretwin.models.mjcf import read
from spheretwin.plant.plant_tick import GOING, PlantOutput, TickInput

ENGINES = {"MuJoCo": "mujoco", "Lagrangian": "lagrangian"}

DURATION_s = 0.3
SAMPLE_s = 0.01  # where motions are compared
STEP_s = 5e-4  # the default physics step
STEPS_s = (2e-3, 1e-3, 5e-4, 2.5e-4)
ORDER = 2

START_rad, START_rad_s = (0.2, -0.1, 0.3), (0.5, -1.0, 6.0)
AMPLITUDE_A, FREQUENCY_rad_s = 2.0, 2 * np.pi * 8
PHASE_rad = np.pi * (3 - np.sqrt(5))  # from a group to the next: the golden angle, so that no two agree

MARGIN = 10.0

PERIOD_s = 1e-3  # control period of the complete plant, over which commands are held
COMPLETE_STEPS_s = (5e-4, 2.5e-4, 1.25e-4, 6.25e-5)
FINE_s = PERIOD_s / 256
MOST_HALVINGS = 6
COMPLETE_AMPLITUDE_A = 4.0  # more than the supply drives through the resistance of a group
RESISTANCE_ohm, INDUCTANCE_H = 1.3, 9e-4
DISTURBANCE_Nm = (0.01, -0.005, 0.002)


def compare(mjcf: Path, actuator: Actuator) -> Checks:
    """Compare coil-driven motions with DOP853, and measure the order of the complete plant.

    Parameters
    ----------
    mjcf : Path
        Model file that the engines read.
    actuator : Actuator
        Its inertia and its torque curve are what the Lagrangian has.
    """
    scale = fitting_scale(mjcf, actuator)
    reference = integrate(mjcf, actuator, scale)
    acceleration = float(np.abs(np.diff(reference[:, 3:], axis=0)).max()) / SAMPLE_s
    bound = MARGIN * STEP_s**2 / 8 * acceleration
    motions, driven, complete = [], [], []
    for name, engine in ENGINES.items():
        measured = convergence(partial(by_plant, mjcf, scale, engine), reference, STEPS_s)
        motions.append(_motion(name, measured, bound))
        driven.append(_order(f"coil-driven, {name}", _DRIVEN, measured))
        fine = by_complete_plant(mjcf, scale, engine, FINE_s)
        measured = convergence(partial(by_complete_plant, mjcf, scale, engine), fine, COMPLETE_STEPS_s)
        complete.append(_order(f"complete plant, {name}", _COMPLETE, measured))
    return Checks([*motions, *driven, *complete])


def fitting_scale(mjcf: Path, actuator: Actuator) -> Scale:
    """Return a scale of currents and loads under which the complete plant stays within its range."""
    scale = scale_of(actuator)
    for _ in range(MOST_HALVINGS):
        states = by_complete_plant(mjcf, scale, "lagrangian", COMPLETE_STEPS_s[0])
        away = np.abs(states[:, :3] - scale.middle_rad) / (0.9 * scale.half_rad)
        if np.all(away < 1):  # False for NaN
            break
        less = {name: 0.5 * getattr(scale, name) for name in ("current", "torque", "payload")}
        scale = scale._replace(**less)
    return scale


def current_shares(t_s: float, groups: int) -> Array:
    """(n,) prescribed currents over their amplitude."""
    return np.sin(FREQUENCY_rad_s * t_s + PHASE_rad * np.arange(groups))


def mean_shares(duration_s: float, groups: int) -> Array:
    """(periods, n) means of the prescribed currents over periods of a duration, over their amplitude."""
    start_s = duration_s * np.arange(round(DURATION_s / duration_s), dtype=np.float64)
    phase = FREQUENCY_rad_s * start_s[:, None] + PHASE_rad * np.arange(groups)
    turned = FREQUENCY_rad_s * duration_s
    means: Array = (np.cos(phase) - np.cos(phase + turned)) / turned
    return means


def integrate(mjcf: Path, actuator: Actuator, scale: Scale) -> Array:
    """States at the samples by DOP853 on the Lagrangian, the torque matrix taken at every evaluation.

    Raises
    ------
    EngineError
        The integrator could not hold its tolerance.
    """
    groups, motion = len(actuator.groups), equations_of(mjcf, actuator)
    magnetics, amplitude_A = Magnetics(actuator, np.ones(groups)), scale.current * AMPLITUDE_A

    def flow(t: float, state: Array) -> Array:
        matrix = motion.hinge_matrix(state[:3].copy(), magnetics)
        return motion.flow(state, matrix @ (amplitude_A * current_shares(t, groups)))

    start = np.concatenate([scale.pose_rad(START_rad), scale.rates_rad_s(START_rad_s)])
    # The torque curve is a spline: its third derivative jumps, which no method of order eight likes better.
    tolerances = {"rtol": 1e-11, "atol": 1e-13}
    solved = solve("coil-driven reference", flow, (0, DURATION_s), start, t_eval=_samples_s(), **tolerances)
    states: Array = solved.y.T
    return states


def by_plant(mjcf: Path, scale: Scale, engine: str, step_s: float) -> Array:
    """States at the samples by the plant, its currents the means of the prescribed ones over each step."""
    fields = {"plant.engine": engine, "plant.step_s": step_s, "drive.time_constant_s": 0.0}
    return _driven(mjcf, fields, step_s, scale, AMPLITUDE_A, (0.0, 0.0, 0.0))


def by_complete_plant(mjcf: Path, scale: Scale, engine: str, step_s: float) -> Array:
    """States at the samples by the plant with all that acts in it, under commands held over each period."""
    fields = {**complete_fields(scale), "plant.engine": engine, "plant.step_s": step_s}
    return _driven(mjcf, fields, PERIOD_s, scale, COMPLETE_AMPLITUDE_A, DISTURBANCE_Nm)


def complete_fields(scale: Scale) -> dict[str, Any]:
    """Return the fields of the complete plant at a scale."""
    return {
        "plant.modelling_error": 0.2,
        "plant.modelling_torque_Nm": scale.torques_Nm((2e-3, 1e-3, 1e-3)),
        "plant.payload_kg": 0.05 * scale.payload,
        "plant.coulomb_Nm": scale.torques_Nm((2e-3, 2e-3, 2e-3)),
        "plant.viscous_Nm_s": (1e-4 * scale.inertia,) * 3,
        # The steps resolve a change of sign of friction, and the amplifiers: their order is measured.
        "plant.friction_smoothing_rad_s": 0.1 * scale.angle,
        "drive.bandwidth_rad_s": 1000.0,
        "drive.resistance_ohm": RESISTANCE_ohm / scale.current,
        "drive.inductance_H": INDUCTANCE_H / scale.current,
        "drive.supply_V": 4.0,
        "drive.delay_s": 1e-3,
    }


def _samples_s() -> Array:
    return SAMPLE_s * np.arange(round(DURATION_s / SAMPLE_s) + 1, dtype=np.float64)


def _driven(
    mjcf: Path,
    fields: Mapping[str, Any],
    period_s: float,
    scale: Scale,
    amplitude_A: float,
    disturbance: tuple[float, ...],
) -> Array:
    """States at the samples."""
    own = {
        "plant.initial_rad": scale.pose_rad(START_rad),
        "plant.initial_rad_s": scale.rates_rad_s(START_rad_s),
        "controller.period_s": period_s,
    }
    every = round(SAMPLE_s / period_s)
    torque = np.tile(scale.torques_Nm(disturbance), (round(DURATION_s / period_s), 1))

    def commands(groups: int) -> Array:
        return scale.current * amplitude_A * mean_shares(period_s, groups)

    return drive_plant(mjcf, {**own, **fields}, commands, torque, every)


def drive_plant(
    mjcf: Path, fields: Mapping[str, Any], commands: Callable[[int], Array], disturbance: Array, every: int
) -> Array:
    """Return the states of the plant at every so many ticks; no numbers after it left its workspace.

    Gravity acts on a payload alone.

    Parameters
    ----------
    mjcf : Path
        Model file that the engine reads.
    fields : mapping
        Fields of the scenario.
    commands : callable
        Returns the commanded currents (n, groups) of each tick, A.
    disturbance : (n, 3) array, N·m
        Against the motion, of each tick.
    every : int
        Ticks from one state to the next.
    """
    weightless = {} if read(mjcf).has_ideal_joint else {"plant.gravity_m_s2": 0.0}
    own = {"plant.mjcf": str(mjcf), **weightless, **fields}
    begun = initial_config(scenarios.load("hold", own), None, None)
    scenario, actuator = begun.scenario, begun.files.actuator
    groups, section = len(actuator.groups), scenario.plant
    rotor = assembly.rotor_of(scenario, begun.files)  # keep it: the stepped plant has addresses within it
    rotor.start(np.array(section.initial_rad), np.array(section.initial_rad_s))
    true = assembly.true_magnetics(section, scenario.seed, actuator)
    plant = assembly.empty_run(scenario, true, assembly.nominal_magnetics(scenario, begun.files))["plant"]
    assembly.fill_plant(plant, scenario, actuator, true, rotor.rows)
    states = np.full((len(disturbance) // every + 1, 6), np.nan)
    states[0] = [*section.initial_rad, *section.initial_rad_s]
    stage = plant_stage(plant, true.tables, section.engine)
    stage = stage._replace(plant=stage.plant[0])
    output = PlantOutput(np.empty(groups), np.empty(groups), np.empty(3))
    motion = plant["rotor"]["q"][0], plant["rotor"]["qdot"][0]
    _drive(stage, motion, commands(groups), disturbance, output, every, states)
    return states


@compiled
def _drive(
    stage: PlantStage,
    motion: tuple[Array, Array],
    commands: Array,
    disturbance: Array,
    delivered: PlantOutput,
    every: int,
    states: Array,
) -> None:
    for tick in range(commands.shape[0]):
        given = TickInput(commands[tick], disturbance[tick], delivered.torque_S[:0], 0)
        status = call_advance(stage.advance, stage.plant, stage.tables, stage.step, given, delivered)
        if status != GOING:
            return
        if (tick + 1) % every == 0:
            row = states[(tick + 1) // every]
            for i in range(3):
                row[i], row[3 + i] = motion[0][i], motion[1][i]


_DRIVEN = (
    f"currents of {AMPLITUDE_A:g} A at {FREQUENCY_rad_s / (2 * np.pi):g} Hz, a phase for each group,"
    f" {DURATION_s:g} s; reference DOP853 with G_t(q) I(t) at every evaluation"
)
_COMPLETE = (
    f"commands held over {1e3 * PERIOD_s:g} ms, with voltage limit, back-EMF, delay, friction, payload and"
    f" disturbance, {DURATION_s:g} s; reference the same plant at {1e3 * FINE_s:g} ms"
)


def _motion(name: str, measured: Convergence, bound: float) -> Check:
    return Check(
        name=f"coil-driven motion: {name}",
        compares=f"{_DRIVEN}; largest difference of any hinge angle at {1e3 * STEP_s:g} ms",
        states=round(DURATION_s / SAMPLE_s) + 1,
        value=float(measured.errors_rad[STEPS_s.index(STEP_s)]),
        bound=bound,
        why="the pose in the middle of a step is predicted without the acceleration, and torque is held:"
        " h²/8 times the largest acceleration, with a margin of ten; a field that lags by two microseconds"
        " breaks it, one that lags by half a step gives 3.5e-3",
        unit="rad",
        reason=reason_of(float(measured.errors_rad.max())),
    )


def _order(name: str, compares: str, measured: Convergence) -> Check:
    why = (
        f"order {ORDER}: the torque matrix and the back-EMF are those in the middle of a step, friction is"
        " split around it; taken at the start of a step, any of them makes it order 1. The margin is what"
        " the next power of the step adds at these steps"
    )
    return order_check(name, measured, ORDER, why, f"{compares}; ", "")
