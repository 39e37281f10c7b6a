"""``spheretwin recover FILE --out FILE``: make a whole file of what a killed process left of one."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import check_writable
from spheretwin.models.telemetry.checksums import NO_CHECKSUMS
from spheretwin.twin.commands.reporting import warn
from spheretwin.twin.review.leavings import recover
from spheretwin.viz.terminal import tables


def add_to(verbs: Any) -> None:
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
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, rest: Sequence[str]) -> bool:
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
