"""Warnings about a scenario and its model file: what is stated and not used, what does not occur."""

from __future__ import annotations

from math import inf

from spheretwin.config.active_config import inapplicable
from spheretwin.models import mjcf
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import distinct_texts
from spheretwin.models.curve_origin import disagreements
from spheretwin.models.mjcf import Mjcf
from spheretwin.plant.mujoco_rotor import integrator_name
from spheretwin.scenario.changes import first_tick, scheduled_changes
from spheretwin.scenario.files import Files
from spheretwin.scenario.hardware import amplifier_limit_A
from spheretwin.scenario.plant_sections import PlantSection
from spheretwin.scenario.sections import Scenario


def warnings_of(scenario: Scenario, files: Files) -> list[str]:
    """Return warnings about model and scenario, one line each."""
    late = [change for change in scheduled_changes(scenario) if change.tick >= scenario.ticks]
    return [
        *files.model.warnings,
        *disagreements(files.actuator),
        *_overridden(scenario.plant, files.model),
        *_hardware_warnings(scenario, files.actuator),
        *(f"the event that sets {change.name} does not occur: the run ends before" for change in late),
        *_late_faults(scenario),
    ]


def _hardware_warnings(scenario: Scenario, actuator: Actuator) -> list[str]:
    """Return a warning for what the hardware set states and the machine does not have or allow."""
    hardware, warnings = scenario.hardware, []
    if names := inapplicable(scenario, actuator):
        warnings.append(
            f"hardware {hardware} without {', '.join(names)}: the torque field has all poles in one"
        )
    model_A, set_A = actuator.group.current_limit_A, amplifier_limit_A(hardware)
    if isinstance(actuator.group.current_limits_A, tuple):
        warnings.append(
            f"the current limit of all groups is {model_A:.10g} A, the smallest that the model file states"
        )
    smaller_A = min(model_A, set_A)
    if set_A not in (inf, model_A) and scenario.drive.current_limit_A in (None, smaller_A):
        warnings.append(
            f"the current limit is {smaller_A:.10g} A, the smaller one of {model_A:.10g} A of the model file"
            f" and {set_A:.10g} A of hardware {hardware}"
        )
    return warnings


def _late_faults(scenario: Scenario) -> list[str]:
    """Return a warning for each fault that starts after the last control tick of the run."""
    period_s = scenario.controller.period_s
    return [
        f"the fault {fault.target} {fault.mode} does not occur: it starts at {fault.start_s:g} s,"
        f" the run ends at {scenario.duration:g} s"
        for fault in scenario.fault
        if first_tick(fault.start_s / period_s) >= scenario.ticks
    ]


def _overridden(section: PlantSection, model: Mjcf) -> list[str]:
    """Return a warning for each value that a model file states and a run does not use."""
    option, stated, given = model.described.opt, model.stated_options, section.gravity_m_s2
    warnings = []
    if "timestep" in stated and option.timestep != section.step_s:
        own, used = distinct_texts(option.timestep, section.step_s)
        warnings.append(f"the model's own timestep of {own} s is not used: plant.step_s is {used} s")
    integrator = integrator_name(option.integrator)
    if "integrator" in stated and integrator != section.integrator:
        warnings.append(
            f"the model's own integrator {integrator} is not used: plant.integrator is {section.integrator}"
        )
    gravity = mjcf.gravity(option)
    states_gravity = "gravity" in stated or not any(gravity)  # its flag can switch it off
    if given is not None and states_gravity and gravity != (0.0, 0.0, -given):
        own = " ".join(f"{component:.10g}" for component in gravity)
        warnings.append(
            f"the model's own gravity of {own} m/s² is not used: plant.gravity_m_s2 is {given:.10g} m/s²"
        )
    return warnings
