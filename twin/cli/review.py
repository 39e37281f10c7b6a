"""``spheretwin review RUN [RUN ...]``: look at runs again from their files; hold them to the first."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from spheretwin.analysis import comparison, recorded_run, tolerances
from spheretwin.analysis.recorded_run import Reviewed
from spheretwin.analysis.recovery import recover
from spheretwin.analysis.review import Review, review
from spheretwin.analysis.tolerances import Exceeded
from spheretwin.cli.common import print_json, warn
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import check_writable
from spheretwin.models.telemetry.checksums import NO_CHECKSUMS
from spheretwin.viz.terminal import runs as reviews
from spheretwin.viz.terminal import runs as tables


def add_review(verbs: Any) -> None:
    """Add the verb to the command's parser."""
    parser = verbs.add_parser(
        "review",
        help="look at runs again from their telemetry or recordings",
        description="Tell facts, figures and events of runs from their own files alone; of several, their"
        " differences from the first. Exit code 1 where a run leaves the tolerances.",
        allow_abbrev=False,
    )
    parser.add_argument(
        "runs",
        type=Path,
        nargs="+",
        metavar="RUN",
        help="telemetry (.parquet) or a recording (.rrd), also one that a killed process left",
    )
    parser.add_argument(
        "--tolerance",
        metavar="FILE.toml",
        help="hold the others against the first, signal by signal; or a shipped one:"
        f" {', '.join(tolerances.shipped())}",
    )
    parser.add_argument(
        "--export", type=Path, metavar="FILE", help="write the columns of the run as .csv or .parquet"
    )
    parser.add_argument(
        "--merge",
        type=Path,
        metavar="OUT.rrd",
        help="write all runs side by side as one new recording, with a layout that compares them",
    )
    parser.add_argument(
        "--figures",
        type=Path,
        metavar="DIR",
        help="draw all runs: PNG, SVG and one page with plots to zoom, which needs no viewer and no network",
    )
    parser.add_argument("--json", action="store_true", help="print what was found as JSON, alone on stdout")
    parser.set_defaults(run=run_review)


def run_review(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the verb; True when all runs are within the tolerances, if there are any."""
    if rest:
        expected = "--tolerance, --export, --merge, --figures or --json"
        raise InputError(f"command line: expected {expected}, received {' '.join(rest)}")
    _check(options)
    reviewed = review(*options.runs, tolerance=options.tolerance)
    runs, told, over = reviewed.runs, reviewed.figures, reviewed.exceeded
    if options.export:
        recorded_run.export(runs[0], options.export)
    if options.merge:
        comparison.merge(runs, options.merge)
    page = comparison.write_figures(runs, told, options.figures) if options.figures else None
    if options.json:
        _print_json(reviewed, held=options.tolerance is not None)
    else:
        reviews.print_runs(told)
        tables.print_written([path for path in (options.export, options.merge, page) if path])
    warn(f"{each.path} {NO_CHECKSUMS}" for each in runs if not each.checked)
    warn(_recovered(each) for each in runs if not each.whole)
    warn(_thinned(each) for each in runs if each.rate_Hz)
    for places in filter(None, over):
        print(f"spheretwin: review: {_first(places)}", file=sys.stderr)
    return not any(over)


def _check(options: argparse.Namespace) -> None:
    if options.tolerance and len(options.runs) < 2:
        raise InputError("command line: expected two runs or more for --tolerance, received one")
    if options.export and len(options.runs) > 1:
        raise InputError(f"command line: expected one run for --export, received {len(options.runs)}")
    if options.export:
        recorded_run.check(options.export)
        check_writable(options.export)
    if options.merge and len(options.runs) < 2:
        raise InputError("command line: expected two runs or more for --merge, received one")
    if options.merge:
        comparison.check_merge(options.merge, options.runs)
        check_writable(options.merge)
    if options.figures:
        comparison.check_figures(options.figures)


def _print_json(reviewed: Review, *, held: bool) -> None:
    """Print the runs, their differences, and where each first leaves what each signal is allowed."""
    within = not any(reviewed.exceeded) if held else None
    print_json(
        {
            "runs": reviewed.figures,
            "differences": reviewed.differences,
            "within_tolerance": within,
            "exceeded": [place for each in reviewed.exceeded for place in each],
        }
    )


def _recovered(each: Reviewed) -> str:
    return (
        f"{each.path} was not closed: {len(each.table)} rows, {each.simulated_s:.3f} s of the run,"
        " were recovered"
    )


def _thinned(each: Reviewed) -> str:
    return (
        f"{each.path} keeps {each.rate_Hz:g} rows a second and those that stand out: extremes and events are"
        " those of the run; all other figures are of these rows, each held until the next, and the variation"
        " of the commands is too low"
    )


def _first(places: Sequence[Exceeded]) -> str:
    first, others = places[0], len(places) - 1
    more = f"; {others} more signal{'s' if others > 1 else ''} later" if others else ""
    axis = f" {first.axis}" if first.axis else ""
    return (
        f"{first.path}: {first.signal}{axis} leaves its tolerance first at {first.t_s:.6g} s,"
        f" by {first.by:.3g}{more}"
    )


def add_recover(verbs: Any) -> None:
    """Add the verb to the command's parser."""
    parser = verbs.add_parser(
        "recover",
        help="make a whole file of what a killed run left",
        description="Make a whole file of what a killed process left of its telemetry or recording.",
        allow_abbrev=False,
    )
    parser.add_argument(
        "file",
        type=Path,
        metavar="FILE",
        help="what was left, or the name that the file was to have: RUN.parquet, RUN.rrd",
    )
    parser.add_argument("--out", type=Path, metavar="FILE", required=True, help="where to write it whole")
    parser.set_defaults(run=run_recover)


def run_recover(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the verb; True when the file is written."""
    if rest:
        raise InputError(f"command line: expected FILE and --out, received {' '.join(rest)}")
    check_writable(options.out)
    recovered = recover(options.file, options.out)
    print(f"recovered {recovered.rows} rows, {recovered.seconds:.3f} s of the run")
    tables.print_written([options.out])
    if not recovered.checked:
        warn([f"{options.file} {NO_CHECKSUMS}"])
    return True
