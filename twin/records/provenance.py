"""Provenance of a run: scenario, changes, files and versions, from which it can be run again."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from spheretwin.models import mjcf
from spheretwin.models.actuator import MJCF_PATH
from spheretwin.models.base.files import regular_file
from spheretwin.models.telemetry.run_record import Change, RunFacts, RunRecord, versions
from spheretwin.scenario import reading
from spheretwin.scenario.sections import ResolvedScenario, UserController
from spheretwin.scenario.writing import changed_fields
from spheretwin.session import Session


def facts_of(scenario: ResolvedScenario) -> RunFacts:
    """Return the facts of a run that are known at its start.

    Parameters
    ----------
    scenario : ResolvedScenario
    """
    return RunFacts(
        name=scenario.name,
        description=scenario.description,
        law=scenario.controller.law,
        duration_s=scenario.duration,
        current_limit_A=scenario.drive.current_limit_A,
        payload_kg=scenario.plant.payload_kg,
        gravity_m_s2=scenario.plant.gravity_m_s2,
        mjcf=Path(scenario.plant.mjcf or MJCF_PATH),
        sections=_sections(scenario.model_dump(mode="json")),
        changed=changed_fields(scenario),
    )


def record_of(session: Session, before: RunRecord | None = None, first_tick: int = 0) -> RunRecord:
    """Return the record of a run for its telemetry file, without the final status.

    Parameters
    ----------
    session : Session
        Session of the run. Paths become absolute, so that the run can be replayed from any folder.
    before : RunRecord, optional
        Record of the same run at its start: its digests of the files apply.
    first_tick : int
        Tick of the first row of the file.
    """
    scenario = reading.resolve_paths(os.getcwd(), session.initial_scenario.model_dump(mode="json"))
    if session.law_reference and isinstance(session.initial_scenario.controller, UserController):
        scenario["controller"]["law"] = session.law_reference
    journal = tuple(map(_from_root, session.journal))
    digests = dict(before.files) if before else {}
    for path, dotted in files_of(scenario, journal):
        if path not in digests:
            digests[path] = digest(dotted, path)
    return RunRecord(scenario, journal, session.tick, digests, versions(), first_tick=first_tick)


def files_of(scenario: dict[str, Any], journal: Iterable[Change]) -> Iterator[tuple[str, str]]:
    """Yield the files that a run names at its start or in its changes, each with the name of its field."""
    yield from reading.named_files(scenario)
    for change in journal:
        yield from reading.named_files(reading.single_field(change.name, change.value))


def digest(dotted: str, path: str) -> str | None:
    """Return the digest of a file, for a model with all its files; None if it cannot be read."""
    try:
        if dotted == "plant.mjcf":
            return mjcf.contents_digest(Path(path))
        return hashlib.sha256(regular_file(path).read_bytes()).hexdigest()
    except OSError:  # a finished run must not lose its telemetry for this reason
        return None


def _from_root(change: Change) -> Change:
    """Return a change with absolute paths."""
    return change._replace(value=reading.resolve_value_paths(os.getcwd(), change.name, change.value))


def _sections(fields: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the values by section; fields outside a section are in ``run``, without name and description."""
    outside = {key: value for key, value in fields.items() if not isinstance(value, Mapping)}
    inside = {key: dict(value) for key, value in fields.items() if isinstance(value, Mapping)}
    excluded = ("name", "description")
    return {"run": {key: outside[key] for key in outside if key not in excluded}, **inside}


def change_text(change: Change) -> str:
    """Return the text of a change in a log."""
    return f"{change.name} set to {change.value}"
