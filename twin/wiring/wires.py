"""What both sides of a loop touch, and the stages that a fault can strike or that look after it."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.controller import Supervision
from spheretwin.control.supervision.detector import Followed, detector
from spheretwin.control.supervision.groups import Groups
from spheretwin.control.supervision.groups import groups as all_in_use
from spheretwin.control.supervision.watchdog import Watched, watchdog
from spheretwin.models.actuator import Actuator
from spheretwin.twin.electronics.driving import stages
from spheretwin.twin.electronics.driving.faulty import FaultyDriving, drive_faults
from spheretwin.twin.electronics.driving.stages import Stages
from spheretwin.twin.electronics.sensing import stages as senses
from spheretwin.twin.electronics.sensing.faulty import FaultySensing, sensor_faults
from spheretwin.twin.electronics.sensing.stages import Sensors
from spheretwin.twin.faults.plan import FaultPlan, draws_width
from spheretwin.twin.faults.target import Effects
from spheretwin.twin.faults.work import FaultsAtWork
from spheretwin.twin.plant.plant import Plant
from spheretwin.twin.scenario.sections import ResolvedNominal, ResolvedScenario, Scenario

Array = NDArray[np.float64]


class Wires(NamedTuple):
    """What the near and the far side of the loop both touch, beside measurements and commands."""

    fresh: Array
    """(3,) the sensors write which angles are new, a watchdog reads it."""
    halt: NDArray[np.int64]
    """(1,) a watchdog writes whether there shall be currents, the drive reads it."""
    draws: Array
    """Standard normal numbers of a tick, for faults and for the sensors of currents."""


def wires_of(scenario: Scenario, groups: int) -> Wires:
    """Wires of a scenario's loop."""
    width = draws_width(groups) if scenario.draws_for_faults else 0
    return Wires(np.ones(3), np.zeros(1, dtype=np.int64), np.zeros(width))


def sensors_of(scenario: Scenario, wires: Wires) -> Sensors:
    """Sensors of a scenario, with the errors that its seed gives them."""
    if not scenario.fault:
        return senses.made(scenario.sensors, scenario.seed)
    most_late = sum(_delays_s(scenario, "adc")) / scenario.controller.period_s
    faults = sensor_faults(round(most_late), wires.fresh, wires.draws)
    return senses.made(scenario.sensors, scenario.seed, faults)


def _delays_s(scenario: Scenario, target: str) -> list[float]:
    """Delays that faults of a part may bring, all at once."""
    return [each.number for each in scenario.fault if each.mode == "delay" and each.kind.name == target]


def driving_of(scenario: ResolvedScenario, groups: int, wires: Wires) -> Stages:
    """Drive of a resolved scenario, at rest; with what may fail where faults are planned.

    A watchdog acts on the drive itself: it would else wait for commands that are on their way.
    """
    step_s, faults, most_late = scenario.plant.step_s, None, 0
    if scenario.fault or scenario.watchdog.on:
        faults = drive_faults(groups, wires.halt, wires.draws)
        most_late = round(sum(_delays_s(scenario, "controller")) / step_s)
    return stages.made(scenario.drive, step_s, scenario.substeps, groups, scenario.seed, faults, most_late)


def supervision_of(scenario: ResolvedScenario, actuator: Actuator, wires: Wires) -> Supervision:
    """What looks after the groups, the measurements and the commands.

    Parameters
    ----------
    scenario : ResolvedScenario
    actuator : Actuator
        As the controller has it.
    wires : Wires
    """
    groups, period_s, nominal = len(actuator.groups), scenario.controller.period_s, scenario.nominal
    noise_rad, quantum_rad = np.array(nominal.angle_noise_rad), np.array(nominal.angle_resolution_rad)
    watched = Watched(period_s, noise_rad, quantum_rad, actuator.hinge_range_rad)
    return Supervision(
        all_in_use(groups),
        detector(scenario.detector, scenario.detects, groups, _followed(nominal, period_s)),
        watchdog(scenario.watchdog, watched, wires.fresh, wires.halt),
    )


def _followed(nominal: ResolvedNominal, period_s: float) -> Followed:
    """How well healthy currents follow, by the controller's data sheet."""
    return Followed(
        period_s=period_s,
        current_limit_A=nominal.current_limit_A,
        static_error_A=nominal.offset_error_A + nominal.gain_error * nominal.current_limit_A,
        noise_A=nominal.current_noise_A,
        time_constant_s=nominal.time_constant_s,
        swing_V=nominal.swing_V if nominal.swing_V > 0 else inf,
        resistance_ohm=nominal.resistance_ohm,
        inductance_H=nominal.inductance_H,
    )


def faults_of(scenario: ResolvedScenario, plant: Plant, sensors: Sensors, groups: Groups) -> FaultsAtWork:
    """Faults of a scenario, and the parts of its loop that they strike."""
    period_s, count = scenario.controller.period_s, len(plant.current)
    plan = FaultPlan(scenario.fault, count, period_s, scenario.seed)
    effects = None
    if isinstance(plant.driving, FaultyDriving) and isinstance(sensors, FaultySensing):
        track = scenario.sensors.potentiometer
        effects = Effects(
            drive=plant.driving.faults,
            sensors=sensors.faults,
            group_gain=plant.group_gain,
            transconductance_A_V=scenario.drive.transconductance_A_V,
            volts_per_rad=track.volts_per_rad,
            track_V=track.supply_V,
            period_s=period_s,
            step_s=scenario.plant.step_s,
        )
    return FaultsAtWork(plan, effects, groups, plant.marks, plant.began_s)
