"""``spheretwin magnetics check``: the torque matrix against the field of all poles on all windings."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.models.design import field_verdict
from spheretwin.twin.commands.reporting import kept, print_json, warn, warn_of_model
from spheretwin.viz.terminal import magnetic_tables
from spheretwin.viz.terminal.checks import print_checks
from spheretwin.viz.terminal.progress import tracked


def run(options: argparse.Namespace, rest: Sequence[str]) -> bool:
    """Run the part; True when every bound is kept."""
    if rest:
        raise InputError(
            "command line: expected --csv, --mjcf, --poses, --seed, --json or --verbose,"
            f" received {' '.join(rest)}"
        )
    actuator = actuators.load(options.mjcf, options.csv)
    verdict = field_verdict.judge(actuator, options.poses, options.seed, tracked("direct sums"))
    warn_of_model(options.mjcf)
    warn(verdict.warnings)
    if options.json:
        print_json(verdict._asdict())
    else:
        magnetic_tables.print_field(verdict)
        print_checks("magnetics check", verdict.checks, options.verbose)
    if verdict.curve_is_of_another_geometry:
        distance = 100 * verdict.sources.curve_between_samples_of_peak
        warn(
            [
                f"the torque curve is {distance:.2g} % of its peak away from the model file's geometry:"
                " `spheretwin magnetics curve` remakes it"
            ]
        )
    return kept("magnetics check", verdict.checks)
