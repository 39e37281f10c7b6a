"""``spheretwin reproduce``: what the paper shows, run again and set beside it."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.mujoco_library import timers_stopped
from spheretwin.models.base.wording import did_you_mean, shown
from spheretwin.models.telemetry.versions import versions
from spheretwin.twin.commands.reporting import print_json
from spheretwin.twin.reproduce import page
from spheretwin.twin.reproduce.page import Chapter
from spheretwin.twin.reproduce.registry import EXPERIMENTS
from spheretwin.twin.reproduce.rows import rows
from spheretwin.twin.reproduce.running import carried_out, failed, planned
from spheretwin.viz.page.folder import prepare
from spheretwin.viz.terminal import tables
from spheretwin.viz.terminal.progress import runs

SEEDS, MOST = 20, 1000
ALL = "all"


def add_to(verbs: Any) -> None:
    """Add the verb to the command's parser."""
    names = ", ".join(EXPERIMENTS)
    parser = verbs.add_parser(
        "reproduce",
        help="run what the paper shows, and set it beside the paper",
        description="Run the paper's experiments over several seeds: tables, figures, one page."
        " Exit code 1 when a run ended as it should not.",
        allow_abbrev=False,
    )
    parser.add_argument("names", metavar="NAME", nargs="+", help=f"{names}, or {ALL}")
    parser.add_argument("--out", type=Path, metavar="DIR", help="write a page with figures into this folder")
    parser.add_argument("--json", action="store_true", help="print the rows as JSON, alone on stdout")
    parser.add_argument(
        "--seeds", type=_count, default=SEEDS, metavar="N", help=f"runs of each case, {SEEDS} unless given"
    )
    parser.add_argument(
        "--limit", type=_count, metavar="N", help="only the first N cases of each, to see how it goes"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the verb; True when every run ended as it should."""
    if rest:
        raise InputError(
            f"command line: expected --out, --json, --seeds or --limit, received {' '.join(rest)}"
        )
    plans = [planned(EXPERIMENTS[name], options.seeds, options.limit) for name in _named(options.names)]
    if options.out:
        prepare(options.out)
    started = time.perf_counter()
    with runs("reproduce", sum(plan.runs for plan in plans)) as done, timers_stopped():
        found = [carried_out(plan, done) for plan in plans]
    wall_s = time.perf_counter() - started
    pairs = list(zip(plans, found, strict=True))
    chapters = [Chapter(plan.experiment, plan.experiment.tell(outcomes)) for plan, outcomes in pairs]
    written = page.write(options.out, chapters, _command(options), versions()) if options.out else []
    if options.json:
        told = [row for plan, outcomes in pairs for row in rows(plan, outcomes)]
        print_json({"rows": told, "seeds": options.seeds, "wall_s": wall_s, "versions": versions()})
    else:
        _print(chapters)
        tables.print_written(written)
    bad = [f"{plan.experiment.name}: {each}" for plan, outcomes in pairs for each in failed(plan, outcomes)]
    if bad:
        print(f"spheretwin: reproduce: ended early: {'; '.join(bad)}", file=sys.stderr)
    return not bad


def _named(names: Sequence[str]) -> list[str]:
    """Experiments that are asked for, each once, in the order of the registry.

    Raises
    ------
    InputError
        A name is none of an experiment.
    """
    for name in names:
        if name != ALL and name not in EXPERIMENTS:
            valid = [*EXPERIMENTS, ALL]
            raise InputError(
                f"reproduce: expected {', '.join(valid)}, received {shown(name)}{did_you_mean(name, valid)}"
            )
    return [name for name in EXPERIMENTS if name in names or ALL in names]


def _command(options: argparse.Namespace) -> str:
    """What makes the same page again."""
    limit = f" --limit {options.limit}" if options.limit else ""
    return f"spheretwin reproduce {' '.join(_named(options.names))} --seeds {options.seeds}{limit}"


def _print(chapters: Sequence[Chapter]) -> None:
    for chapter in chapters:
        for section in chapter.sections:
            for table in section.tables:
                title = f"{chapter.experiment.name}, {section.title}. {table.title}"
                tables.print_rows(title, table.head, table.rows, table.texts)


def _count(text: str) -> int:
    if not text.isdecimal() or len(text) > 9 or not 1 <= int(text) <= MOST:
        raise argparse.ArgumentTypeError(f"expected a whole number from 1 to {MOST}, received {text}")
    return int(text)
