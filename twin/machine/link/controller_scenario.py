"""Scenario of the controller alone, whose plant is a real machine, and what that measures."""

from __future__ import annotations

from typing import Any

import numpy as np

from spheretwin.electronics.drive_section import DriveSection
from spheretwin.electronics.sensor_chain import SensorsSection
from spheretwin.loop.external import Measurement
from spheretwin.machine.link.codec import Values
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.plant_sections import NominalSection, PlantSection
from spheretwin.scenario.sections import ResolvedScenario, Scenario
from spheretwin.trajectories.disturbances import Disturbance

PLANT_SECTIONS = frozenset({"plant", "drive", "sensors", "disturbance", "fault"})
"""Sections that describe the machine: the machine itself replaces them."""


def check_measurement(scenario: Scenario, measurement: Measurement) -> None:
    """Check that a machine reports all that the controller of a scenario needs.

    Raises
    ------
    InputError
        It reports no rates, and there is no estimator; or no currents, and the fault detector is on.
    """
    if measurement.rate_rad_s is None and scenario.estimator.kind == "ideal":
        raise InputError(
            "drive: expected an estimator of the rates, such as --estimator.kind kalman, because the machine"
            " reports none; received ideal"
        )
    if measurement.current_A is None and scenario.detects:
        raise InputError(
            "drive: expected a machine that reports currents with detector.detect, received one without"
        )


def left_out(scenario: Scenario) -> list[str]:
    """Return a line for each fault and event of a scenario that the controller alone cannot have."""
    faults = [f"the fault {fault.target} {fault.mode}" for fault in scenario.fault]
    events = [f"the event that sets {event.set}" for event in scenario.event if _is_of_plant(event.set)]
    return [f"{name} does not occur: the machine is real" for name in (*faults, *events)]


def _is_of_plant(field: str) -> bool:
    return field.split(".")[0] in PLANT_SECTIONS


def controller_scenario(
    scenario: ResolvedScenario, measurement: Measurement, current_limit_A: float
) -> Scenario:
    """Return the scenario of the controller of a run.

    It has the data sheet (`nominal`), the law, the trajectory and the supervision of the run, with the
    watchdog on. Faults and events of the machine are left out.

    Parameters
    ----------
    scenario : ResolvedScenario
        Scenario of the complete run.
    measurement : Measurement
        First measurement.
    current_limit_A : float
        Largest current of a group that is commanded.
    """
    plant = scenario.plant
    nominal = NominalSection(
        **{
            **scenario.nominal.model_dump(),
            "equals_truth": False,
            "current_limit_A": min(current_limit_A, scenario.nominal.current_limit_A),
        }
    )
    rates = measurement.rate_rad_s
    pose_and_rates = {
        "initial_rad": tuple(measurement.angle_rad.tolist()),
        "initial_rad_s": (0.0, 0.0, 0.0) if rates is None else tuple(rates.tolist()),
    }
    fields = {
        **{name: getattr(scenario, name) for name in Scenario.model_fields},
        "hardware": "ideal",
        "nominal": nominal,
        "plant": PlantSection(
            engine=plant.engine, step_s=plant.step_s, mjcf=plant.mjcf, payload_kg=plant.payload_kg
        ).model_copy(update=pose_and_rates),
        "sensors": SensorsSection(),
        "drive": DriveSection(),
        "disturbance": Disturbance(),
        "fault": (),
        "detector": scenario.detector.model_copy(update={"detect": scenario.detects}),
        "watchdog": scenario.watchdog.model_copy(update={"on": True}),
        "event": tuple(event for event in scenario.event if not _is_of_plant(event.set)),
    }
    return Scenario.model_construct(**fields)


def measurement_of(frame: Values) -> Measurement:
    """Return the values of a frame; None for those that it does not have, or that are all NaN."""
    rate, current, temperature = (frame.get(name) for name in ("rate", "current", "temperature"))
    return Measurement(
        frame["angle"],
        *(None if np.all(np.isnan(_numbers(value))) else value for value in (rate, current, temperature)),
    )


def _numbers(value: Any) -> Any:
    return np.nan if value is None else value


def is_finite(measurement: Measurement) -> bool:
    """Return whether all values of a measurement are finite numbers."""
    return all(value is None or np.all(np.isfinite(value)) for value in measurement)
