"""``spheretwin crosscheck``: the engine against the Lagrangian and Pinocchio."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.versions import versions
from spheretwin.twin.crosscheck import STATES

if TYPE_CHECKING:
    from spheretwin.models.base.check import Check

MOST_STATES = 1_000_000  # some three minutes and a gigabyte
WIDTH_WITHOUT_TERMINAL = 150
WIDTH_OF_REASONS = 120  # a narrower table would have more lines of reasons than of figures


def add_to(verbs: Any) -> None:
    """Add the verb to the command's parser."""
    parser = verbs.add_parser(
        "crosscheck",
        help="hold the engine against the Lagrangian and Pinocchio",
        description="Hold the engine (MuJoCo) against the Lagrangian model and, where it is installed,"
        " Pinocchio: state by state, along trajectories, without torque, and in the closed loop."
        " Exit code 1 when a bound is broken.",
        allow_abbrev=False,
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="write a page with figures into this folder")
    parser.add_argument("--json", action="store_true", help="print the checks as JSON, alone on stdout")
    parser.add_argument(
        "--states", type=int, default=STATES, metavar="N", help=f"random states, {STATES} unless given"
    )
    parser.add_argument(
        "--mjcf", type=Path, default=actuators.MJCF_PATH, metavar="FILE.xml", help="model file"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the verb; True when every bound is kept."""
    if rest:
        raise InputError(
            f"command line: expected --out, --json, --states or --mjcf, received {' '.join(rest)}"
        )
    if not 1 <= options.states <= MOST_STATES:
        raise InputError(
            f"command line: expected --states from 1 to {MOST_STATES}, received {options.states}"
        )
    actuators.load(options.mjcf)  # a model that cannot be read leaves no folder
    from spheretwin.twin.crosscheck import page, suite  # their libraries are slow to import

    if options.out:
        page.prepare(options.out)
    started = time.perf_counter()
    with _progress(len(suite.PARTS)) as begun:
        evidence = suite.run(options.mjcf, options.states, begun)
    wall_s = time.perf_counter() - started
    checks = evidence.checks
    written = page.write(options.out, evidence, versions()) if options.out else None
    if options.json:
        rows = [check.row() for check in checks]
        print(json.dumps({"checks": rows, "wall_s": wall_s, "versions": versions()}, allow_nan=False))
    else:
        _print(checks, wall_s, written)
    broken = [check.name for check in checks if not check.ok]
    if broken:
        print(f"spheretwin: crosscheck: broken: {'; '.join(broken)}", file=sys.stderr)
    return not broken


@contextmanager
def _progress(parts: int) -> Iterator[Callable[[str], None]]:
    """A bar on stderr that counts parts; silent where stderr is no terminal."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task("crosscheck", total=parts, completed=-1)
        yield lambda part: bar.update(task, description=part, advance=1)


def _print(checks: Sequence[Check], wall_s: float, written: Path | None) -> None:
    console = Console()
    if not console.is_terminal:
        console = Console(width=WIDTH_WITHOUT_TERMINAL)
    reasons = console.width >= WIDTH_OF_REASONS
    table = Table(title="crosscheck", title_justify="left", show_lines=reasons, box=box.HORIZONTALS)
    table.add_column("check", ratio=5)
    for heading in ("states", "value", "bound"):
        table.add_column(heading, justify="right", no_wrap=True)
    if reasons:
        table.add_column("why the bound", ratio=4)
    for check in checks:
        name, compares = escape(check.name), f"\n[dim]{escape(check.compares)}[/dim]" if reasons else ""
        value = check.value_text() + ("" if check.ok else " BROKEN")
        cells = (name + compares, f"{check.states}", value, check.bound_text())
        table.add_row(*cells, *([escape(check.why)] if reasons else []), style="" if check.ok else "bold red")
    console.print(table)
    broken = sum(not check.ok for check in checks)
    verdict = f"{broken} of {len(checks)} checks broken" if broken else f"all {len(checks)} checks hold"
    console.print(f"{verdict}; {wall_s:.1f} s")
    if not reasons:
        console.print("What each compares, and why its bound: --out, --json, or a wider terminal.")
    if written:
        console.print(f"page  {escape(str(written))}", soft_wrap=True)
