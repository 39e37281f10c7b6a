"""Telemetry channels: columns that a stage of the loop adds to the telemetry if it is active."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from numpy.typing import NDArray

from spheretwin.control.supervision.enabled_groups import IN_USE, STATES
from spheretwin.control.supervision.watchdog import REASONS
from spheretwin.electronics.drive_chain import write_telemetry as write_drive_telemetry
from spheretwin.electronics.sensor_chain import write_telemetry as write_sensor_telemetry
from spheretwin.faults.fault import MODES
from spheretwin.faults.schedule import part_names
from spheretwin.models.base.compiled import part_of_its_caller, uncompiled
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.plant.bristle_friction import log_cable, log_end_stops, log_presliding
from spheretwin.plant.cable import acts
from spheretwin.plant.magnet_heat import log_heat
from spheretwin.scenario.sections import Scenario


class Channel(NamedTuple):
    """Telemetry columns of one stage."""

    signals: Callable[[int], tuple[Signal, ...]]
    """Signals for a number of coil groups; the same tuple for the same number."""
    logged: Callable[[Scenario], bool]
    """True if a run of a resolved scenario has the channel."""
    write: Any
    """``write(row, plant)`` writes the columns into the beginning of `row`, once in each tick, after the
    plant has advanced. Its other arguments name the parts that it reads: one or two of `controller`,
    `sensors` and `plant`."""

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts that it reads."""
        code = uncompiled(self.write).__code__
        return code.co_varnames[1 : code.co_argcount]


@cache
def current_signals(groups: int) -> tuple[Signal, ...]:
    """Return the columns for a number of coil groups."""
    labels = tuple(f"group {j}" for j in range(groups))
    return (Signal("current_measured_A", "A", groups, "group currents as measured at the tick", labels),)


@part_of_its_caller
def write_currents(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    measured_A = plant.current_sensors[0].measured_A
    for j in range(measured_A.shape[0]):
        row[j] = measured_A[j]


MEASURED_CURRENTS = Channel(current_signals, lambda scenario: scenario.senses_currents, write_currents)


@cache
def drive_signals(groups: int) -> tuple[Signal, ...]:
    """Return the columns for a number of coil groups."""
    labels = tuple(f"group {j}" for j in range(groups))
    return (
        Signal("supply_power_W", "W", 1, "drawn from the supply, mean over the control period"),
        Signal("coil_power_W", "W", groups, "at the ends of the coils, mean over the control period", labels),
        Signal("copper_loss_W", "W", groups, "heat of the coils, mean over the control period", labels),
        Signal("coil_temperature_degC", "°C", groups, "at the end of the control period", labels),
        Signal("voltage_limited", "1", groups, "share of the period with the voltage at its limit", labels),
        Signal("current_limited", "1", groups, "share of the period with the current at its limit", labels),
    )


@part_of_its_caller
def write_drive(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    write_drive_telemetry(plant.drive[0], row)


DRIVE = Channel(drive_signals, lambda scenario: scenario.drive.supply_V is not None, write_drive)


NOT_YET = -1.0


@cache
def fault_signals(groups: int) -> tuple[Signal, ...]:
    """Return the columns for a number of coil groups."""
    labels = tuple(f"group {j}" for j in range(groups))
    names = part_names(groups)
    return (
        Signal("fault", "1", len(names), "how a part fails", names, ("works", *MODES)),
        Signal("group_out", "1", groups, "whether the allocation leaves a group out", labels, STATES),
        Signal(
            "time_to_detection_s",
            "s",
            groups,
            "from the start of a group's fault until it was left out; -1 as long as it is not",
            labels,
        ),
    )


@part_of_its_caller
def write_faults(row: NDArray, controller: Any, plant: Any) -> None:
    """Write the columns of one tick."""
    groups, parts = controller.data[0].supervision.groups, plant.fault_modes.shape[0]
    count = groups.out.shape[0]
    for part in range(parts):
        row[part] = plant.fault_modes[part]
    for j in range(count):
        out = groups.out[j]
        row[parts + j] = out
        is_detected = out != IN_USE and plant.fault_start_s[j] >= 0.0
        row[parts + count + j] = (
            max(groups.out_s[j] - plant.fault_start_s[j], 0.0) if is_detected else NOT_YET
        )


def _logs_faults(scenario: Scenario) -> bool:
    return scenario.supervises_groups


FAULTS = Channel(fault_signals, _logs_faults, write_faults)


FEED_FORWARD_SIGNALS = (
    Signal("feed_forward_Nm", "N·m", 3, "part of torque_command_Nm that is fed forward, generalised", ANGLES),
)


@part_of_its_caller
def write_feed_forward(row: NDArray, controller: Any) -> None:
    """Write the columns of one tick."""
    for i in range(3):
        row[i] = controller.data[0].compensators.feed_forward.torque_q[i]


def _logs_feed_forward(scenario: Scenario) -> bool:
    return scenario.controller.feed_forward.on


FEED_FORWARD = Channel(lambda groups: FEED_FORWARD_SIGNALS, _logs_feed_forward, write_feed_forward)


FRICTION_SIGNALS = (
    Signal("friction_Nm", "N·m", 3, "friction on the hinges, over the physics step that begins now", ANGLES),
)


@part_of_its_caller
def write_friction(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    for i in range(3):
        row[i] = plant.first_friction_q[i]


def _logs_friction(scenario: Scenario) -> bool:
    return any(scenario.plant.coulomb_Nm) or any(scenario.plant.viscous_Nm_s)


FRICTION = Channel(lambda groups: FRICTION_SIGNALS, _logs_friction, write_friction)


PRESLIDING_SIGNALS = (
    Signal("presliding_rad", "rad", 3, "elastic rotation within static friction, after the tick", ANGLES),
)


@part_of_its_caller
def write_presliding(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    log_presliding(plant.bristles[0], row)


PRESLIDING = Channel(
    lambda groups: PRESLIDING_SIGNALS, lambda scenario: scenario.plant.stiction.on, write_presliding
)


CABLE_SIGNALS = (
    Signal("cable_Nm", "N·m", 3, "cable on the hinges, over the physics step that begins now", ANGLES),
)


@part_of_its_caller
def write_cable(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    log_cable(plant.bristles[0], row)


CABLE = Channel(lambda groups: CABLE_SIGNALS, lambda scenario: acts(scenario.plant.cable), write_cable)


END_STOP_SIGNALS = (
    Signal(
        "end_stop_Nm", "N·m", 3, "end stops on the hinges, in the last physics step of the period", ANGLES
    ),
)


@part_of_its_caller
def write_end_stops(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    log_end_stops(plant.bristles[0], row)


END_STOPS = Channel(
    lambda groups: END_STOP_SIGNALS, lambda scenario: bool(scenario.plant.end_stops.on), write_end_stops
)


HEAT_SIGNALS = (
    Signal("stator_temperature_degC", "°C", 1, "at the end of the control period"),
    Signal("rotor_temperature_degC", "°C", 1, "of the magnets, at the end of the control period"),
)


@part_of_its_caller
def write_heat(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    log_heat(plant.heat[0], row)


HEAT = Channel(lambda groups: HEAT_SIGNALS, lambda scenario: scenario.plant.thermal.on, write_heat)


REFERENCE_GOVERNOR_SIGNALS = (
    Signal("q_governed_rad", "rad", 3, "desired hinge angles as the governor has them", ANGLES),
    Signal("qdot_governed_rad_s", "rad/s", 3, "desired hinge rates as the governor has them", ANGLES),
    Signal(
        "qddot_governed_rad_s2", "rad/s²", 3, "desired accelerations as the governor has them, held", ANGLES
    ),
)


@part_of_its_caller
def write_reference_governor(row: NDArray, controller: Any) -> None:
    """Write the columns of one tick."""
    motion = controller.data[0].compensators.governor.motion
    for part in range(3):
        for i in range(3):
            row[3 * part + i] = motion[part, i]


def _logs_reference_governor(scenario: Scenario) -> bool:
    return scenario.controller.governor.on


REFERENCE_GOVERNOR = Channel(
    lambda groups: REFERENCE_GOVERNOR_SIGNALS, _logs_reference_governor, write_reference_governor
)


SENSOR_SIGNALS = (
    Signal("q_measured_rad", "rad", 3, "hinge angles as the controller has them", ANGLES),
    Signal("qdot_estimated_rad_s", "rad/s", 3, "hinge rates as the controller has them", ANGLES),
)


@part_of_its_caller
def write_sensors(row: NDArray, controller: Any) -> None:
    """Write the columns of one tick."""
    for i in range(3):
        row[i], row[3 + i] = controller.data[0].pose[i], controller.data[0].rates[i]


def _logs_sensors(scenario: Scenario) -> bool:
    return not scenario.measures_truth


SENSORS = Channel(lambda groups: SENSOR_SIGNALS, _logs_sensors, write_sensors)


SENSOR_STATE_SIGNALS = (
    Signal(
        "sensor_state_error_rad",
        "rad",
        3,
        "error of each angle by the state of its sensor: play of the wiper (α, β), count not referenced (γ)",
        ANGLES,
    ),
)


@part_of_its_caller
def write_sensor_states(row: NDArray, sensors: Any) -> None:
    """Write the columns of one tick."""
    write_sensor_telemetry(sensors[0], row)


def _logs_sensor_states(scenario: Scenario) -> bool:
    sensors = scenario.sensors
    return sensors.potentiometer.hysteresis_rad > 0 or sensors.encoder.start_error_rad > 0


SENSOR_STATES = Channel(lambda groups: SENSOR_STATE_SIGNALS, _logs_sensor_states, write_sensor_states)


PREDICTION_SIGNALS = (
    Signal("q_predicted_rad", "rad", 3, "hinge angles predicted over the known delay", ANGLES),
    Signal("qdot_predicted_rad_s", "rad/s", 3, "hinge rates predicted over the known delay", ANGLES),
)


@part_of_its_caller
def write_prediction(row: NDArray, controller: Any) -> None:
    """Write the columns of one tick."""
    prediction = controller.data[0].compensators.prediction
    for i in range(3):
        row[i], row[3 + i] = prediction.pose[i], prediction.rates[i]


def _logs_prediction(scenario: Scenario) -> bool:
    return scenario.controller.prediction.on


PREDICTION = Channel(lambda groups: PREDICTION_SIGNALS, _logs_prediction, write_prediction)


WATCHDOG_SIGNALS = (
    Signal(
        "failsafe_reason",
        "1",
        1,
        "why the watchdog has taken the currents away",
        states=tuple(reason.text for reason in REASONS.values()),
    ),
)


@part_of_its_caller
def write_watchdog(row: NDArray, controller: Any) -> None:
    """Write the columns of one tick."""
    row[0] = controller.data[0].supervision.watchdog.reason


WATCHDOG = Channel(lambda groups: WATCHDOG_SIGNALS, lambda scenario: scenario.watchdog.on, write_watchdog)


CHANNELS: tuple[Channel, ...] = (
    SENSORS,
    SENSOR_STATES,
    MEASURED_CURRENTS,
    REFERENCE_GOVERNOR,
    PREDICTION,
    FEED_FORWARD,
    FRICTION,
    PRESLIDING,
    CABLE,
    END_STOPS,
    HEAT,
    DRIVE,
    FAULTS,
    WATCHDOG,
)
