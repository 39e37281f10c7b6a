"""A run told by its own telemetry file: scenario at its start, command journal, ticks, model and curves."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from spheretwin.control.laws.registry import NAMES
from spheretwin.models import mjcf
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.user_code import is_reference
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.twin import metrics
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.scenario import reading
from spheretwin.twin.scenario.planned import Change
from spheretwin.twin.scenario.sections import Scenario
from spheretwin.twin.session import Session


class Plan(NamedTuple):
    """What to run."""

    scenario: Scenario
    ticks: int
    journal: tuple[Change, ...]


def facts(session: Session, before: Mapping[str, str] | None = None) -> dict[str, str]:
    """What a run says of itself in its telemetry file: nothing that differs between two equal runs.

    Parameters
    ----------
    session : Session
        The run. Paths are told as they are from the root, so that it can be replayed from any folder.
    before : mapping, optional
        Facts of the same run when it began: what its files held then is what counts.
    """
    scenario = reading.beside(os.getcwd(), session.begun_as.model_dump(mode="json"))
    journal = tuple(map(_from_root, session.journal))
    digests = json.loads(before["files"]) if before else {}
    for path, dotted in _files(scenario, journal):
        if path not in digests:
            digests[path] = _digest(dotted, path)
    return {
        "scenario": json.dumps(scenario),
        "journal": json.dumps(journal),
        "ticks": str(session.tick),
        "files": json.dumps(digests),
        "versions": json.dumps(metrics.versions()),
    }


def read(path: Path) -> Plan:
    """Read from a telemetry file what was run; run again, it gives the same bytes.

    Raises
    ------
    InputError
        The file is no telemetry of a run, was made under a law that it does not hold, or a model or curve
        is no longer what it was.
    """
    _, metadata = read_parquet(path, rows=False)
    try:
        return _plan(metadata, str(path))
    except (KeyError, ValueError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise InputError(f"replay {path}: expected scenario, journal and ticks of a run, {error!r}") from None


def _plan(metadata: Mapping[str, str], source: str) -> Plan:
    scenario = scenarios.from_record(json.loads(metadata["scenario"]), source)
    journal = tuple(
        Change(int(tick), str(name), value) for tick, name, value in json.loads(metadata["journal"])
    )
    for change in journal:
        if change.name == "controller.law" and change.value not in NAMES and not is_reference(change.value):
            raise InputError(
                f"replay {source}: expected changes to {', '.join(NAMES)}, received one to {change.value}"
                f" at tick {change.tick}, a law that the file does not hold"
            )
    ticks = int(metadata["ticks"])
    if ticks < 1:
        raise InputError(
            f"replay {source}: expected a run of at least one tick, received {ticks};"
            " the parts of a run that was killed do not say how far it went"
        )
    named = _files(scenario.model_dump(mode="json"), journal)
    _check_files(named, json.loads(metadata.get("files", "{}")), source)
    return Plan(scenario, ticks, journal)


def _check_files(named: Iterable[tuple[str, str]], digests: Mapping[str, str | None], source: str) -> None:
    for path, dotted in named:
        if path in digests and _digest(dotted, path) != digests[path]:  # older files hold none
            raise InputError(
                f"replay {source}: expected {dotted} {path} as it was when the run was made,"
                " received one that is missing or was changed since"
            )


def _from_root(change: Change) -> Change:
    """A change whose paths, if it holds any, begin at the root."""
    return change._replace(value=reading.value_beside(os.getcwd(), change.name, change.value))


def _files(scenario: dict[str, Any], journal: Iterable[Change]) -> Iterator[tuple[str, str]]:
    """Files that a run names at its start or on its way, each with the dotted name of its field."""
    yield from reading.named_files(scenario)
    for change in journal:
        yield from reading.named_files(reading.alone(change.name, change.value))


def _digest(dotted: str, path: str) -> str | None:
    """What tells a file from another, for a model with all that it names; None where it cannot be read."""
    try:
        if dotted == "plant.mjcf":
            return mjcf.contents_digest(Path(path))
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError:  # a run that is over must not lose its telemetry by it
        return None
