"""For people, on stdout: what a run found, where files are, and what a scenario's fields are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Level, Status, named
from spheretwin.viz.terminal import style
from spheretwin.viz.terminal.style import three_digits

ERRORS = {
    "largest": "max_abs_error_rad",
    "rms": "rms_error_rad",
    "rms, second half": "tail_rms_error_rad",
}

COLOURS = {Level.INFO: "italic", Level.WARN: "bold yellow", Level.ERROR: "bold red"}


def print_run(law: str, planned_s: float, summary: dict[str, Any], own: Sequence[str] = ()) -> None:
    """Print the figures of one run: errors per axis, currents and speed, then those of the user's own."""
    console, status = style.console(), named(summary["status"])
    title = f"{summary['scenario']['name']} under {law}: {_ending(status, planned_s, summary)}"
    errors = style.table(title, "tracking error, mrad (degrees)", *ANGLES)
    errors.title_style = COLOURS[status.level]
    for label, key in ERRORS.items():
        errors.add_row(label, *(angle(value) for value in summary[key] or ()))
    settled = summary["settling_time_s"] or ()
    errors.add_row("settled after", *("never" if t is None else f"{three_digits(t)} s" for t in settled))
    console.print(errors)
    if summary["max_abs_current_A"] is not None:
        console.print(
            f"largest current {summary['max_abs_current_A']:.2f} A,"
            f" the limit cut the torque at {100 * summary['saturated_fraction']:.1f} % of the ticks"
        )
    if summary["rms_torque_Nm"] is not None:
        console.print(
            f"rms torque {summary['rms_torque_Nm']:.4f} N·m, copper {summary['copper_loss_J']:.2f} J"
        )
    if summary["current_variation_A_s"] is not None:
        console.print(f"commands vary by {summary['current_variation_A_s']:.1f} A/s a group")
    for name in own:
        console.print(f"{name} {escape(str(summary[name]))}", soft_wrap=True)
    if summary["realtime_factor"] is not None:
        console.print(
            f"{summary['simulated_s']:g} s simulated in {summary['wall_s']:.3f} s:"
            f" {summary['realtime_factor']:.0f} times real time"
        )
    for note in summary["notes"]:
        console.print(escape(note), soft_wrap=True)
    for warning in summary["warnings"]:
        console.print(f"[yellow]warning[/yellow]  {escape(warning)}", soft_wrap=True)


def _ending(status: Status, planned_s: float, summary: dict[str, Any]) -> str:
    """How a run ended; where it did not complete, also when, and why."""
    if status == Status.COMPLETED:
        return status
    why = f", {summary['reason']}" if summary["reason"] else ""
    return f"{status} at {summary['simulated_s']:.3f} s of {planned_s:g} s{why}"


def angle(value_rad: float) -> str:
    """An angle in mrad, and in degrees behind it."""
    return f"{three_digits(1e3 * value_rad)} ({three_digits(math.degrees(value_rad))}°)"


def print_scenarios(descriptions: Mapping[str, str]) -> None:
    """Print what scenarios there are, a line each."""
    width = max(map(len, descriptions))
    for name, description in descriptions.items():
        style.console().print(f"{name:{width}}  {escape(description)}", soft_wrap=True)


def print_files(record: Path | None, telemetry: Path | None) -> None:
    """Print where a run's files are and how to open them."""
    console = style.console()
    if telemetry:
        console.print(f"telemetry  {escape(str(telemetry))}", soft_wrap=True)
    if record:
        console.print(f"recording  {escape(str(record))}", soft_wrap=True)
        console.print(f"open it:   rerun {escape(str(record))}", soft_wrap=True)


def print_study(name: str, found: dict[str, Any], summary: dict[str, Any]) -> None:
    """Print what a study found: rows by status, then each figure's median and 95 % range, a column a law."""
    figures = [figure for figure in next(iter(summary.values()), {}) if figure != "statuses"]
    table = style.table(f"{name}: {found['rows']} of {found['of']} rows", "median (95 % range)", *summary)
    for figure in figures:
        table.add_row(figure, *(_spread(of_law[figure]) for of_law in summary.values()))
    counts = [of_law["statuses"] for of_law in summary.values()]
    for status in sorted({status for each in counts for status in each}):
        table.add_row(status, *(str(each.get(status, 0)) for each in counts))
    style.console().print(table)
    if found["startup_s"] is not None:
        style.console().print(f"took   {found['wall_s']:.1f} s, {found['startup_s']:.1f} s of it to start")
    style.console().print(f"table  {escape(found['table'])}", soft_wrap=True)


def _spread(figure: dict[str, Any]) -> str:
    if figure["median"] is None:
        return "–"
    low, high = figure["range_95"]
    return f"{figure['median']:.4g} ({low:.4g} to {high:.4g})"


def print_written(paths: Sequence[Path]) -> None:
    """Print where other files were written."""
    for path in paths:
        style.console().print(f"written  {escape(str(path))}", soft_wrap=True)


def print_rows(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], texts: int) -> None:
    """Print a table whose first `texts` columns are words."""
    table = style.table(title, head[0], *head[1:])
    for column in table.columns[1:texts]:
        column.justify = "left"
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    style.console().print(table)


def print_fields(scenario: str, rows: Sequence[tuple[str, str, str]]) -> None:
    """Print every field of a scenario with its value and meaning."""
    table = style.table(f"fields of {scenario}", "flag")
    table.columns[0].no_wrap = True
    table.add_column("value", overflow="fold", max_width=24)
    table.add_column("meaning", overflow="fold")
    for row in rows:
        table.add_row(*map(escape, row))
    style.console().print(table)
