"""``spheretwin log check FILE ...``: verdict on logs of a machine before they are used."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from spheretwin import machine
from spheretwin import scenario as scenarios
from spheretwin.cli.common import print_json, print_message
from spheretwin.cli.options import Parser
from spheretwin.machine import columns
from spheretwin.machine.findings import FINDINGS, check_names
from spheretwin.machine.identification import identifiability
from spheretwin.machine.verdict import Verdict
from spheretwin.viz.terminal.texts import print_findings

# A shorter log has too few windows for any parameter.
_LEAST_ROWS = 1000


def declare(parser: Parser) -> None:
    """Declare the arguments of the verb."""
    parts = parser.add_subparsers(metavar="PART", required=True)
    check = parts.add_parser(
        "check",
        help="give a verdict on logs",
        description="Check logs of a machine: times, units, order and signs, clock offset, saturation,"
        " excitation. Exit code 1 if a log is not accepted, with advice on what to record instead.",
    )
    check.add_argument("files", type=Path, nargs="+", metavar="FILE", help="log (.parquet, .csv or .mcap)")
    check.add_argument(
        "--columns",
        type=Path,
        metavar="MAP.toml",
        help="column map: names, units, signs, order and scales; the names of our exports unless given",
    )
    check.add_argument(
        "--scenario",
        default="hold",
        metavar="SCENARIO",
        help="scenario of the machine: its plant, hardware and limits (default: hold)",
    )
    check.add_argument(
        "--accept",
        action="append",
        default=[],
        metavar="FINDING",
        help=f"accept a finding; repeatable: {', '.join(FINDINGS)}",
    )
    check.add_argument("--json", help="print the verdict as JSON, alone on stdout")
    check.set_run(run)


def run(options: argparse.Namespace) -> bool:
    """Run the verb; return True if every log is accepted."""
    accepted = check_names(options.accept)
    column_map = columns.load(options.columns) if options.columns else None
    scenario = scenarios.load(options.scenario)
    verdicts, digests = {}, {}
    for path in options.files:
        log = machine.read(path, column_map, accepted)
        verdict = machine.check(log, scenario)
        if verdict.accepted and len(log) >= _LEAST_ROWS:
            verdict = replace(verdict, identifiability=identifiability(log, options.scenario))
        verdicts[str(path)], digests[str(path)] = verdict, log.digest
    if options.json:
        _print_json(verdicts, digests)
    else:
        for path, verdict in verdicts.items():
            rate = f"{verdict.rate_Hz:.4g} Hz" if verdict.rate_Hz else "no rate"
            title = f"{path}: {'' if verdict.accepted else 'not '}accepted, {verdict.rows} rows, {rate}"
            marked = [
                f._replace(severity=f"accepted {f.severity}") if f.name in verdict.accepted_findings else f
                for f in verdict.findings
            ]
            print_findings(title, marked, verdict.identifiability)
    _report_unused(accepted, list(verdicts.values()))
    return all(verdict.accepted for verdict in verdicts.values())


def _print_json(verdicts: dict[str, Verdict], digests: dict[str, str]) -> None:
    """Print the verdict; with several logs the common one, and that of each log."""
    logs_ = [
        {"path": path, "log_sha256": digests[path], **verdict.figures()} for path, verdict in verdicts.items()
    ]
    print_json(
        {
            "accepted": all(log["accepted"] for log in logs_),
            "findings": [finding for log in logs_ for finding in log["findings"]],
            "rows": sum(log["rows"] for log in logs_),
            "rate_Hz": min((log["rate_Hz"] for log in logs_ if log["rate_Hz"]), default=None),
            "logs": logs_,
        }
    )


def _report_unused(accepted: Sequence[str], verdicts: Sequence[Verdict]) -> None:
    """Report accepted findings that no log has."""
    names = {finding.name for verdict in verdicts for finding in verdict.findings}
    if unused := [name for name in accepted if name not in names]:
        print_message(f"log check: accepted, but not found: {', '.join(unused)}")
