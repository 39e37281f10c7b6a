"""``spheretwin reproduce``: experiments of the paper, run again and compared with the paper."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

from spheretwin.cli.common import print_json, print_message, print_result
from spheretwin.cli.options import verb, whole
from spheretwin.models.base.errors import InputError, unknown_name
from spheretwin.models.base.mujoco_library import timers_stopped
from spheretwin.models.telemetry.run_record import versions
from spheretwin.paper import EXPERIMENTS, page
from spheretwin.paper.experiment import SEEDS
from spheretwin.paper.page import Chapter, chapter_of, rows
from spheretwin.paper.runner import make_plan, run_with_cache, summarise, unexpected_ends
from spheretwin.plant.plant_tick import ENGINES
from spheretwin.viz.pages.markdown import prepare
from spheretwin.viz.terminal import runs as tables
from spheretwin.viz.terminal.progress import runs, tracked
from spheretwin.viz.terminal.texts import Verdict, print_verdicts

MOST = 1000
ALL = "all"
TWIN = "twin"


@verb(
    f"""
    NAME...    {", ".join(EXPERIMENTS)}, or {ALL}; or {TWIN} alone
    --out
    --figure-format
    --json     print the rows as JSON, alone on stdout
    --verbose  also print every result and every table
    --seeds N  runs of each case; unless given {SEEDS}, and more where small differences or rare cases
        count
    --limit N  only the first N cases of each experiment
    --plant    engine of rows that do not name one; lagrangian if the model allows it unless given, and a
        sample of the rows also on mujoco
    """,
    seeds=whole(MOST),
    limit=whole(MOST),
    plant=tuple(ENGINES),
)
def run(options: argparse.Namespace) -> bool:
    """Run the paper's experiments over several seeds: a verdict for each, tables, figures, one page.

    twin runs the workflow of a digital twin on a hidden machine, from design to watch. Exit code 1 if a
    run ended unexpectedly or a check failed.
    """
    if TWIN in options.names:
        return _twin(options)
    plans = [
        make_plan(EXPERIMENTS[name], options.seeds, options.limit, options.plant)
        for name in _named(options.names)
    ]
    summaries = [summarise(plan) for plan in plans]
    if options.out:
        prepare(options.out)
    started = time.perf_counter()
    count = sum(len(plan.jobs) + len(plan.sample) for plan in plans)
    with runs("reproduce", count) as done, timers_stopped():
        results = [
            run_with_cache(plan, of_plan, done) for plan, of_plan in zip(plans, summaries, strict=True)
        ]
    wall_s = time.perf_counter() - started
    rows_by_plan = [rows(result.plan, result.outcomes, result.summaries) for result in results]
    chapters = [chapter_of(*both) for both in zip(results, rows_by_plan, strict=True)]
    written = []
    if options.out:
        written = page.write(options.out, chapters, _command(options), options.figure_format)
    if options.json:
        every = [row for plan_rows in rows_by_plan for row in plan_rows]
        print_json({"rows": every, "seeds": options.seeds, "wall_s": wall_s, "versions": versions()})
    else:
        print_verdicts([_verdict(chapter) for chapter in chapters])
        if options.verbose:
            _print_tables(chapters)
        tables.print_written(written)
    bad = [
        f"{result.plan.experiment.name}: {case}"
        for result in results
        for case in unexpected_ends(result.plan, result.outcomes)
    ]
    if bad:
        print_message(f"reproduce: ended early: {'; '.join(bad)}")
    return not bad


def _twin(options: argparse.Namespace) -> bool:
    """Run the workflow of a digital twin; return True if every check holds."""
    given = [f"--{name}" for name in ("seeds", "limit", "plant") if getattr(options, name)]
    if options.names != [TWIN] or given:
        received = " ".join([*options.names, *given])
        raise InputError(
            f"reproduce: expected {TWIN} alone, without --seeds, --limit and --plant, received {received}"
        )
    from spheretwin.machine import workflow_page  # SciPy's optimiser is slow to import
    from spheretwin.machine.workflow import run_workflow

    if options.out:
        prepare(options.out)
    started = time.perf_counter()
    result = run_workflow(track=tracked("design"))
    wall_s = time.perf_counter() - started
    checks = workflow_page.checks_of(result)
    command = f"spheretwin reproduce {TWIN}"
    written = workflow_page.write(options.out, result, command, options.figure_format) if options.out else []
    figures = {"checks": checks, **workflow_page.figures(result), "wall_s": wall_s, "versions": versions()}
    title = f"reproduce {TWIN}, {wall_s:.1f} s"
    return print_result(options, f"reproduce {TWIN}", figures, (), checks, title=title, written=written)


def _named(names: Sequence[str]) -> list[str]:
    """Return the requested experiments, each once, in the order of the list.

    Raises
    ------
    InputError
        A name is not that of an experiment.
    """
    for name in names:
        if name != ALL and name not in EXPERIMENTS:
            raise unknown_name("reproduce", name, [*EXPERIMENTS, ALL, TWIN])
    return [name for name in EXPERIMENTS if name in names or ALL in names]


def _command(options: argparse.Namespace) -> str:
    """Return the command that creates the same page again."""
    seeds = f" --seeds {options.seeds}" if options.seeds else ""
    limit = f" --limit {options.limit}" if options.limit else ""
    plant = f" --plant {options.plant}" if options.plant else ""
    return f"spheretwin reproduce {' '.join(_named(options.names))}{seeds}{limit}{plant}"


def _verdict(chapter: Chapter) -> Verdict:
    results = [(finding.reproduced, finding.text) for finding in chapter.findings]
    return Verdict(chapter.experiment.name, chapter.experiment.title, results)


def _print_tables(chapters: Sequence[Chapter]) -> None:
    """Print every result and every table."""
    for chapter in chapters:
        for finding in chapter.findings:
            print(f"{chapter.experiment.name}: {finding.text}.")
        for section in chapter.sections:
            for table in section.tables:
                title = f"{chapter.experiment.name}, {section.title}. {table.title}"
                tables.print_rows(*table._replace(title=title))
