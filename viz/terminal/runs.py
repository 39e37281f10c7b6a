"""Results of one run, names of files, and other tables, on stdout."""

from __future__ import annotations

import math
import shlex
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.markup import escape

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Level, Status, named
from spheretwin.viz.terminal import tables
from spheretwin.viz.terminal.tables import percent, three_digits

NONE = "–"
"""Cell without a value."""


class ReportedMetric(NamedTuple):
    """Metric of a run in reports."""

    label: str
    key: str
    unit: str
    each_axis: bool = False
    signed: bool = False
    """True if values of either sign occur: a value near zero is then no scale for a percentage."""
    none: str = NONE
    """Text without a value."""

    def text(self, value: float | None) -> str:
        """Return a value with its unit."""
        if value is None:
            return self.none
        if self.unit == "rad":
            return angle(value)
        return percent(value) if self.unit == "1" else f"{three_digits(value)} {self.unit}"


def metrics(band_rad: float) -> tuple[ReportedMetric, ...]:
    """Return the metrics of reports, those of each axis first; with a settling band, rad."""
    settled = f"settled to ±{1e3 * band_rad:g} mrad after"
    return (
        ReportedMetric("largest", "max_abs_error_rad", "rad", each_axis=True),
        ReportedMetric("rms", "rms_error_rad", "rad", each_axis=True),
        ReportedMetric("rms, second half", "tail_rms_error_rad", "rad", each_axis=True),
        ReportedMetric("overshoot", "overshoot_rad", "rad", each_axis=True),
        ReportedMetric(settled, "settling_time_s", "s", each_axis=True, none="never"),
        ReportedMetric("largest current", "max_abs_current_A", "A"),
        ReportedMetric("share of ticks at the limit", "saturated_fraction", "1"),
        ReportedMetric("rms torque", "rms_torque_Nm", "N·m"),
        ReportedMetric("variation of the commands", "current_variation_A_s", "A/s"),
        ReportedMetric("copper loss", "copper_loss_J", "J"),
        ReportedMetric("work on the rotor", "mechanical_work_J", "J", signed=True),
        ReportedMetric("energy", "energy_J", "J"),
    )


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
    print_metrics(title, status.level, summary, band_rad)
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


def print_metrics(
    title: str,
    level: Level | None,
    run: Mapping[str, Any],
    band_rad: float,
    more: Sequence[Sequence[str]] = (),
) -> None:
    """Print the metrics of a run: a table of those of each axis, with more rows, then a line for each other.

    Parameters
    ----------
    title : str
    level : Level, optional
        Level of the status of the run.
    run : mapping
        Values by key; metrics without one are left out.
    band_rad : float
        Settling band, rad.
    more : sequence of sequence of str
        Further rows of the table.
    """
    table = tables.new_table(title, "tracking error, mrad (degrees)", *ANGLES)
    if level:
        table.title_style = COLOURS[level]
    known = [metric for metric in metrics(band_rad) if metric.key in run]
    for metric in known:
        if metric.each_axis:
            table.add_row(metric.label, *map(metric.text, run[metric.key] or ()))
    for row in more:
        table.add_row(*row)
    tables.print_table(table)
    for metric in known:
        if not metric.each_axis and run[metric.key] is not None:
            tables.terminal_console().print(f"{metric.label} {metric.text(run[metric.key])}")


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
    for sender, count in link.get("refused_senders", {}).items():
        console.print(f"refused: {count} datagrams or more of {sender}", soft_wrap=True)
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
    """Print a table of the fields of `pages.markdown.ResultTable`."""
    table = tables.new_table(title, head[0], *head[1:])
    for place, (column, name) in enumerate(zip(table.columns, head, strict=True)):
        column.justify = "left" if not place or place < texts or name in words else "right"
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    tables.print_table(table, labels=max(1, min(texts, 2, len(head) - 1)))
