"""``spheretwin crosscheck``: comparison of the engine with the Lagrangian and Pinocchio."""

from __future__ import annotations

import argparse
import time

from spheretwin.cli.common import print_result, warn_about_model
from spheretwin.cli.options import verb, whole
from spheretwin.crosscheck import suite
from spheretwin.crosscheck.suite import STATES
from spheretwin.models import actuator as actuators
from spheretwin.models.telemetry.run_record import versions
from spheretwin.viz.pages.markdown import prepare
from spheretwin.viz.terminal.progress import parts

MOST_STATES = 1_000_000  # some three minutes and a gigabyte


@verb(
    f"""
    --out
    --figure-format
    --json              print the checks as JSON, alone on stdout
    --states N={STATES}  random states, {STATES} unless given
    --mjcf
    --verbose
    """,
    states=whole(MOST_STATES, name="a number of states"),
)
def run(options: argparse.Namespace) -> bool:
    """Compare the engine (MuJoCo) with the Lagrangian model and, if it is installed, with Pinocchio.

    They are compared state by state, along trajectories and driven by coils, and the shipped prototype at
    two physics steps. Exit code 1 when a bound is broken.
    """
    actuators.load(options.mjcf)  # before the folder is created
    warn_about_model(options.mjcf)
    if options.out:
        prepare(options.out)
    started = time.perf_counter()
    with parts("crosscheck", len(suite.PARTS)) as begun:
        evidence = suite.run(options.mjcf, options.states, begun)
    wall_s = time.perf_counter() - started
    checks = evidence.checks
    written = suite.write(options.out, evidence, options.figure_format) if options.out else []
    figures = {"checks": checks, "wall_s": wall_s, "versions": versions()}
    title = f"crosscheck, {wall_s:.1f} s"
    return print_result(options, "crosscheck", figures, (), checks, title=title, written=written)
