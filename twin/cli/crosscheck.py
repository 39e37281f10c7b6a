"""``spheretwin crosscheck``: comparison of the engine with the Lagrangian and Pinocchio."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from spheretwin.cli.common import add_verbose, print_json, report_broken, warn_about_model
from spheretwin.crosscheck.part import STATES
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.run_record import versions
from spheretwin.viz.pages.markdown import prepare
from spheretwin.viz.terminal import runs
from spheretwin.viz.terminal.progress import parts
from spheretwin.viz.terminal.tables import print_checks

MOST_STATES = 1_000_000  # some three minutes and a gigabyte


def add_to(verbs: Any) -> None:
    """Add the verb to the command's parser."""
    parser = verbs.add_parser(
        "crosscheck",
        help="compare the engine with the Lagrangian and Pinocchio",
        description="Compare the engine (MuJoCo) with the Lagrangian model and, if it is installed, with"
        " Pinocchio: state by state, along trajectories, without torque, under friction, and in the closed"
        " loop. Exit code 1 when a bound is broken.",
        allow_abbrev=False,
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="write a page with figures into this folder")
    parser.add_argument("--json", action="store_true", help="print the checks as JSON, alone on stdout")
    parser.add_argument(
        "--states", type=_count, default=STATES, metavar="N", help=f"random states, {STATES} unless given"
    )
    parser.add_argument(
        "--mjcf", type=Path, default=actuators.MJCF_PATH, metavar="FILE.xml", help="model file"
    )
    add_verbose(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the verb; return True if every bound is kept."""
    if rest:
        raise InputError(
            f"command line: expected --out, --json, --states, --mjcf or --verbose, received {' '.join(rest)}"
        )
    actuators.load(options.mjcf)  # before the folder is created
    warn_about_model(options.mjcf)
    from spheretwin.crosscheck import suite
    from spheretwin.crosscheck import suite as page  # their libraries are slow to import

    if options.out:
        prepare(options.out)
    started = time.perf_counter()
    with parts("crosscheck", len(suite.PARTS)) as begun:
        evidence = suite.run(options.mjcf, options.states, begun)
    wall_s = time.perf_counter() - started
    checks = evidence.checks
    written = [page.write(options.out, evidence, versions())] if options.out else []
    if options.json:
        print_json({"checks": checks, "wall_s": wall_s, "versions": versions()})
    else:
        print_checks(f"crosscheck, {wall_s:.1f} s", checks, options.verbose)
        runs.print_written(written)
    return report_broken("crosscheck", checks)


def _count(text: str) -> int:
    if not text.isdecimal() or len(text) > 12 or not 1 <= int(text) <= MOST_STATES:
        raise argparse.ArgumentTypeError(
            f"expected a number of states from 1 to {MOST_STATES}, received {text}"
        )
    return int(text)
