"""A run as JSON: how it ended, its metrics, functions of the user's own, speed, versions and warnings."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import exception_text, shown
from spheretwin.models.telemetry.table import Table
from spheretwin.models.telemetry.versions import versions
from spheretwin.twin.metrics.metric import Planned
from spheretwin.twin.metrics.registry import METRICS
from spheretwin.twin.session import Session
from spheretwin.twin.simulation import Run

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
