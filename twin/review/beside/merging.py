"""Several runs merged into one recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from spheretwin.models.actuator import MJCF_PATH
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import shown
from spheretwin.models.telemetry.facts import RunFacts
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.review.beside import naming
from spheretwin.twin.review.figures import of_the_actuator
from spheretwin.twin.review.happened import events
from spheretwin.twin.review.run import Reviewed
from spheretwin.twin.scenario.sections import ResolvedScenario
from spheretwin.viz.compared.run import Run
from spheretwin.viz.quantities.quantity import Rows

SUFFIX = ".rrd"


def check(path: Path, runs: Sequence[Path]) -> None:
    """Refuse a file of another kind, one that is there, and one of the runs.

    Raises
    ------
    InputError
        Its name does not end as a recording's, it is there, or it is what a run of which only parts are left
        was to become.
    """
    if path.suffix != SUFFIX:
        raise InputError(f"command line: expected --merge OUT{SUFFIX}, received {shown(str(path))}")
    if path.exists():
        raise InputError(f"command line: expected a new file for --merge, received {path}, which is there")
    if path in runs:
        raise InputError(f"command line: expected a new file for --merge, received {path}, which is a run")


def merge(runs: Sequence[Reviewed], path: Path) -> None:
    """Write one recording of several runs.

    Raises
    ------
    InputError
        One has no rows, another number of coil groups than the first, or a model that cannot be drawn.
    SpheretwinError
        The file cannot be written; what was there before is untouched.
    """
    from spheretwin.viz.merged import recording  # Rerun is slow to import
    from spheretwin.viz.recording.parts.part import Subject

    compared = beside(runs)
    groups = [run.table["current_A"].shape[1] for run in runs]
    for run, count in zip(runs, groups, strict=True):
        if count != groups[0]:
            raise InputError(
                f"review {run.path}: expected an actuator of {groups[0]} coil groups as the first run has,"
                f" received one of {count}"
            )
    subjects = [
        Subject(of.files.actuator, run.table.signals, _facts(of.scenario, _law(run)))
        for run, of in zip(runs, map(of_the_actuator, runs), strict=True)
    ]
    with np.errstate(all="ignore"):  # what damage leaves of numbers may be of any size
        recording.write(path, compared, subjects, _told(runs))


def beside(runs: Sequence[Reviewed], *, every_tick: bool = False) -> list[Run]:
    """Runs as they are drawn beside each other.

    Parameters
    ----------
    runs : sequence of Reviewed
    every_tick : bool
        With a row a tick, also where a file does not keep every one.

    Raises
    ------
    InputError
        One has no rows.
    """
    for run in runs:
        if not len(run.table):
            raise InputError(f"review {run.path}: expected a run of at least one tick to draw, received none")
    told = zip(runs, naming.names(runs), naming.labels(runs, naming.LEGEND), strict=True)
    return [
        Run(
            name,
            label,
            _law(run),
            run.period_s,
            _rows(run, run.every_tick if every_tick else run.table),
            run.metadata,
            tuple(events(run)),
        )
        for run, name, label in told
    ]


def _rows(run: Reviewed, table: Table) -> Rows:
    scenario, files, *_ = of_the_actuator(run)
    return Rows(table, table.rows(0, 1), files.actuator, scenario.drive.current_limit_A)


def _facts(scenario: ResolvedScenario, law: str) -> RunFacts:
    return RunFacts(
        name=scenario.name,
        description=scenario.description,
        law=law,
        duration_s=scenario.duration,
        current_limit_A=scenario.drive.current_limit_A,
        payload_kg=scenario.plant.payload_kg,
        gravity_m_s2=scenario.plant.gravity_m_s2,
        mjcf=Path(scenario.plant.mjcf or MJCF_PATH),
        sections={},
    )


def _law(run: Reviewed) -> str:
    return str(run.record.scenario["controller"]["law"])


def _told(runs: Sequence[Reviewed]) -> str:
    """What each run is, in Markdown; one that is named here is named so in every plot."""
    status = (f"{run.record.status or 'not closed'} at {run.simulated_s:.3f} s" for run in runs)
    lines = [f"- **{label}**, {ended}" for label, ended in zip(naming.labels(runs), status, strict=True)]
    return "\n".join([*lines, "", "What was asked for is the thin white line."])
