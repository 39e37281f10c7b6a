"""Results of one run, names of files, and other tables, on stdout."""

from __future__ import annotations

import math
import shlex
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Level, Status, named
from spheretwin.viz.terminal import tables
from spheretwin.viz.terminal.tables import percent, three_digits

ERRORS = {
    "largest": "max_abs_error_rad",
    "rms": "rms_error_rad",
    "rms, second half": "tail_rms_error_rad",
}

COLOURS = {Level.INFO: "italic", Level.WARN: "bold yellow", Level.ERROR: "bold red"}


def print_run(
    law: str,
    planned_s: float,
    summary: dict[str, Any],
    own: Sequence[str] = (),
    *,
    band_rad: float,
    faults: Sequence[str] = (),
    why: str | None = None,
) -> None:
    """Print the results of one run: errors of each axis, currents, speed, faults, user metrics.

    Parameters
    ----------
    law : str
    planned_s : float
        Planned duration, s.
    summary : dict
        Summary of the run.
    own : sequence of str
        Names of user metrics.
    band_rad : float
        Settling band, rad.
    faults : sequence of str
        Description of each fault.
    why : str, optional
        Reason for which the run ended early.
    """
    console, status = tables.terminal_console(), named(summary["status"])
    scenario = summary["scenario"]
    ending = _ending(status, planned_s, summary["simulated_s"], why)
    title = f"{scenario['name']} under {law}, {scenario['hardware']} hardware: {ending}"
    errors = tables.new_table(title, "tracking error, mrad (degrees)", *ANGLES)
    errors.title_style = COLOURS[status.level]
    for label, key in ERRORS.items():
        errors.add_row(label, *(angle(value) for value in summary[key] or ()))
    settled = summary["settling_time_s"] or ()
    errors.add_row(
        settled_label(band_rad), *("never" if t is None else f"{three_digits(t)} s" for t in settled)
    )
    tables.print_table(errors)
    if summary["max_abs_current_A"] is not None:
        console.print(
            f"largest current {summary['max_abs_current_A']:.2f} A,"
            f" the limit cut the torque at {percent(summary['saturated_fraction'])} of the ticks"
        )
    if summary["rms_torque_Nm"] is not None:
        console.print(
            f"rms torque {summary['rms_torque_Nm']:.4f} N·m, copper {summary['copper_loss_J']:.2f} J"
        )
    if summary["current_variation_A_s"] is not None:
        console.print(f"commands vary by {summary['current_variation_A_s']:.1f} A/s a group")
    for fault in faults:
        console.print(escape(f"fault {fault}"), soft_wrap=True)
    for name in own:
        console.print(f"{name} {escape(str(summary[name]))}", soft_wrap=True)
    if summary["realtime_factor"] is not None:
        console.print(
            f"{summary['simulated_s']:g} s simulated in {summary['wall_s']:.3f} s:"
            f" {three_digits(summary['realtime_factor'])} times real time"
        )
    for note in summary["notes"]:
        console.print(escape(note), soft_wrap=True)
    for warning in summary["warnings"]:
        console.print(f"[yellow]warning[/yellow]  {escape(warning)}", soft_wrap=True)


def settled_label(band_rad: float) -> str:
    """Return the label of the settling time, with its band."""
    return f"settled to ±{1e3 * band_rad:g} mrad after"


def _ending(status: Status, planned_s: float, simulated_s: float, why: str | None) -> str:
    """Return the status of a run; if it did not complete, also time and reason."""
    if status == Status.COMPLETED:
        return status
    return f"{status} at {simulated_s:.3f} s of {planned_s:g} s{f', {why}' if why else ''}"


def angle(value_rad: float) -> str:
    """Return an angle in mrad, followed by degrees."""
    return f"{three_digits(1e3 * value_rad)} ({three_digits(math.degrees(value_rad))}°)"


def print_scenarios(descriptions: Mapping[str, str]) -> None:
    """Print the scenarios, one line each."""
    width = max(map(len, descriptions))
    for name, description in descriptions.items():
        tables.terminal_console().print(f"{name:{width}}  {escape(description)}", soft_wrap=True)


def print_files(record: Path | None, telemetry: Path | None) -> None:
    """Print the paths of the files of a run, and the command that opens the recording."""
    console = tables.terminal_console()
    if telemetry:
        console.print(f"telemetry  {escape(str(telemetry))}", soft_wrap=True)
    if record:
        console.print(f"recording  {escape(str(record))}", soft_wrap=True)
        command = shlex.join([rerun_command(), str(record)])
        console.print(f"open it:   {escape(command)}", soft_wrap=True)


def print_link(link: Mapping[str, Any]) -> None:
    """Print the counts of frames and the distributions of times of a link, one line each."""
    console = tables.terminal_console()
    counts = ", ".join(f"{count} {name}" for name, count in link["frames"].items() if count)
    console.print(f"frames received: {counts or 'none'}", soft_wrap=True)
    for name in ("latency", "turnaround", "jitter"):
        times = link.get(name, {})
        if times.get("max_ms") is not None:
            quantiles = ", ".join(f"{key.removesuffix('_ms')} {value:.3g} ms" for key, value in times.items())
            console.print(f"{name}: {quantiles}")


def rerun_command() -> str:
    """Return the command that starts the viewer from this folder: a name on the search path, or a path."""
    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    installed = Path(sys.executable).with_name(name)
    on_path = shutil.which("rerun")
    if not installed.exists() or (on_path and Path(on_path).samefile(installed)):
        return "rerun"
    try:
        return str(installed.relative_to(Path.cwd()))
    except ValueError:
        return str(installed)


def print_written(paths: Sequence[Path]) -> None:
    """Print the paths of written files."""
    for path in paths:
        tables.terminal_console().print(f"written  {escape(str(path))}", soft_wrap=True)


def print_rows(
    title: str, head: Sequence[str], rows: Sequence[Sequence[str]], texts: int = 1, words: Sequence[str] = ()
) -> None:
    """Print a table of the fields of `pages.markdown.Table`."""
    table = tables.new_table(title, head[0], *head[1:])
    for place, (column, name) in enumerate(zip(table.columns, head, strict=True)):
        column.justify = "left" if not place or place < texts or name in words else "right"
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    tables.print_table(table, labels=max(1, min(texts, 2, len(head) - 1)))
