"""All that a session goes on from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from spheretwin.control.law import Law
from spheretwin.control.laws import LAWS
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.run_record import Change
from spheretwin.models.telemetry.status import Status
from spheretwin.runtime import State
from spheretwin.scenario.files import Files, digest
from spheretwin.scenario.sections import ResolvedScenario


class OwnLaws:
    """Laws of the user's by the keys under which snapshots know them: they cannot be kept themselves.

    A key is the law's name, told apart from others' of it.
    """

    def __init__(self, laws: dict[str, Law] | None = None) -> None:
        self._laws = laws or {}

    def with_law(self, law: Law | None) -> OwnLaws:
        """These and one more, unless it is among them; these themselves do not change."""
        if law is None or self.key_of(law) is not None:
            return self
        taken = [key for key, other in self._laws.items() if other.name == law.name]
        key = law.name if not taken else f"{law.name} #{len(taken) + 1}"
        return OwnLaws({**self._laws, key: law})

    def key_of(self, law: Law | None) -> str | None:
        """Key of one of them, if it is one."""
        return next((key for key, other in self._laws.items() if other is law), None)

    def under(self, key: str | None) -> Law | None:
        """The law of a key; none where a snapshot was taken under a shipped one.

        Raises
        ------
        InputError
            There is none of this key.
        """
        if key is None:
            return None
        if key not in self._laws:
            raise InputError(
                f"session: expected a snapshot under one of the laws {', '.join([*LAWS, *self._laws])},"
                f" received one under {key}"
            )
        return self._laws[key]


@dataclass(frozen=True)
class Snapshot:
    """A session at one tick; it can be pickled."""

    scenario: ResolvedScenario
    begun_as: ResolvedScenario
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
