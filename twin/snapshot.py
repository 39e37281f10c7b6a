"""Snapshot: the complete state of a session."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from typing import Any

from spheretwin.control.law import Law
from spheretwin.control.laws import LAWS
from spheretwin.loop.runtime import RuntimeState
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.run_record import Change
from spheretwin.models.telemetry.status import Status
from spheretwin.scenario.files import Files, digest
from spheretwin.scenario.sections import ResolvedScenario

VERSION = 6
"""Version of the content of a snapshot; it increases with each change of the state or of its classes."""


class UserLaws:
    """User laws by key. A snapshot stores the key, because the law itself cannot be stored.

    A key is the name of the law, with a number if several laws have this name.
    """

    def __init__(self, laws: dict[str, Law] | None = None) -> None:
        self._laws = laws or {}

    def with_law(self, law: Law | None) -> UserLaws:
        """Return these laws and one more, unless it is among them; this object does not change."""
        if law is None or self.key_of(law) is not None:
            return self
        taken = [key for key, other in self._laws.items() if other.name == law.name]
        key = law.name if not taken else f"{law.name} #{len(taken) + 1}"
        return UserLaws({**self._laws, key: law})

    def key_of(self, law: Law | None) -> str | None:
        """Return the key of a law; None if it is not among these laws."""
        return next((key for key, other in self._laws.items() if other is law), None)

    def under(self, key: str | None) -> Law | None:
        """Return the law of a key; None if the snapshot was taken under a shipped law.

        Raises
        ------
        InputError
            No law has this key.
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
    """State of a session at one tick; it can be pickled."""

    scenario: ResolvedScenario
    initial_scenario: ResolvedScenario
    user_law: str | None
    files: str
    """Digest of model and torque curves."""
    law_source: str
    """Digest of the file of the law, if it is a user law."""
    tick: int
    status: Status
    runtime: RuntimeState
    journal: tuple[Change, ...]
    events: tuple[Change, ...]

    def __reduce__(self) -> tuple[Any, ...]:
        # The content is read after the check of the version: classes of other versions may have moved.
        return _unpickled, (VERSION, pickle.dumps(vars(self)))

    def __setstate__(self, state: object) -> None:
        """Refuse a snapshot of version 1, which was pickled without its version."""
        _unpickled(1, b"")

    def check_fits(self, files: Files) -> None:
        """Check that model, curves and law are those of the snapshot.

        Raises
        ------
        InputError
            A file was changed or is another file.
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


def _unpickled(version: int, content: bytes) -> Snapshot:
    """Return a pickled snapshot.

    Raises
    ------
    InputError
        Its content has another version.
    """
    if version != VERSION:
        raise InputError(
            f"session: expected a snapshot of version {VERSION}, received one of version {version}"
        )
    return Snapshot(**pickle.loads(content))
