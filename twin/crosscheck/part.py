"""Part of the cross-check: its subject and its findings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.checks import Check

F = TypeVar("F", bound="Finding")

STATES = 10_000
"""Default number of random states at which the dynamics are compared."""


class Subject(NamedTuple):
    """Subject of the checks."""

    mjcf: Path
    actuator: Actuator
    states: int
    """Random states at which formulas are compared."""


class Finding(Protocol):
    """Result of a part: its checks, and the data of its figures."""

    @property
    def checks(self) -> list[Check]:
        """Rows of the part."""
        ...


class Part(NamedTuple):
    """One row of the suite."""

    name: str
    examine: Callable[[Subject], Finding]


class Evidence(NamedTuple):
    """Findings of every part by its name."""

    findings: Mapping[str, Finding]

    @property
    def checks(self) -> list[Check]:
        """Every check, in the order of the parts."""
        return [check for finding in self.findings.values() for check in finding.checks]

    def of(self, kind: type[F]) -> F:
        """Findings of a kind."""
        return next(finding for finding in self.findings.values() if isinstance(finding, kind))
