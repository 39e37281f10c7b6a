"""Assembly of sensors, drive, faults and supervision from a scenario."""

from __future__ import annotations

from math import inf

import numpy as np

from spheretwin.control.applied_torque import delay_capacity
from spheretwin.control.supervision.fault_detector import NominalCurrents, fill_detector
from spheretwin.control.supervision.watchdog import MeasurementLimits, fill_watchdog
from spheretwin.electronics.drive_chain import fill_drive, stored_delays
from spheretwin.electronics.random_streams import Streams
from spheretwin.faults.fault_injector import FaultInjector
from spheretwin.faults.schedule import FaultSchedule, noise_streams
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.record import Rows, capacity
from spheretwin.models.inductance import mutual_inductance
from spheretwin.scenario.plant_sections import ResolvedNominal
from spheretwin.scenario.sections import ResolvedScenario, Scenario


def fault_streams(scenario: Scenario, groups: int) -> Streams:
    """Return the random streams of the noise of faults and, as the last one, of the current sensors."""
    sensors = (
        (("sensors.current noise", groups),)
        if np.any(np.greater(scenario.sensors.current.noise_A, 0))
        else ()
    )
    return (*noise_streams(scenario.fault, groups), *sensors)


def delays_of(scenario: ResolvedScenario) -> dict[str, int]:
    """Return the sizes of the histories of sensors, drive and controller: those of many runs, the largest."""
    nominal, period_s = scenario.nominal, scenario.controller.period_s
    in_sensors, in_drive = (np.max(sum(_delays_s(scenario, target))) for target in ("adc", "controller"))
    step_s = scenario.plant.step_s
    in_drive_steps = round(float(in_drive / step_s))
    return {
        "sensor_delays": capacity(round(float(in_sensors / period_s)) + 1),
        "drive_delays": stored_delays(scenario.drive, step_s, scenario.substeps, in_drive_steps),
        "command_delays": delay_capacity(nominal.delay_s, period_s),
    }


def _delays_s(scenario: Scenario, target: str) -> list[float]:
    """Return the delays that faults of a part can cause; they can act at the same time."""
    return [
        fault.effective_value
        for fault in scenario.fault
        if fault.mode == "delay" and fault.kind.name == target
    ]


def fill_drive_of(rows: Rows, scenario: ResolvedScenario, actuator: Actuator) -> None:
    """Fill the drive of a resolved scenario, at rest; with fault inputs if faults are scheduled.

    A watchdog acts on the drive itself, so that it does not wait for delayed commands.
    """
    mutual_H = mutual_inductance(actuator) if np.any(scenario.drive.coil_coupling) else None
    step_s, faulty, halts = scenario.plant.step_s, bool(scenario.fault), scenario.watchdog.on
    fill_drive(rows, scenario.drive, step_s, scenario.substeps, scenario.seed, faulty, halts, mutual_H)


def fill_supervision(rows: Rows, scenario: ResolvedScenario, actuator: Actuator) -> None:
    """Fill supervisions of groups, measurements and commands for a nominal actuator."""
    period_s, nominal = scenario.controller.period_s, scenario.nominal
    errors_rad = nominal.angle_noise_rad, nominal.angle_resolution_rad
    limits = MeasurementLimits(period_s, *errors_rad, actuator.hinge_range_rad)
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
        swing_V=np.where(np.greater(nominal.swing_V, 0), nominal.swing_V, inf),
        resistance_ohm=nominal.resistance_ohm,
        inductance_H=nominal.inductance_H,
    )


def faults_of(scenario: ResolvedScenario, run: Rows) -> FaultInjector:
    """Return the fault injector of a scenario for its run, an array of one RunData."""
    groups = run["plant"]["current"].shape[1]
    schedule = FaultSchedule(scenario.fault, groups, scenario.controller.period_s, scenario.seed)
    return FaultInjector(schedule, run, scenario.plant.step_s)
