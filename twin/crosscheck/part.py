"""A part of the cross-check: what it examines, and what all parts leave."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.checks import Check

F = TypeVar("F", bound="Finding")

STATES = 10_000
"""Random states at which the dynamics are compared, unless told otherwise."""


class Subject(NamedTuple):
    """What is examined."""

    mjcf: Path
    actuator: Actuator
    states: int
    """Random states at which formulas are compared."""


class Finding(Protocol):
    """What a part leaves: its checks, and whatever its figures are drawn from."""

    @property
    def checks(self) -> list[Check]:
        """Rows of the part."""
        ...


class Part(NamedTuple):
    """One row of the suite."""

    name: str
    examine: Callable[[Subject], Finding]


class Evidence(NamedTuple):
    """What every part has left, by its name."""

    findings: Mapping[str, Finding]

    @property
    def checks(self) -> list[Check]:
        """Every check, in the order of the parts."""
        return [check for finding in self.findings.values() for check in finding.checks]

    def of(self, kind: type[F]) -> F:
        """What the part left whose findings are of a kind."""
        return next(finding for finding in self.findings.values() if isinstance(finding, kind))
