"""What a run says of itself: to whoever follows it, and in its telemetry file."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.metrics import METRICS, Planned
from spheretwin.models import mjcf
from spheretwin.models.actuator import MJCF_PATH
from spheretwin.models.base.errors import InputError, exception_text, shown
from spheretwin.models.telemetry.run_record import Change, RunFacts, RunRecord, versions
from spheretwin.models.telemetry.table import Table
from spheretwin.scenario import reading
from spheretwin.scenario.sections import ResolvedScenario
from spheretwin.session import Session
from spheretwin.simulation import Run


def facts_of(scenario: ResolvedScenario) -> RunFacts:
    """What is known of a run from its start.

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
    )


def record_of(session: Session, before: RunRecord | None = None, first_tick: int = 0) -> RunRecord:
    """What a run says of itself in its telemetry file, but for how it ended.

    Parameters
    ----------
    session : Session
        The run. Paths are told as they are from the root, so that it can be replayed from any folder.
    before : RunRecord, optional
        Record of the same run when it began: what its files held then is what counts.
    first_tick : int
        Tick from which on the rows are kept.
    """
    scenario = reading.beside(os.getcwd(), session.begun_as.model_dump(mode="json"))
    journal = tuple(map(_from_root, session.journal))
    digests = dict(before.files) if before else {}
    for path, dotted in files_of(scenario, journal):
        if path not in digests:
            digests[path] = digest(dotted, path)
    return RunRecord(scenario, journal, session.tick, digests, versions(), first_tick=first_tick)


def files_of(scenario: dict[str, Any], journal: Iterable[Change]) -> Iterator[tuple[str, str]]:
    """Files that a run names at its start or on its way, each with the dotted name of its field."""
    yield from reading.named_files(scenario)
    for change in journal:
        yield from reading.named_files(reading.alone(change.name, change.value))


def digest(dotted: str, path: str) -> str | None:
    """What tells a file from another, for a model with all that it names; None where it cannot be read."""
    try:
        if dotted == "plant.mjcf":
            return mjcf.contents_digest(Path(path))
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError:  # a run that is over must not lose its telemetry by it
        return None


def _from_root(change: Change) -> Change:
    """A change whose paths, if it holds any, begin at the root."""
    return change._replace(value=reading.value_beside(os.getcwd(), change.name, change.value))


def _sections(fields: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Values by section, what stands outside of any under ``run``; name and description are told apart."""
    outside = {key: value for key, value in fields.items() if not isinstance(value, Mapping)}
    inside = {key: dict(value) for key, value in fields.items() if isinstance(value, Mapping)}
    told_apart = ("name", "description")
    return {"run": {key: outside[key] for key in outside if key not in told_apart}, **inside}


OwnMetric = Callable[[Run], Any]
"""A function of the user's: of a whole run, to anything that JSON holds."""

# What the JSON of a run holds beside its metrics.
BESIDE = (
    "scenario",
    "status",
    "reason",
    "simulated_s",
    "wall_s",
    "realtime_factor",
    "versions",
    "notes",
    "warnings",
)


class Figures:
    """Follows a run into every metric.

    Parameters
    ----------
    planned : Planned
        The run to come.
    """

    def __init__(self, planned: Planned) -> None:
        self._metrics = {name: metric(planned) for name, metric in METRICS.items()}

    def write(self, rows: Table) -> None:
        """Take the rows of one chunk."""
        if len(rows):
            for metric in self._metrics.values():
                metric.write(rows)

    def note(self, t_s: float, text: str) -> None:
        """It changes no figure."""

    def finish(self, status: str) -> None:
        """Nothing remains to be done."""

    def values(self) -> dict[str, Any]:
        """Figure by name; None where there are too few rows for one."""
        return {name: metric.value() for name, metric in self._metrics.items()}

    def warnings(self) -> list[str]:
        """What the figures alone do not tell of the run; one line each."""
        return [line for metric in self._metrics.values() for line in metric.warnings()]


def figures_of(run: Run, extra: Mapping[str, OwnMetric] | None = None) -> dict[str, Any]:
    """Figures of a run whose telemetry is in memory.

    Parameters
    ----------
    run : Run
        From `simulate`.
    extra : mapping of callable, optional
        Functions of the user's own by the names of their figures.

    Raises
    ------
    InputError
        A function has the name of another figure, raises, or gives what JSON does not hold.
    """
    own = extra or {}
    check_names(own)
    figures = Figures(Planned(run.scenario, run.actuator, run.scenario.ticks))
    figures.write(run.telemetry)
    return {**figures.values(), **{name: own_value(name, metric, run) for name, metric in own.items()}}


def check_names(own: Mapping[str, OwnMetric]) -> None:
    """Find out whether functions of the user's have names of their own.

    Raises
    ------
    InputError
        One has not.
    """
    for name in own:
        if name in METRICS or name in BESIDE:
            taken = ", ".join([*METRICS, *BESIDE])
            raise InputError(f"metric: expected another name than {taken}, received {name}")


def own_value(name: str, metric: OwnMetric, run: Run) -> Any:
    """What a function of the user's says of a run, as JSON holds it.

    Raises
    ------
    InputError
        It raises, or gives what JSON does not hold.
    """
    try:
        value = metric(run)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # the user's code may raise anything
        raise InputError(f"metric {name}: expected a figure, it raised {exception_text(error)}") from error
    try:
        return json.loads(json.dumps(value, default=_as_plain))
    except KeyboardInterrupt:
        raise
    except BaseException:  # not JSON, or an object of the user's that raises when it is read
        raise InputError(f"metric {name}: expected what JSON holds, received {shown(value)}") from None


def summary(
    session: Session, status: str, figures: Mapping[str, Any], warnings: Sequence[str]
) -> dict[str, Any]:
    """A session's run, ready for JSON.

    Parameters
    ----------
    session : Session
        At the run's end.
    status : str
        How it ended.
    figures : mapping
        By name, those of the user among them.
    warnings : sequence of str
        Of model, scenario and figures.
    """
    scenario, wall_s = session.begun_as, session.loop_s
    simulated_s = session.tick * scenario.controller.period_s
    return {
        "scenario": scenario.model_dump(mode="json"),
        "status": status,
        "reason": session.reason.told if session.reason else None,
        "simulated_s": simulated_s,
        **figures,
        "wall_s": wall_s,
        "realtime_factor": simulated_s / wall_s if wall_s > 0 else None,
        "versions": versions(),
        "notes": scenario.trajectory.notes(),
        "warnings": list(warnings),
    }


def _as_plain(value: object) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError
