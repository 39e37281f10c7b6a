"""``spheretwin identify LOG...``: parameters of a machine from its logs."""

from __future__ import annotations

import argparse
from pathlib import Path

from spheretwin.cli.common import print_json, print_message, print_result
from spheretwin.cli.log_options import LOGS, changes_of, read_logs, scenario_of
from spheretwin.cli.options import from_zero, number, verb, whole
from spheretwin.machine import report
from spheretwin.machine.excitation import DesignSettings, design
from spheretwin.machine.identification import Identified, IdentifySettings, identify
from spheretwin.machine.parameters import KINDS
from spheretwin.machine.twin_file import read_history, write_twin
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import check_writable
from spheretwin.models.telemetry.table import Table
from spheretwin.scenario.writing import as_toml
from spheretwin.viz.pages.markdown import prepare, save_text
from spheretwin.viz.terminal import runs
from spheretwin.viz.terminal.progress import counted, tracked

DEFAULT = ("torque_scale", "plant.coulomb_Nm")


@verb(
    f"""{LOGS}
    --design             instead of logs take a scenario, and find the motion whose log determines the
        parameters best
    --payload KG...      known payload of all logs, or of each in their order; repeatable. With --design:
        of its runs
    --candidates N       motions that a design tries (default: 24)
    --currents FILE.csv  write the currents of the design
    --parameter NAME...  parameter, or one part of it such as plant.coulomb_Nm.0; repeatable (default:
        {", ".join(DEFAULT)}): {", ".join(KINDS)}
    --window S           length of the windows (default: 0.2 s), or of a designed experiment
        (default: 4 s)
    --out FILE.toml      write the twin, if it is accepted; or the designed scenario
    --suggest            rank the parameters that are not identified by how much they would improve the
        held-out windows
    --report FILE.html   write a page about data, parameters, residuals and suggestions
    --json
    """,
    has_fields=True,
    needs={"--candidates": "--design", "--currents": "--design"},
    excludes={"--design": "--report --suggest"},
    logs=Path,
    payload=number("a number of kg, at least 0", from_zero),
    candidates=whole(10_000, first=2),
)
def run(options: argparse.Namespace) -> bool:
    """Identify parameters of a machine from logs, with 95 % intervals, judged by held-out windows.

    Exit code 1 if the data do not determine the parameters or the result is not better.
    """
    for path, suffix in ((options.out, ".toml"), (options.currents, ".csv"), (options.report, ".html")):
        if path:
            check_writable(path, suffix)
    if options.design:
        return _design(options)
    logs, changes = read_logs(options), changes_of(options)
    if options.report:
        prepare(options.report.parent)
    settings = IdentifySettings(
        suggest=options.suggest or bool(options.report),
        **({"window_s": options.window} if options.window else {}),
    )
    names = options.parameter or list(DEFAULT)
    with counted("identify", "evaluations") as count:
        result = identify(logs, scenario_of(options), names, changes, settings, count)
    if options.json:
        print_json({**_figures(result), "logs": {log.name: log.digest for log in logs}})
    else:
        _print(result, is_suggesting=options.suggest)
    written = []
    if result.accepted and options.out:
        write_twin(options.out, result, scenario_of(options), changes, logs)
        written.append(options.out)
    if options.report:
        command = f"spheretwin identify {' '.join(map(str, options.logs))}"
        history = read_history(options.out) if options.out else []
        report.write(options.report, result, logs, scenario_of(options), changes, command, history)
        written.append(options.report)
    if not options.json:
        runs.print_written(written)
    if result.nothing_to_correct:
        print_message("identify: nothing to correct: the values of the scenario are those of the logs")
    for reason in result.reasons:
        print_message(f"identify: not accepted: {reason}")
    return result.accepted


def _design(options: argparse.Namespace) -> bool:
    """Print the best motion, and write it."""
    scenario, *others = (str(path) for path in options.logs)
    if others or options.scenario:
        raise InputError(
            f"command line: expected --design with one scenario, as identify --design sinusoid, received"
            f" {' '.join([scenario, *others, *filter(None, [options.scenario])])}"
        )
    given = {"duration_s": options.window, "candidates": options.candidates, "payloads_kg": options.payload}
    settings = DesignSettings(**{name: value for name, value in given.items() if value})
    names = options.parameter or list(DEFAULT)
    excitation = design(scenario, names, changes_of(options), settings, tracked("design"))
    written = []
    if options.out:
        save_text(options.out, as_toml(excitation.scenario))
        written.append(options.out)
    if options.currents:
        save_text(options.currents, _currents(excitation.runs[0]))
        written.append(options.currents)
    figures = {"deviations": excitation.deviations, "nutation": excitation.reference}
    figures["narrower"] = excitation.narrower
    return print_result(options, "identify", figures, [report.design_table(excitation)], written=written)


def _currents(run: Table) -> str:
    """Return the currents of a run as the file of a scenario's manual.file."""
    current_A = run["current_command_A"]
    head = ",".join(["t_s", *(f"current_{j:02d}_A" for j in range(current_A.shape[1]))])
    rows = (
        ",".join(repr(float(value)) for value in (t_s, *row))
        for t_s, row in zip(run["t_s"], current_A, strict=True)
    )
    return "\n".join([head, *rows, ""])


def _figures(result: Identified) -> dict[str, object]:
    fits = {"train": result.train, "held_out": result.held_out}
    return {
        "accepted": result.accepted,
        "nothing_to_correct": result.nothing_to_correct,
        "parameters": result.parameters,
        "refused": result.refused,
        "correlations": result.correlations,
        "chi2": {name: fit.chi2 if fit else None for name, fit in fits.items()},
        "improvement": result.improvement,
        "suggestions": result.suggestions,
    }


def _print(result: Identified, *, is_suggesting: bool) -> None:
    if result.parameters:
        runs.print_rows(*report.parameter_table(result))
    for line in result.correlations:
        print(line)
    if result.held_out and result.held_out_before:
        before, after = result.held_out_before, result.held_out
        print(
            f"held-out windows: mean square over that of the noise {before.chi2:.3f} before, {after.chi2:.3f}"
            f" after; error {result.improvement:.1%} smaller"
        )
    if result.suggestions:
        runs.print_rows(*report.suggestion_table(result.suggestions[: report.MOST_ROWS]))
    elif is_suggesting:
        print(report.NO_SUGGESTION)
