"""``spheretwin recover FILE``: a complete file from the partial file of a killed process."""

from __future__ import annotations

import argparse
from pathlib import Path

from spheretwin.analysis.recovery import recover
from spheretwin.cli.common import warn
from spheretwin.cli.options import verb
from spheretwin.models.base.files import check_writable
from spheretwin.models.telemetry.checksums import NO_CHECKSUMS
from spheretwin.viz.terminal import runs


@verb(
    """
    FILE        partial file, or the intended name of the file: RUN.parquet, RUN.rrd
    --out FILE  path of the complete file
    """,
    out={"type": Path, "required": True},
)
def run(options: argparse.Namespace) -> bool:
    """Recover a complete file from the partial telemetry or recording of a killed process."""
    check_writable(options.out)
    recovered = recover(options.file, options.out)
    print(f"recovered {recovered.rows} rows, {recovered.seconds:.3f} s of the run")
    runs.print_written([options.out])
    if not recovered.checked:
        warn([f"{options.file} {NO_CHECKSUMS}"])
    return True
