"""``spheretwin sweep STUDY``: many runs over all cores, interrupted and resumed, as one table."""

from __future__ import annotations

import argparse
import contextlib
import shlex
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from spheretwin.cli.common import interruptible, print_json
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.mujoco_library import timers_stopped
from spheretwin.models.telemetry.run_record import versions
from spheretwin.models.telemetry.status import Status
from spheretwin.study import report, statistics
from spheretwin.study import run as run_study
from spheretwin.study.engines import ENGINES
from spheretwin.study.grid import Grid
from spheretwin.study.row import Rows
from spheretwin.study.runner import Found
from spheretwin.study.statistics import summary
from spheretwin.study.study import Study, load, shipped
from spheretwin.study.tuning import report as tuning_page
from spheretwin.study.tuning.gains import section_of
from spheretwin.study.tuning.report import told as told_of_tuning
from spheretwin.study.tuning.tuning import tuned
from spheretwin.viz.terminal import runs
from spheretwin.viz.terminal.progress import counted

MOST_THREADS = 1024

GO_ON = "sweep: finished rows are kept; the same command goes on from there"


def add_to(verbs: Any) -> None:
    """Add the verb to the command's parser."""
    parser = verbs.add_parser(
        "sweep",
        help="run a study: many runs, one table",
        description="Run a study over all cores. What its journal has already is not run again: an"
        " interrupted study goes on where it ended. Exit code 1 if it is not complete, or if a row ended as"
        " failsafe or by an exception of a law or a metric.",
        allow_abbrev=False,
    )
    parser.add_argument("study", metavar="STUDY", help=f"{', '.join(shipped())}, or a .toml file")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of journal and table; NAME_study unless given"
    )
    parser.add_argument(
        "--threads", type=_threads, metavar="N", help="as many as there are cores unless given"
    )
    parser.add_argument(
        "--engine",
        choices=tuple(ENGINES),
        default="local",
        help="local, threads on this machine, unless given; the table is the same",
    )
    parser.add_argument(
        "--address",
        metavar="HOST",
        help="for ray: auto, or HOST[:PORT] of a cluster that this machine is a node of; a cluster on this"
        " machine alone unless given",
    )
    parser.add_argument(
        "--limit",
        type=_count,
        metavar="ROWS",
        help="run only the first rows; finished ones behind them stay in the table",
    )
    parser.add_argument("--row", metavar="KEY", help="run the row of this key alone, and print its figures")
    parser.add_argument(
        "--optimise", action="store_true", help="look for the gains that the study's [optimise] names"
    )
    parser.add_argument("--trials", type=_count, metavar="N", help="of each law, with --optimise")
    parser.add_argument("--json", action="store_true", help="print what was found as JSON, alone on stdout")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the verb; True if all requested rows are finished and none has failed."""
    if rest:
        raise InputError(
            "command line: expected --out, --engine, --address, --threads, --limit, --row, --optimise,"
            " --trials or --json,"
            f" received {' '.join(rest)}"
        )
    study = load(options.study)
    if options.optimise:
        return _optimised(study, options)
    if options.trials:
        raise InputError("command line: expected --trials with --optimise, received it alone")
    if options.row:
        if options.out or options.threads or options.limit:
            raise InputError("command line: expected --row without --out, --threads or --limit")
        return _one(study, options.row, options.json)
    with (
        interruptible(GO_ON) as stop_requested,
        counted(study.name) as done,
        timers_stopped(),
        contextlib.redirect_stdout(sys.stderr),  # what code of the user's prints is none of the figures
    ):
        found = run_study(
            study,
            options.out,
            engine=options.engine,
            address=options.address,
            threads=options.threads,
            limit=options.limit,
            done=done,
            stop_requested=stop_requested,
        )
    rows = statistics.read(found.table)
    told = summary(rows)
    written = _report(found, rows, told, options.study)
    if options.json:
        print_json({**_told(found), "summary": told, "versions": versions()})
    else:
        runs.print_study(study.name, _told(found), told)
        runs.print_written(written)
    if found.torn:
        print("spheretwin: sweep: the journal ended in a torn line, which was dropped", file=sys.stderr)
    if found.damaged:
        print(
            f"spheretwin: sweep: {found.damaged} damaged lines of the journal were passed over,"
            " and their rows run again",
            file=sys.stderr,
        )
    if found.rows < found.of:
        print(
            f"spheretwin: sweep: interrupted after {found.rows} of {found.of} rows;"
            " the same command goes on from there",
            file=sys.stderr,
        )
    failures = rows.failures
    if len(failures):
        first = failures[0]
        print(
            f"spheretwin: sweep: {len(failures)} of {found.rows} rows failed, the first with key"
            f" {rows.keys[first]}: {rows.statuses[first]}, {rows.complaints[first]}",
            file=sys.stderr,
        )
    return found.rows >= found.of and not len(failures)


def _optimised(study: Study, options: argparse.Namespace) -> bool:
    """Look for gains; True when all trials that were wanted are finished."""
    if options.row or options.limit:
        raise InputError("command line: expected --optimise without --row and --limit")
    objectives = section_of(study).objective
    folder = options.out or Path(f"{study.name}_study")
    with (
        interruptible(GO_ON) as stop_requested,
        counted(study.name, "trials") as done,
        timers_stopped(),
        contextlib.redirect_stdout(sys.stderr),  # what code of the user's prints is none of the figures
    ):
        found = tuned(
            study,
            folder,
            trials=options.trials,
            threads=options.threads,
            done=done,
            stop_requested=stop_requested,
        )
    trials = f" --trials {options.trials}" if options.trials else ""
    command = f"spheretwin sweep {shlex.quote(options.study)} --optimise{trials}"
    written = tuning_page.write(folder, study, found, command, versions())
    if find_spec("matplotlib") is None:
        print("spheretwin: sweep: no figures without the extra `spheretwin[plots]`", file=sys.stderr)
    told = told_of_tuning(found, objectives)
    if options.json:
        print_json({**told, "versions": versions()})
    else:
        runs.print_tuning(study.name, told)
        runs.print_written(written)
    if found.trials < found.of:
        print(
            f"spheretwin: sweep: interrupted after {found.trials} of {found.of} trials;"
            " the same command goes on from there",
            file=sys.stderr,
        )
    return found.trials >= found.of


def _told(found: Found) -> dict[str, Any]:
    return {
        "rows": found.rows,
        "of": found.of,
        "failed": found.failed,
        "resumed": found.resumed,
        "checked": found.checked,
        "wall_s": found.wall_s,
        "startup_s": found.startup_s,
        "table": str(found.table),
    }


def _report(found: Found, rows: statistics.Rows, told: dict[str, Any], source: str) -> list[Path]:
    """Write the page beside the table, where it can be drawn."""
    if report.can_be_drawn():
        return report.write(found.table.parent, rows, told, (found.of, found.study_rows), source, versions())
    print("spheretwin: sweep: no report was written: it takes the extra `spheretwin[plots]`", file=sys.stderr)
    return []


def _one(study: Study, key: str, as_json: bool) -> bool:
    """Run one row, and print what it was and what it gave."""
    with contextlib.redirect_stdout(sys.stderr), timers_stopped():
        rows, row = Rows(study), Grid(study).of(key)
        result = rows.carried_out(row)
    told = {
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
        print_json(told)
    else:
        runs.print_rows(f"row {row.number} of {study.name}", ("", "value"), _pairs(told), 2)
    return result.status == Status.COMPLETED and result.error is None


def _pairs(told: dict[str, Any]) -> list[tuple[str, ...]]:
    return [(name, str(value)) for name, value in told.items()]


def _threads(text: str) -> int:
    if (count := _count(text)) > MOST_THREADS:
        raise argparse.ArgumentTypeError(f"expected {MOST_THREADS} threads at most, received {count}")
    return count


def _count(text: str) -> int:
    if not text.isdecimal() or len(text) > 12 or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number from 1 on, received {text}")
    return int(text)
