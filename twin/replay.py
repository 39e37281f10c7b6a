"""A run told by its own telemetry file: scenario at its start, command journal, ticks."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from spheretwin.control.laws import LAWS
from spheretwin.models.errors import InputError
from spheretwin.models.telemetry import read_parquet
from spheretwin.twin import metrics
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.scenario import Scenario
from spheretwin.twin.session import Change, Session


class Plan(NamedTuple):
    """What to run."""

    scenario: Scenario
    ticks: int
    journal: tuple[Change, ...]


def facts(session: Session) -> dict[str, str]:
    """What a run says of itself in its telemetry file: nothing that differs between two equal runs."""
    return {
        "scenario": json.dumps(session.begun_as.model_dump(mode="json")),
        "journal": json.dumps(session.journal),
        "ticks": str(session.tick),
        "versions": json.dumps(metrics.versions()),
    }


def read(path: Path) -> Plan:
    """Read from a telemetry file what was run; run again, it gives the same bytes.

    Raises
    ------
    InputError
        The file is no telemetry of a run, or was made under a law that it does not hold.
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
        if change.name == "controller.law" and change.value not in LAWS:
            raise InputError(
                f"replay {source}: expected changes to {', '.join(LAWS)}, received one to {change.value}"
                f" at tick {change.tick}, a law that the file does not hold"
            )
    ticks = int(metadata["ticks"])
    if ticks < 1:
        raise InputError(
            f"replay {source}: expected a run of at least one tick, received {ticks};"
            " the parts of a run that was killed do not say how far it went"
        )
    return Plan(scenario, ticks, journal)
