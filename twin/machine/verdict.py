"""Check of a log against the scenario of its machine: findings and a verdict."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.machine.findings import ERROR, FINDINGS, Evidence, LogFinding
from spheretwin.machine.log import Log
from spheretwin.machine.model import Model, model_of
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.changes import with_change
from spheretwin.scenario.sections import Scenario


@dataclass(frozen=True)
class LogVerdict:
    """Verdict on a log.

    Attributes
    ----------
    findings : tuple of LogFinding
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

    findings: tuple[LogFinding, ...]
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


def check(log: Log, scenario: Scenario | str | PathLike[str] = "hold") -> LogVerdict:
    """Check a log before anything is derived from it.

    Parameters
    ----------
    log : Log
        Its conditions override the scenario.
    scenario : Scenario, str or path
        Scenario of the machine: its plant, hardware, limits and control period.

    Returns
    -------
    LogVerdict
        Findings with advice on what to record instead.

    Raises
    ------
    InputError
        The scenario or a condition is not valid, or the log has another number of groups.
    """
    evidence = Evidence(log, model_of_log(log, scenario))
    findings = [
        LogFinding(name, *stated) for name, function in FINDINGS.items() for stated in function(evidence)
    ]
    rate_Hz = 1 / evidence.period_s if np.isfinite(evidence.period_s) else None
    return LogVerdict(tuple(findings), len(log), rate_Hz, log.accepted)


def model_of_log(log: Log, scenario: Scenario | str | PathLike[str]) -> Model:
    """Return the model of a scenario under the conditions of a log.

    Raises
    ------
    InputError
        The scenario or a condition is not valid, or the log has another number of groups.
    """
    chosen = scenario if isinstance(scenario, Scenario) else scenarios.load(fspath(scenario))
    for name, value in log.conditions.items():
        chosen = with_change(chosen, name, value, f"with the conditions of {log.name}")
    model = model_of(chosen)
    if (groups := log.current_A.shape[1]) != model.groups:
        raise InputError(f"log {log.name}: expected currents of {model.groups} groups, received {groups}")
    return model
