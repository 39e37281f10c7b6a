"""``spheretwin log check FILE ...``: verdict on logs of a machine before they are used."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

from spheretwin import machine
from spheretwin import scenario as scenarios
from spheretwin.cli.common import print_json, print_message
from spheretwin.cli.log_options import for_each_log
from spheretwin.cli.options import verb
from spheretwin.machine.findings import FINDINGS, check_names
from spheretwin.machine.identification import identifiability
from spheretwin.machine.log import Log
from spheretwin.machine.verdict import LogVerdict
from spheretwin.models.base.errors import InputError
from spheretwin.viz.terminal.texts import print_findings

# A shorter log has too few windows for any parameter.
_LEAST_ROWS = 1000


@verb(f"""
    FILE...                 log (.parquet, .csv or .mcap)
    --columns MAP.toml...   column map: names, units, signs, order and scales; one for all logs, or one
        for each; the names of our exports unless given
    --scenario SCENARIO=hold  scenario of the machine: its plant, hardware and limits (default: hold)
    --accept FINDING...     accept a finding; repeatable: {", ".join(FINDINGS)}
    --json                  print the verdict as JSON, alone on stdout
    """)
def run(options: argparse.Namespace) -> bool:
    """Give a verdict on logs of a machine.

    It checks times, units, order and signs, clock offset, saturation, excitation. Exit code 1 if a log is
    not accepted, with advice on what to record instead.
    """
    accepted = check_names(options.accept)
    maps = for_each_log(options.columns, len(options.files), "--columns")
    scenario = scenarios.load(options.scenario)
    verdicts: dict[str, LogVerdict] = {}
    logs: dict[str, Log] = {}
    for path, column_map in zip(options.files, maps, strict=True):
        log = machine.read(path, column_map, accepted)
        verdict = machine.check(log, scenario)
        if verdict.accepted and len(log) >= _LEAST_ROWS:
            verdict = replace(verdict, identifiability=_identifiability(log, options.scenario))
        verdicts[str(path)], logs[str(path)] = verdict, log
    if options.json:
        _print_json(verdicts, logs)
    else:
        for path, verdict in verdicts.items():
            rate = f"{verdict.rate_Hz:.4g} Hz" if verdict.rate_Hz else "no rate"
            title = f"{path}: {'' if verdict.accepted else 'not '}accepted, {verdict.rows} rows, {rate}"
            marked = [
                f._replace(severity=f"accepted {f.severity}") if f.name in verdict.accepted_findings else f
                for f in verdict.findings
            ]
            notes = logs[path].notes
            lines = [f"read with {'; '.join(notes)}"] if notes else []
            print_findings(title, marked, [*lines, *verdict.identifiability])
    _report_unused(accepted, list(verdicts.values()))
    return all(verdict.accepted for verdict in verdicts.values())


def _identifiability(log: Log, scenario: str) -> tuple[str, ...]:
    """Return what a log identifies, or why that is not known: the verdict on it stands."""
    try:
        return identifiability(log, scenario)
    except InputError as error:
        return (f"what it identifies is not known: {error}",)


def _print_json(verdicts: dict[str, LogVerdict], logs: dict[str, Log]) -> None:
    """Print the verdict; with several logs the common one, and that of each log."""
    entries = [
        {
            "path": path,
            "log_sha256": logs[path].digest,
            "currents": logs[path].currents,
            "notes": logs[path].notes,
            **verdict.figures(),
        }
        for path, verdict in verdicts.items()
    ]
    print_json(
        {
            "accepted": all(entry["accepted"] for entry in entries),
            "findings": [finding for entry in entries for finding in entry["findings"]],
            "rows": sum(entry["rows"] for entry in entries),
            "rate_Hz": min((entry["rate_Hz"] for entry in entries if entry["rate_Hz"]), default=None),
            "logs": entries,
        }
    )


def _report_unused(accepted: Sequence[str], verdicts: Sequence[LogVerdict]) -> None:
    """Report accepted findings that no log has."""
    names = {finding.name for verdict in verdicts for finding in verdict.findings}
    if unused := [name for name in accepted if name not in names]:
        print_message(f"log check: accepted, but not found: {', '.join(unused)}")


PARTS = {"check": run}
