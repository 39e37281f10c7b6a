"""``spheretwin magnetics curve``: the torque curve from geometry, or a user's own beside it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from spheretwin.models import torque_curve
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import check_writable
from spheretwin.models.design import curve_verdict
from spheretwin.models.design.curve_verdict import ComputedCurve
from spheretwin.twin.commands.reporting import kept, print_json, warn, warn_of_model, write_text
from spheretwin.viz.terminal import magnetic_tables, tables
from spheretwin.viz.terminal.checks import print_checks
from spheretwin.viz.terminal.progress import tracked


def run(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the part; True when every bound is kept."""
    if rest:
        raise InputError(
            f"command line: expected --out, --csv, --mjcf, --json or --verbose, received {' '.join(rest)}"
        )
    if options.csv and options.out:
        raise InputError("command line: expected --out or --csv, received both")
    if options.csv:
        return _judge(options.csv, options.mjcf, options.json)
    if options.out:
        check_writable(options.out)
    return _compute(options)


def _compute(options: argparse.Namespace) -> bool:
    """Compute the curve, check it, write it."""
    computed = curve_verdict.compute(options.mjcf, tracked("torque curve"))
    warn_of_model(options.mjcf)
    warn(computed.warnings)
    if options.out:
        write_text(options.out, computed.csv)
    if options.json:
        print_json(
            {
                **computed.peak._asdict(),
                "doubled_mesh_moves_peak": computed.doubled_mesh.peak,
                "doubled_mesh_moves_worst_sample": computed.doubled_mesh.worst,
                "lookup_error": computed.lookup_error,
                "checks": computed.checks,
                "warnings": computed.warnings,
            }
        )
    elif options.out:
        magnetic_tables.print_computed_curve(computed)
        print_checks("magnetics curve", computed.checks, options.verbose)
        tables.print_written([options.out])
    else:
        _print_text(computed)
    return kept("magnetics curve", computed.checks)


def _print_text(computed: ComputedCurve) -> None:
    """The curve itself on stdout; what there is to say of it beside that, on stderr."""
    print(computed.csv, end="")
    print(
        f"peak {computed.peak.peak_Nm_per_A:.5f} N·m/A at {computed.peak.peak_deg:.2f}°;"
        f" a doubled mesh moves it by {computed.doubled_mesh.peak:.0e} of itself",
        file=sys.stderr,
    )


def _judge(csv: Path, mjcf: Path, as_json: bool) -> bool:
    """Tell how smooth a user's curve is, and how far it is from the geometry's."""
    judged = curve_verdict.judge(torque_curve.read(csv), mjcf, tracked("the geometry's own curve"))
    warn_of_model(mjcf)
    warn(judged.warnings)
    if as_json:
        print_json(
            {
                "path": str(csv),
                "rows": judged.rows,
                **judged.peak._asdict(),
                "leave_one_out": judged.leave_one_out,
                "geometry": {
                    "difference": judged.geometry.as_given,
                    "scale": judged.geometry.scale,
                    "difference_after_scaling": judged.geometry.scaled,
                },
                "lookup_error": judged.lookup_error,
                "checks": [],
                "warnings": judged.warnings,
            }
        )
    else:
        magnetic_tables.print_judged_curve(csv, judged)
    return True  # data is judged by its owner: nothing here is bounded
