"""``spheretwin validate LOG``: judge a twin by a log that has not identified it."""

from __future__ import annotations

import argparse

from spheretwin.cli.common import print_message, print_result
from spheretwin.cli.log_options import LOG, ONE, changes_of, read_logs, scenario_of
from spheretwin.cli.options import verb
from spheretwin.machine.report import bin_table, fit_table, structure_table
from spheretwin.machine.twin_file import read_uncertainty
from spheretwin.machine.validation import CHI2, Validation, validate


@verb(f"{LOG}    --json", has_fields=True, **ONE)
def run(options: argparse.Namespace) -> bool:
    """Judge a twin by a log.

    It prints residuals by hinge, pose and rate, and what would explain those that noise does not. Exit
    code 1 if the twin is not accepted.
    """
    (log,) = read_logs(options)
    uncertainty = read_uncertainty(options.twin) if options.twin else None
    result = validate(log, scenario_of(options), changes_of(options), uncertainty=uncertainty)
    figures = {
        "accepted": result.accepted,
        "log_sha256": log.digest,
        "accepted_findings": list(log.accepted),
        "chi2": {"all": result.fit.chi2, **result.fit.hinge_chi2},
        "structure": result.structure,
        "bins": result.fit.bins,
    }
    tables = [fit_table({"mean square over that of the noise": result.fit}), bin_table(result.fit)]
    if result.structure:
        tables.insert(1, structure_table(result.structure))
    print_result(options, "validate", figures, tables)
    if not result.accepted:
        print_message(f"validate: {_why(result)}")
    return result.accepted


def _why(result: Validation) -> str:
    if result.structure:
        first = result.structure[0]
        return (
            f"not accepted: the residuals show {first.what} {first.size:+.3g} {first.unit}"
            f" ({abs(first.deviations):.0f} standard deviations)"
        )
    return (
        f"not accepted: expected a mean square from {CHI2[0]:g} to {CHI2[1]:g} of that of the noise, received"
        f" {result.fit.chi2:.3g}"
    )
