"""Check of a log against the scenario of its machine: findings and a verdict."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.active_config import initial_config
from spheretwin.machine.findings import ERROR, FINDINGS, Evidence, Finding, Machine
from spheretwin.machine.log import Log
from spheretwin.models.base.errors import InputError
from spheretwin.plant_model import parameters_of
from spheretwin.scenario.changes import with_change
from spheretwin.scenario.plant_sections import PlantSection
from spheretwin.scenario.sections import Scenario

# What a seed draws belongs to another machine; elements with states are not in the torque balance.
LEFT_OUT = ("stiction", "cable", "poles", "coils", "mass", "thermal")


@dataclass(frozen=True)
class Verdict:
    """Verdict on a log.

    Attributes
    ----------
    findings : tuple of Finding
        In the order of `FINDINGS`.
    rows : int
        Rows of the log.
    rate_Hz : float or None
        Rows per second; None without two rising times.
    accepted_findings : tuple of str
        Names of findings that the user has accepted.
    identifiability : tuple of str
        Parameters that the log can and cannot identify, a line each; empty before that is analysed.
    """

    findings: tuple[Finding, ...]
    rows: int
    rate_Hz: float | None
    accepted_findings: tuple[str, ...] = ()
    identifiability: tuple[str, ...] = ()

    @property
    def accepted(self) -> bool:
        """True if each error was accepted by the user."""
        return not any(f.severity == ERROR and f.name not in self.accepted_findings for f in self.findings)

    def figures(self) -> dict[str, Any]:
        """Return the verdict for JSON."""
        findings = [finding._asdict() for finding in self.findings]
        return {
            "accepted": self.accepted,
            "findings": findings,
            "rows": self.rows,
            "rate_Hz": self.rate_Hz,
            "identifiability": self.identifiability,
        }


def check(log: Log, scenario: Scenario | str | PathLike[str] = "hold") -> Verdict:
    """Check a log before anything is derived from it.

    Parameters
    ----------
    log : Log
        Its conditions override the scenario.
    scenario : Scenario, str or path
        Scenario of the machine: its plant, hardware, limits and control period.

    Returns
    -------
    Verdict
        Findings with advice on what to record instead.

    Raises
    ------
    InputError
        The scenario or a condition is not valid, or the log has another number of groups.
    """
    evidence = Evidence(log, machine_of(log, scenario))
    findings = [
        Finding(name, *stated) for name, function in FINDINGS.items() for stated in function(evidence)
    ]
    rate_Hz = 1 / evidence.period_s if np.isfinite(evidence.period_s) else None
    return Verdict(tuple(findings), len(log), rate_Hz, log.accepted)


def machine_of(log: Log, scenario: Scenario | str | PathLike[str]) -> Machine:
    """Return what a scenario, under the conditions of a log, states of its machine.

    Raises
    ------
    InputError
        The scenario or a condition is not valid, or the log has another number of groups.
    """
    chosen = scenario if isinstance(scenario, Scenario) else scenarios.load(fspath(scenario))
    for name, value in log.conditions.items():
        chosen = with_change(chosen, name, value, f"with the conditions of {log.name}")
    ideal = PlantSection()
    plant = chosen.plant.model_copy(update={name: getattr(ideal, name) for name in LEFT_OUT})
    config = initial_config(chosen.model_copy(update={"plant": plant}), None, None)
    resolved, actuator = config.scenario, config.files.actuator
    if (groups := log.current_A.shape[1]) != len(actuator.groups):
        raise InputError(
            f"log {log.name}: expected currents of {len(actuator.groups)} groups, received {groups}"
        )
    return Machine(
        parameters_of(resolved, config.files),
        np.array(actuator.hinge_range_rad),
        resolved.drive.current_limit_A,
        resolved.controller.period_s,
        resolved.drive.delay_s,
    )
