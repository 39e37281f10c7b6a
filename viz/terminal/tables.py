"""Tables for people, on stdout."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from spheretwin.models.telemetry.signals import ANGLES


def print_run(scenario: str, law: str, summary: dict[str, Any], own: Sequence[str] = ()) -> None:
    """Print the figures of one run: errors per axis, currents and speed, then those of the user's own."""
    console = Console()
    errors = Table(title=escape(f"{scenario} under {law}: {summary['status']}"), title_justify="left")
    errors.add_column("tracking error, rad")
    for axis in ANGLES:
        errors.add_column(axis, justify="right")
    rows = {
        "largest": "max_abs_error_rad",
        "rms": "rms_error_rad",
        "rms, second half": "tail_rms_error_rad",
    }
    for label, key in rows.items():
        errors.add_row(label, *(f"{value:.4f}" for value in summary[key] or ()))
    settled = summary["settling_time_s"] or ()
    errors.add_row("settled after", *("never" if t is None else f"{t:.3f} s" for t in settled))
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
    for warning in summary["warnings"]:
        console.print(f"[yellow]warning[/yellow]  {escape(warning)}", soft_wrap=True)


def print_files(record: Path | None, telemetry: Path | None) -> None:
    """Print where a run's files are and how to open them."""
    console = Console()
    if telemetry:
        console.print(f"telemetry  {escape(str(telemetry))}", soft_wrap=True)
    if record:
        console.print(f"recording  {escape(str(record))}", soft_wrap=True)
        console.print(f"open it:   rerun {escape(str(record))}", soft_wrap=True)


def print_fields(scenario: str, rows: Sequence[tuple[str, str, str]]) -> None:
    """Print every field of a scenario with its value and meaning."""
    table = Table(title=escape(f"fields of {scenario}"), title_justify="left", box=None, header_style="bold")
    table.add_column("flag", no_wrap=True)
    table.add_column("value", overflow="fold", max_width=24)
    table.add_column("meaning", overflow="fold")
    for row in rows:
        table.add_row(*map(escape, row))
    Console().print(table)
