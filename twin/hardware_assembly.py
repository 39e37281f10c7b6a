"""Assembly of sensors, drive, faults and supervision from a scenario."""

from __future__ import annotations

from math import inf

import numpy as np
from numpy.typing import NDArray

from spheretwin.control.supervision.fault_detector import NominalCurrents, fill_detector
from spheretwin.control.supervision.watchdog import MeasurementLimits, fill_watchdog
from spheretwin.electronics.drive_chain import DriveFaults, build_drive
from spheretwin.electronics.random_streams import Streams, width_of
from spheretwin.electronics.sensor_chain import build_sensors
from spheretwin.faults.effects import Effects
from spheretwin.faults.fault_injector import FaultInjector
from spheretwin.faults.schedule import FaultSchedule, noise_streams
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.record import Rows
from spheretwin.models.inductance import mutual_inductance
from spheretwin.plant.plant_tick import Plant
from spheretwin.scenario.plant_sections import ResolvedNominal
from spheretwin.scenario.sections import ResolvedScenario, Scenario

Array = NDArray[np.float64]


def draws_of(scenario: Scenario, groups: int) -> Array:
    """Return the array of the standard normal numbers of a tick, for faults and current sensors."""
    return np.zeros(width_of(fault_streams(scenario, groups)))


def fault_streams(scenario: Scenario, groups: int) -> Streams:
    """Return the random streams of the noise of faults and, as the last one, of the current sensors."""
    sensors = (("sensors.current noise", groups),) if scenario.sensors.current.noise_A > 0 else ()
    return (*noise_streams(scenario.fault, groups), *sensors)


def sensors_of(scenario: Scenario) -> Rows:
    """Return the sensors of a scenario, with errors drawn from its seed."""
    longest_delay = sum(_delays_s(scenario, "adc")) / scenario.controller.period_s
    return build_sensors(scenario.sensors, scenario.seed, bool(scenario.fault), round(longest_delay))


def _delays_s(scenario: Scenario, target: str) -> list[float]:
    """Return the delays that faults of a part can cause; they can act at the same time."""
    return [
        fault.effective_value
        for fault in scenario.fault
        if fault.mode == "delay" and fault.kind.name == target
    ]


def drive_of(scenario: ResolvedScenario, actuator: Actuator) -> Rows:
    """Return the drive of a resolved scenario, at rest; with fault inputs if faults are scheduled.

    A watchdog acts on the drive itself, so that it does not wait for delayed commands.
    """
    step_s = scenario.plant.step_s
    longest_delay = round(sum(_delays_s(scenario, "controller")) / step_s)
    faults = DriveFaults(bool(scenario.fault), longest_delay, scenario.watchdog.on)
    mutual_H = mutual_inductance(actuator) if scenario.drive.coil_coupling else None
    groups = len(actuator.groups)
    return build_drive(scenario.drive, step_s, scenario.substeps, groups, scenario.seed, faults, mutual_H)


def fill_supervision(rows: Rows, scenario: ResolvedScenario, actuator: Actuator) -> None:
    """Fill supervisions of groups, measurements and commands for a nominal actuator."""
    period_s, nominal = scenario.controller.period_s, scenario.nominal
    noise_rad, quantum_rad = np.array(nominal.angle_noise_rad), np.array(nominal.angle_resolution_rad)
    limits = MeasurementLimits(period_s, noise_rad, quantum_rad, actuator.hinge_range_rad)
    currents = _nominal_currents(nominal, period_s)
    fill_detector(rows["detector"], scenario.detector, scenario.detects, currents)
    fill_watchdog(rows["watchdog"], scenario.watchdog, limits)


def _nominal_currents(nominal: ResolvedNominal, period_s: float) -> NominalCurrents:
    """Return the tracking accuracy of fault-free currents according to the data sheet of the controller."""
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


def faults_of(scenario: ResolvedScenario, plant: Plant, sensors: Rows, groups: Rows) -> FaultInjector:
    """Return the fault injector of a scenario with the stages of its loop that faults modify."""
    period_s, count = scenario.controller.period_s, len(plant.current)
    schedule = FaultSchedule(scenario.fault, count, period_s, scenario.seed)
    effects = None
    if scenario.fault:
        effects = Effects(plant.drive, sensors, plant.group_gain, period_s, scenario.plant.step_s)
    return FaultInjector(schedule, effects, groups, plant.fault_modes, plant.fault_start_s)
