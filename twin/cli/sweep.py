"""``spheretwin sweep STUDY``: many runs on all cores, resumable, with one table as the result."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from spheretwin.cli.common import interruptible, print_json, print_message
from spheretwin.cli.options import verb, whole
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.extras import install_command
from spheretwin.models.base.heap import return_large_arrays
from spheretwin.models.base.mujoco_library import timers_stopped
from spheretwin.models.base.user_code import is_reference
from spheretwin.models.telemetry.run_record import versions
from spheretwin.models.telemetry.status import Status
from spheretwin.study import report, statistics
from spheretwin.study.engines import ENGINES
from spheretwin.study.grid import Grid
from spheretwin.study.relative import absolute
from spheretwin.study.row import Rows
from spheretwin.study.runner import StudyResult
from spheretwin.study.runner import run as run_study
from spheretwin.study.study import Study, load, shipped
from spheretwin.study.tuning import report as tuning_page
from spheretwin.study.tuning.gains import section_of
from spheretwin.study.tuning.tuning import tune
from spheretwin.viz.terminal import runs
from spheretwin.viz.terminal.progress import counted

MOST_THREADS = 1024

MOST_TRIALS = 15
"""Trials of a front that are printed, evenly along it; the table has all."""

DRAWS = 100
"""Machines of a twin unless their number is given."""

MANY_ROWS = 500
"""Rows whose Python takes longer than the start of a process."""

FEW_CORES = 2
"""Cores that threads use: half of such a row is Python."""

GO_ON = "sweep: finished rows are stored; the same command continues from there"


@verb(
    f"""
    STUDY              {", ".join(shipped())}, or a .toml file
    --out DIR          folder of journal and table; NAME_study unless given
    --threads N        as many as there are cores unless given
    --engine=local     local, threads of this process, unless given; processes, for rows with Python code of
        yours; ray, a cluster: the table is the same; cuda, a GPU: the same within rounding
    --address HOST     for ray: auto, or HOST[:PORT] of a cluster that this machine is a node of; a
        cluster on this machine alone unless given
    --limit ROWS       run only the first rows; finished later rows stay in the table
    --row KEY          run only the row of this key, and print its figures
    --optimise         tune the gains that the section [optimise] of the study names; engine local or cuda
    --trials N         trials of each law, with --optimise
    --twin TWIN.toml   run each row on machines drawn from the covariance of an identified twin
    --draws N          machines of --twin; {DRAWS} unless given
    --figure-format
    --json             print the result as JSON, alone on stdout
    """,
    threads=whole(MOST_THREADS),
    needs={"--draws": "--twin", "--trials": "--optimise"},
    excludes={"--row": "--out --threads --limit", "--optimise": "--row --limit"},
    engine=tuple(ENGINES),
    draws=whole(100_000),
)
def run(options: argparse.Namespace) -> bool:
    """Run a study on all cores.

    Rows in its journal are not run again: an interrupted study continues. Exit code 1 if it is not
    complete, or if a row ended as failsafe or by an exception of a law or a metric.
    """
    study = absolute(load(options.study))
    if options.twin:
        study = _over_twin(study, options.twin, options.draws or DRAWS)
    if options.optimise:
        return _optimised(study, options)
    if options.row:
        return _one(study, options.row, options.json)
    with _tracked(study.name, "rows") as tracking:
        outcome = run_study(
            study,
            options.out,
            engine=options.engine,
            address=options.address,
            threads=options.threads,
            limit=options.limit,
            **tracking,
        )
    rows = statistics.read(outcome.table)
    printed = statistics.summary(rows)
    written = _report(outcome, rows, printed, options)
    if options.json:
        print_json({**_outcome_json(outcome), "summary": printed, "versions": versions()})
    else:
        limited = "" if outcome.of == outcome.study_rows else f", the first of {outcome.study_rows}"
        title = f"{study.name}: {outcome.rows} of {outcome.of} rows{limited}"
        runs.print_rows(*report.medians(printed, title))
        if outcome.startup_s is not None:
            print(f"took   {outcome.wall_s:.1f} s, {outcome.startup_s:.1f} s of it to start")
        print(f"table  {outcome.table}")
        runs.print_written(written)
    if outcome.torn:
        print_message("sweep: the journal ended in a torn line, which was dropped")
    if outcome.damaged:
        print_message(
            f"sweep: {outcome.damaged} damaged lines of the journal were skipped, and their rows run again"
        )
    many = outcome.rows - outcome.resumed > MANY_ROWS and (options.threads or os.cpu_count() or 1) > FEW_CORES
    if many and options.engine == "local" and (own := _own_code(study)):
        print_message(
            f"sweep: rows with {own} run one at a time in Python; --engine processes runs them on all cores"
        )
    is_complete = _is_complete(outcome.rows, outcome.of, "rows")
    failures = rows.failures
    if len(failures):
        first = failures[0]
        print_message(
            f"sweep: {len(failures)} of {outcome.rows} rows failed, the first with key"
            f" {rows.keys[first]}: {rows.statuses[first]}, {rows.complaints[first]}"
        )
    return is_complete and not len(failures)


def _own_code(study: Study) -> str:
    """Return the first metric or law of the user in a study; empty without one."""
    named = [*study.metrics, *(str(law["law"]) for law in study.law)]
    return next(filter(is_reference, named), "")


@contextlib.contextmanager
def _tracked(name: str, what: str) -> Iterator[dict[str, Callable[..., Any]]]:
    """Show progress until the end or an interruption; yield what reports both to a study."""
    return_large_arrays()
    with (
        interruptible(GO_ON) as stop_requested,
        counted(name, what) as done,
        timers_stopped(),
        contextlib.redirect_stdout(sys.stderr),  # the output of user code is not part of the figures
    ):
        yield {"done": done, "stop_requested": stop_requested}


def _over_twin(study: Study, twin: Path, draws: int) -> Study:
    """Return a study with the fields of a twin, and an axis of machines that its logs allow.

    Raises
    ------
    InputError
        The twin cannot be used, or the study has another axis over one of its parameters.
    """
    from spheretwin.machine.twin_file import draw_fields, read_twin

    drawn = draw_fields(twin, draws, study.seed)
    if taken := sorted({axis.field for axis in study.axis if axis.field.rstrip(".0123456789") in drawn}):
        raise InputError(
            f"study {study.name}: expected no axis over a parameter of the twin, received {', '.join(taken)}"
        )
    fields = {**study.fields, **read_twin(twin)}
    axes = [
        {"kind": "values", "field": name, "values": values, "zip": "twin" if len(drawn) > 1 else None}
        for name, values in drawn.items()
    ]
    content = study.model_dump(mode="json") | {
        "fields": {name: value for name, value in fields.items() if name not in drawn},
        "axis": [*(axis.model_dump(mode="json") for axis in study.axis), *axes],
    }
    combined = Study.model_validate_json(json.dumps(content))
    return combined.model_copy(update={"folder": study.folder, "optimise": study.optimise})


def _is_complete(done: int, of: int, what: str) -> bool:
    """Return True if all were finished; otherwise print how to continue."""
    if done < of:
        print_message(
            f"sweep: interrupted after {done} of {of} {what}; the same command continues from there"
        )
    return done >= of


def _optimised(study: Study, options: argparse.Namespace) -> bool:
    """Tune gains; return True if all requested trials are finished."""
    objectives = section_of(study).objective
    folder = options.out or Path(f"{study.name}_study")
    with _tracked(study.name, "trials") as tracking:
        outcome = tune(
            study,
            folder,
            trials=options.trials,
            engine=options.engine,
            threads=options.threads,
            **tracking,
        )
    trials = f" --trials {options.trials}" if options.trials else ""
    command = f"spheretwin sweep {shlex.quote(options.study)} --optimise{trials}"
    written = tuning_page.write(folder, study, outcome, command, options.figure_format)
    if not report.can_be_drawn():
        print_message(f"sweep: no figures were drawn: {install_command('plots')} installs what they need")
    printed = tuning_page.summary(outcome, objectives)
    if options.json:
        print_json({**printed, "versions": versions()})
    else:
        _print_laws(study.name, printed["laws"])
        print(f"table  {outcome.table}")
        runs.print_written(written)
    return _is_complete(outcome.trials, outcome.of, "trials")


def _print_laws(name: str, laws: Mapping[str, Any]) -> None:
    """Print the start of each law and its best trial, or its front."""
    for law, of_law in laws.items():
        front = of_law["best"]
        step = max(1, math.ceil(len(front) / MOST_TRIALS))
        if table := tuning_page.chosen({**of_law, "best": front[::step]}, f"{name}, {law}"):
            runs.print_rows(*table)
        else:
            print(f"{name}, {law}: {tuning_page.NONE_COMPLETED}")
        print(tuning_page.counted(of_law))
        if step > 1:
            print(f"{len(front[::step])} of the {len(front)} trials of the front")
        if len(front) == 1:
            print(front[0]["command"])


def _outcome_json(outcome: StudyResult) -> dict[str, Any]:
    names = ("rows", "of", "failed", "resumed", "checked", "wall_s", "startup_s")
    return {**{name: getattr(outcome, name) for name in names}, "table": str(outcome.table)}


def _report(
    outcome: StudyResult, rows: statistics.StudyTable, printed: dict[str, Any], options: argparse.Namespace
) -> list[Path]:
    """Write the page next to the table if figures can be drawn."""
    if report.can_be_drawn():
        of = outcome.of, outcome.study_rows
        folder, source, kind = outcome.table.parent, options.study, options.figure_format
        return report.write(folder, rows, printed, of, source, kind)
    print_message(f"sweep: no report was written: {install_command('plots')} installs what it needs")
    return []


def _one(study: Study, key: str, as_json: bool) -> bool:
    """Run one row, and print its values and its figures."""
    with contextlib.redirect_stdout(sys.stderr), timers_stopped():
        rows, row = Rows(study), Grid(study).of(key)
        (result,) = rows.run([row])
    printed = {
        "row": row.number,
        "key": row.key,
        "seed": row.seed,
        "values": dict(row.values),
        "law": dict(row.law) if row.law else None,
        "command": rows.command(row),
        "status": result.status,
        "reason": result.reason,
        "error": result.error,
        **result.figures,
    }
    if as_json:
        print_json(printed)
    else:
        command = printed.pop("command")
        pairs = [(name, str(value)) for name, value in printed.items()]
        runs.print_rows(f"row {row.number} of {study.name}", ("", "value"), pairs, 2)
        print(f"command  {command}")
    return result.status == Status.COMPLETED and result.error is None
