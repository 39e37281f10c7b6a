"""Telemetry channels: columns that a stage of the loop adds to the telemetry if it is active.

A channel is one function: its decorator declares the columns and the scenarios that log them.
"""

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
from spheretwin.models.base.compiled import inlined, uncompiled
from spheretwin.models.telemetry.signals import ANGLES, Signal, offsets
from spheretwin.plant.bristle_friction import log_cable, log_end_stops, log_presliding
from spheretwin.plant.cable import acts
from spheretwin.plant.learned_torque import log_learned_torque
from spheretwin.plant.magnet_heat import log_heat
from spheretwin.scenario.sections import Scenario

Column = Callable[[int], Signal]
"""Signal for a number of coil groups."""


class TelemetryChannel(NamedTuple):
    """Telemetry columns of one stage."""

    signals: Callable[[int], tuple[Signal, ...]]
    """Signals for a number of coil groups; the same tuple for the same number."""
    logged: Callable[[Scenario], bool]
    """True if a run of a resolved scenario has the channel."""
    write: Any
    """``write(row, plant)`` writes the columns into the beginning of `row`, once in each tick, after the
    plant has advanced. Its other arguments name the parts that it reads: one or two of `controller`,
    `sensors`, `plant` and `hall`."""

    of_readings: bool = False
    """True if the number is that of the readings of the Hall array, not of the groups."""

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts that it reads."""
        code = uncompiled(self.write).__code__
        return code.co_varnames[1 : code.co_argcount]


def channel(
    logged: Callable[[Scenario], bool], *columns: Column, of_readings: bool = False
) -> Callable[[Any], TelemetryChannel]:
    """Decorate the function that writes the columns of a channel.

    Parameters
    ----------
    logged, write, of_readings
        As in `TelemetryChannel`.
    *columns : callable
        Columns in their order.
    """

    @cache
    def signals(groups: int) -> tuple[Signal, ...]:
        return tuple(column(groups) for column in columns)

    return lambda write: TelemetryChannel(signals, logged, inlined(write), of_readings)


def single(name: str, unit: str, meaning: str, states: tuple[str, ...] = ()) -> Column:
    """Return a column of one number."""
    return lambda groups: Signal(name, unit, 1, meaning, states=states)


def each_hinge(name: str, unit: str, meaning: str) -> Column:
    """Return a column with a number for each hinge."""
    return lambda groups: Signal(name, unit, 3, meaning, ANGLES)


def each_group(name: str, unit: str, meaning: str, states: tuple[str, ...] = ()) -> Column:
    """Return a column with a number for each coil group."""
    return lambda groups: Signal(
        name, unit, groups, meaning, tuple(f"group {j}" for j in range(groups)), states
    )


def each_reading(name: str, unit: str, meaning: str) -> Column:
    """Return a column with a number for each reading of the Hall array."""
    return lambda readings: Signal(
        name, unit, readings, meaning, tuple(f"reading {r}" for r in range(readings))
    )


def each_part(name: str, unit: str, meaning: str, states: tuple[str, ...]) -> Column:
    """Return a column with a number for each part that can fail."""
    return lambda groups: Signal(name, unit, len(part_names(groups)), meaning, part_names(groups), states)


@channel(
    lambda scenario: not scenario.measures_truth,
    each_hinge("q_measured_rad", "rad", "hinge angles as the controller has them"),
    each_hinge("qdot_estimated_rad_s", "rad/s", "hinge rates as the controller has them"),
)
def sensed_motion(row: NDArray, controller: Any) -> None:
    """Write the columns of one tick."""
    for i in range(3):
        row[i], row[3 + i] = controller.pose[i], controller.rates[i]


@channel(
    lambda scenario: (
        scenario.sensors.potentiometer.hysteresis_rad > 0 or scenario.sensors.encoder.start_error_rad > 0
    ),
    each_hinge(
        "sensor_state_error_rad",
        "rad",
        "error of each angle by the state of its sensor: play of the wiper (α, β), count not referenced (γ)",
    ),
)
def sensor_states(row: NDArray, sensors: Any) -> None:
    """Write the columns of one tick."""
    write_sensor_telemetry(sensors, row)


@channel(
    lambda scenario: scenario.senses_currents,
    each_group("current_measured_A", "A", "group currents as measured at the tick"),
)
def measured_currents(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    measured_A = plant.current_sensors.measured_A
    for j in range(measured_A.shape[0]):
        row[j] = measured_A[j]


@channel(
    lambda scenario: scenario.sensors.hall.on,
    each_reading("hall_field_T", "T", "field as the Hall array reads it, at the tick"),
    single("hall_innovation_T", "T", "readings less the field that the pose filter predicts, rms"),
    single("hall_remanence", "1", "remanence as the pose filter estimates it, over the nominal one"),
    of_readings=True,
)
def hall_array(row: NDArray, hall: Any) -> None:
    """Write the columns of one tick."""
    readings = hall.reading_T.shape[0]
    for r in range(readings):
        row[r] = hall.reading_T[r]
    row[readings], row[readings + 1] = hall.pose.innovation_T, hall.pose.remanence


@channel(
    lambda scenario: scenario.controller.governor.on,
    each_hinge("q_governed_rad", "rad", "desired hinge angles as the governor has them"),
    each_hinge("qdot_governed_rad_s", "rad/s", "desired hinge rates as the governor has them"),
    each_hinge("qddot_governed_rad_s2", "rad/s²", "desired accelerations as the governor has them, held"),
)
def reference_governor(row: NDArray, controller: Any) -> None:
    """Write the columns of one tick."""
    motion = controller.compensators.governor.motion
    for part in range(3):
        for i in range(3):
            row[3 * part + i] = motion[part, i]


@channel(
    lambda scenario: scenario.controller.prediction.on,
    each_hinge("q_predicted_rad", "rad", "hinge angles predicted over the known delay"),
    each_hinge("qdot_predicted_rad_s", "rad/s", "hinge rates predicted over the known delay"),
)
def prediction(row: NDArray, controller: Any) -> None:
    """Write the columns of one tick."""
    predicted = controller.compensators.prediction
    for i in range(3):
        row[i], row[3 + i] = predicted.pose[i], predicted.rates[i]


@channel(
    lambda scenario: scenario.controller.feed_forward.on,
    each_hinge("feed_forward_Nm", "N·m", "part of torque_command_Nm that is fed forward, generalised"),
)
def feed_forward(row: NDArray, controller: Any) -> None:
    """Write the columns of one tick."""
    for i in range(3):
        row[i] = controller.compensators.feed_forward.torque_q[i]


@channel(
    lambda scenario: any(scenario.plant.coulomb_Nm) or any(scenario.plant.viscous_Nm_s),
    each_hinge("friction_Nm", "N·m", "friction on the hinges, over the physics step that begins now"),
)
def friction(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    for i in range(3):
        row[i] = plant.first_friction_q[i]


@channel(
    lambda scenario: scenario.plant.stiction.on,
    each_hinge("presliding_rad", "rad", "elastic rotation within static friction, after the tick"),
)
def presliding(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    log_presliding(plant.parts.bristles, row)


@channel(
    lambda scenario: acts(scenario.plant.cable),
    each_hinge("cable_Nm", "N·m", "cable on the hinges, over the physics step that begins now"),
)
def cable(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    log_cable(plant.parts.bristles, row)


@channel(
    lambda scenario: bool(scenario.plant.end_stops.on),
    each_hinge("end_stop_Nm", "N·m", "end stops on the hinges, in the last physics step of the period"),
)
def end_stops(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    log_end_stops(plant.parts.bristles, row)


@channel(
    lambda scenario: scenario.plant.thermal.on,
    single("stator_temperature_degC", "°C", "at the end of the control period"),
    single("rotor_temperature_degC", "°C", "of the magnets, at the end of the control period"),
)
def heat(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    log_heat(plant.parts.heat, row)


@channel(
    lambda scenario: bool(scenario.plant.learned_torque.file),
    each_hinge("learned_torque_Nm", "N·m", "learned torque on the hinges, in the last physics step"),
    single(
        "learned_share", "1", "factor of the learned torque: 1 within the range of its logs, 0 far outside"
    ),
)
def learned_torque(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    log_learned_torque(plant.parts.learned_torque, row)


@channel(
    lambda scenario: scenario.drive.supply_V is not None,
    single("supply_power_W", "W", "drawn from the supply, mean over the control period"),
    each_group("coil_power_W", "W", "at the ends of the coils, mean over the control period"),
    each_group("copper_loss_W", "W", "heat of the coils, mean over the control period"),
    each_group("coil_temperature_degC", "°C", "at the end of the control period"),
    each_group("voltage_limited", "1", "share of the period with the voltage at its limit"),
    each_group("current_limited", "1", "share of the period with the current at its limit"),
)
def drive(row: NDArray, plant: Any) -> None:
    """Write the columns of one tick."""
    write_drive_telemetry(plant.drive, row)


NOT_YET = -1.0


@channel(
    lambda scenario: scenario.supervises_groups,
    each_part("fault", "1", "how a part fails", ("works", *MODES)),
    each_group("group_out", "1", "whether the allocation leaves a group out", STATES),
    each_group(
        "time_to_detection_s",
        "s",
        "from the start of a group's fault until it was left out; -1 as long as it is not",
    ),
)
def faults(row: NDArray, controller: Any, plant: Any) -> None:
    """Write the columns of one tick."""
    groups, parts = controller.supervision.groups, plant.fault_modes.shape[0]
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


@channel(
    lambda scenario: scenario.watchdog.on,
    single(
        "failsafe_reason",
        "1",
        "why the watchdog has taken the currents away",
        tuple(reason.text for reason in REASONS.values()),
    ),
)
def watchdog(row: NDArray, controller: Any) -> None:
    """Write the columns of one tick."""
    row[0] = controller.supervision.watchdog.reason


CHANNELS: tuple[TelemetryChannel, ...] = (
    sensed_motion,
    sensor_states,
    measured_currents,
    hall_array,
    reference_governor,
    prediction,
    feed_forward,
    friction,
    presliding,
    cable,
    end_stops,
    heat,
    learned_torque,
    drive,
    faults,
    watchdog,
)


def logged_channels(signals: tuple[Signal, ...]) -> list[tuple[TelemetryChannel, int]]:
    """Return the channels among the columns of a telemetry, with their first columns."""
    first = offsets(signals)
    return [(channel, first[name]) for channel in CHANNELS if (name := channel.signals(1)[0].name) in first]
