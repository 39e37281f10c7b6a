"""``spheretwin review RUN [RUN ...]``: facts of runs from their files, compared with the first run."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from spheretwin.analysis import comparison, recorded_run, tolerances
from spheretwin.analysis.recorded_run import Reviewed
from spheretwin.analysis.review import Review, review
from spheretwin.analysis.tolerances import Exceeded
from spheretwin.cli.common import print_json, print_message, warn
from spheretwin.cli.options import verb
from spheretwin.metrics.tracking import BAND_rad
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import check_writable
from spheretwin.models.telemetry.checksums import NO_CHECKSUMS
from spheretwin.viz.terminal import reviews
from spheretwin.viz.terminal.reviews import SignalTolerance
from spheretwin.viz.terminal.runs import print_written


@verb(
    f"""
    RUN...                 telemetry (.parquet) or a recording (.rrd), also of a killed process
    --tolerance FILE.toml  compare the other runs with the first, signal by signal; a file or a shipped
        one: {", ".join(tolerances.shipped())}
    --export FILE    write the columns of the run as .csv, .mat, .h5, .parquet or .mcap
    --merge OUT.rrd  write all runs into one new recording, with a layout for comparison
    --figures DIR    draw all runs: SVG and one page with interactive plots, without viewer or network
    --figure-format
    --video OUT.mp4  write a clip: path of the shaft's tip, error over time; PNG frames in a folder if no
        FFmpeg is found (extra video)
    --json           print the result as JSON, alone on stdout
    """,
    runs=Path,
    tolerance=str,
)
def run(options: argparse.Namespace) -> bool:
    """Print facts, figures and events of runs from their files.

    With several runs also the differences from the first. Exit code 1 if a run exceeds the tolerances.
    """
    _check(options)
    reviewed = review(*options.runs, tolerance=options.tolerance)
    runs, summaries, over = reviewed.runs, reviewed.figures, reviewed.exceeded
    if options.export:
        recorded_run.export(runs[0], options.export)
    if options.merge:
        comparison.merge(runs, options.merge)
    page = None
    if options.figures:
        page = comparison.write_figures(runs, summaries, options.figures, options.figure_format)
    clip = comparison.write_video(runs, options.video) if options.video else None
    if options.json:
        _print_json(reviewed, has_tolerances=options.tolerance is not None)
    else:
        _print_text(reviewed)
        print_written([path for path in (options.export, options.merge, page, clip) if path])
    warn(f"{run.path} {NO_CHECKSUMS}" for run in runs if not run.checked)
    warn(_recovered(run) for run in runs if not run.whole)
    warn(_thinned(run) for run in runs if run.rate_Hz)
    for places, signals in zip(over, reviewed.tolerances, strict=True):
        if places:
            print_message(f"review: {_first(places, signals)}")
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
    if options.video:
        comparison.check_video(options.video)


def _print_text(reviewed: Review) -> None:
    """Print one run, or the differences of several and the use of their tolerances."""
    if len(reviewed.runs) == 1:
        reviews.print_run_report(reviewed.figures[0], reviewed.nominal_errors[0], BAND_rad)
        return
    reviews.print_comparison(reviewed.figures, reviewed.differing_fields, reviewed.nominal_errors, BAND_rad)
    reference, *others = (run.path.name for run in reviewed.runs)
    for name, signals in zip(others, reviewed.tolerances or [[] for _ in others], strict=True):
        if signals:
            reviews.print_tolerances(reference, name, signals)


def _print_json(reviewed: Review, *, has_tolerances: bool) -> None:
    """Print the runs, their differences, and the first time at which each signal exceeds its tolerance."""
    within = not any(reviewed.exceeded) if has_tolerances else None
    print_json(
        {
            "runs": reviewed.figures,
            "differences": reviewed.differences,
            "differing_fields": reviewed.differing_fields,
            "nominal_errors": reviewed.nominal_errors,
            "within_tolerance": within,
            "exceeded": [place for places in reviewed.exceeded for place in places],
            "tolerances": reviewed.tolerances,
        }
    )


def _recovered(run: Reviewed) -> str:
    return (
        f"{run.path} was not closed: {len(run.table)} rows, {run.simulated_s:.3f} s of the run,"
        " were recovered"
    )


def _thinned(run: Reviewed) -> str:
    return (
        f"{run.path} keeps {run.rate_Hz:g} rows a second and those that stand out: extremes and events are"
        " those of the run; all other figures are of these rows, each held until the next, and the variation"
        " of the commands is too low"
    )


def _first(places: Sequence[Exceeded], signals: Sequence[SignalTolerance]) -> str:
    """Return the first violation, and the largest excess of the same signal."""
    first, others = places[0], len(places) - 1
    more = f"; {others} more signal{'s' if others > 1 else ''} later" if others else ""
    axis = f" {first.axis}" if first.axis else ""
    largest = next(signal for signal in signals if signal.signal == first.signal)
    return (
        f"{first.path}: {first.signal}{axis} leaves its tolerance first at {first.t_s:.6g} s,"
        f" by {first.by:.3g}; its largest excess is {largest.excess:.3g} at {largest.t_s:.6g} s{more}"
    )
