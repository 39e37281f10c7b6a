"""What both sides of a loop touch, and the stages that a fault can modify or that look after it."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.controller import Supervision
from spheretwin.control.supervision.enabled_groups import EnabledGroups
from spheretwin.control.supervision.enabled_groups import groups as all_in_use
from spheretwin.control.supervision.fault_detector import NominalCurrents, detector
from spheretwin.control.supervision.watchdog import MeasurementLimits, watchdog
from spheretwin.electronics import drive
from spheretwin.electronics import sensors as senses
from spheretwin.electronics.drive import Stages
from spheretwin.electronics.drive_chain import DriveChain, DriveFaults
from spheretwin.electronics.random_streams import Streams, width_of
from spheretwin.electronics.sensor_chain import SensorChain, SensorFaults
from spheretwin.electronics.sensors import Sensors
from spheretwin.faults.effects import Effects
from spheretwin.faults.fault_injector import FaultInjector
from spheretwin.faults.schedule import FaultPlan, noise_streams
from spheretwin.models.actuator import Actuator
from spheretwin.plant.step import Plant
from spheretwin.scenario.sections import ResolvedNominal, ResolvedScenario, Scenario

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
    draws = np.zeros(width_of(fault_streams(scenario, groups)))
    return Wires(np.ones(3), np.zeros(1, dtype=np.int64), draws)


def fault_streams(scenario: Scenario, groups: int) -> Streams:
    """Random streams of the noise of faults, and last, those of the sensors of currents."""
    sensors = (("sensors.current noise", groups),) if scenario.sensors.current.noise_A > 0 else ()
    return (*noise_streams(scenario.fault, groups), *sensors)


def sensors_of(scenario: Scenario, wires: Wires) -> Sensors:
    """Sensors of a scenario, with the errors that its seed gives them."""
    if not scenario.fault:
        return senses.made(scenario.sensors, scenario.seed)
    most_late = sum(_delays_s(scenario, "adc")) / scenario.controller.period_s
    faults = SensorFaults(round(most_late), wires.fresh, wires.draws)
    return senses.made(scenario.sensors, scenario.seed, faults)


def _delays_s(scenario: Scenario, target: str) -> list[float]:
    """Delays that faults of a part may bring, all at once."""
    return [each.number for each in scenario.fault if each.mode == "delay" and each.kind.name == target]


def driving_of(scenario: ResolvedScenario, groups: int, wires: Wires) -> Stages:
    """Drive of a resolved scenario, at rest; with what may fail where faults are planned.

    A watchdog acts on the drive itself: it would else wait for commands that are on their way.
    """
    step_s, faults = scenario.plant.step_s, None
    if scenario.fault or scenario.watchdog.on:
        most_late = round(sum(_delays_s(scenario, "controller")) / step_s)
        faults = DriveFaults(bool(scenario.fault), most_late, wires.halt, wires.draws)
    return drive.made(scenario.drive, step_s, scenario.substeps, groups, scenario.seed, faults)


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
    limits = MeasurementLimits(period_s, noise_rad, quantum_rad, actuator.hinge_range_rad)
    return Supervision(
        all_in_use(groups),
        detector(scenario.detector, scenario.detects, groups, _nominal_currents(nominal, period_s)),
        watchdog(scenario.watchdog, limits, wires.fresh, wires.halt),
    )


def _nominal_currents(nominal: ResolvedNominal, period_s: float) -> NominalCurrents:
    """How well healthy currents follow, by the controller's data sheet."""
    return NominalCurrents(
        period_s=period_s,
        current_limit_A=nominal.current_limit_A,
        static_error_A=nominal.offset_error_A + nominal.gain_error * nominal.current_limit_A,
        noise_A=nominal.current_noise_A,
        time_constant_s=nominal.time_constant_s,
        swing_V=nominal.swing_V if nominal.swing_V > 0 else inf,
        resistance_ohm=nominal.resistance_ohm,
        inductance_H=nominal.inductance_H,
    )


def faults_of(
    scenario: ResolvedScenario, plant: Plant, sensors: Sensors, groups: EnabledGroups
) -> FaultInjector:
    """Faults of a scenario, and the stages of its loop that they modify."""
    period_s, count = scenario.controller.period_s, len(plant.current)
    plan = FaultPlan(scenario.fault, count, period_s, scenario.seed)
    effects = None
    if isinstance(plant.driving, DriveChain) and isinstance(sensors, SensorChain):
        effects = Effects(plant.driving, sensors, plant.group_gain, period_s, scenario.plant.step_s)
    return FaultInjector(plan, effects, groups, plant.marks, plant.began_s)
