"""All that a session goes on from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.record import Change
from spheretwin.models.telemetry.status import Status
from spheretwin.twin.machine import State
from spheretwin.twin.scenario.files import Files, digest
from spheretwin.twin.scenario.sections import Scenario


@dataclass(frozen=True)
class Snapshot:
    """A session at one tick; it can be pickled."""

    scenario: Scenario
    begun_as: Scenario
    own_law: str | None
    files: str
    """Digest of model and torque curves."""
    law_source: str
    """Digest of the file that the law is from, if it is one of the user's."""
    tick: int
    status: Status
    machine: State
    exogenous: dict[str, Any]
    journal: tuple[Change, ...]
    events: tuple[Change, ...]

    def check_fits(self, files: Files) -> None:
        """Find out whether model, curves and law are what they were.

        Raises
        ------
        InputError
            A file has changed since, or is another.
        """
        controller = self.scenario.controller
        if controller.source != self.law_source:
            raise InputError(
                f"session: expected {controller.law} as it was when the snapshot was taken,"
                " received a file that was changed since"
            )
        if digest(files) != self.files:
            raise InputError(
                "session: expected a snapshot of the same model and torque curves, received one of others"
            )
