"""Tables of runs, studies, tunings, files and scenario fields, on stdout."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.markup import escape

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Level, Status, named
from spheretwin.viz.terminal import tables
from spheretwin.viz.terminal.tables import three_digits

ERRORS = {
    "largest": "max_abs_error_rad",
    "rms": "rms_error_rad",
    "rms, second half": "tail_rms_error_rad",
}

COLOURS = {Level.INFO: "italic", Level.WARN: "bold yellow", Level.ERROR: "bold red"}


def print_run(law: str, planned_s: float, summary: dict[str, Any], own: Sequence[str] = ()) -> None:
    """Print the figures of one run: errors per axis, currents and speed, then the user's own metrics."""
    console, status = tables.terminal_console(), named(summary["status"])
    title = f"{summary['scenario']['name']} under {law}: {_ending(status, planned_s, summary)}"
    errors = tables.new_table(title, "tracking error, mrad (degrees)", *ANGLES)
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
    """Return the status of a run; if it did not complete, also time and reason."""
    if status == Status.COMPLETED:
        return status
    why = f", {summary['reason']}" if summary["reason"] else ""
    return f"{status} at {summary['simulated_s']:.3f} s of {planned_s:g} s{why}"


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
        console.print(f"open it:   rerun {escape(str(record))}", soft_wrap=True)


def print_study(name: str, result: dict[str, Any], summary: dict[str, Any]) -> None:
    """Print the results of a study: median and 95 % range of each figure, rows by status, for each law."""
    figures = [figure for figure in next(iter(summary.values()), {}) if figure != "statuses"]
    table = tables.new_table(
        f"{name}: {result['rows']} of {result['of']} rows", "median (95 % range)", *summary
    )
    for figure in figures:
        table.add_row(figure, *(_spread(of_law[figure]) for of_law in summary.values()))
    counts = [of_law["statuses"] for of_law in summary.values()]
    for status in sorted({status for statuses in counts for status in statuses}):
        table.add_row(status, *(str(statuses.get(status, 0)) for statuses in counts))
    tables.terminal_console().print(table)
    if result["startup_s"] is not None:
        tables.terminal_console().print(
            f"took   {result['wall_s']:.1f} s, {result['startup_s']:.1f} s of it to start"
        )
    tables.terminal_console().print(f"table  {escape(result['table'])}", soft_wrap=True)


def _spread(figure: dict[str, Any]) -> str:
    if figure["median"] is None:
        return "–"
    low, high = figure["range_95"]
    return f"{figure['median']:.4g} ({low:.4g} to {high:.4g})"


def print_written(paths: Sequence[Path]) -> None:
    """Print the paths of written files."""
    for path in paths:
        tables.terminal_console().print(f"written  {escape(str(path))}", soft_wrap=True)


def print_rows(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], texts: int) -> None:
    """Print a table whose first `texts` columns are words."""
    table = tables.new_table(title, head[0], *head[1:])
    for column in table.columns[1:texts]:
        column.justify = "left"
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    tables.terminal_console().print(table)


def print_fields(scenario: str, rows: Sequence[tuple[str, str, str]]) -> None:
    """Print every field of a scenario with its value and meaning."""
    table = tables.new_table(f"fields of {scenario}", "flag")
    table.columns[0].no_wrap = True
    table.add_column("value", overflow="fold", max_width=24)
    table.add_column("meaning", overflow="fold")
    for row in rows:
        table.add_row(*map(escape, row))
    tables.terminal_console().print(table)


FACTS = ("scenario", "law", "modelling_error", "load", "hardware", "seed", "status", "reason", "simulated_s")
MOST_EVENTS = 12


class _FigureRow(NamedTuple):
    """A figure of every run."""

    label: str
    key: str
    unit: str
    each_axis: bool = False


ROWS = (
    *(_FigureRow(label, key, "rad", True) for label, key in ERRORS.items()),
    _FigureRow("overshoot", "overshoot_rad", "rad", True),
    _FigureRow("settled after", "settling_time_s", "s", True),
    _FigureRow("largest current", "max_abs_current_A", "A"),
    _FigureRow("share of ticks at the limit", "saturated_fraction", "1"),
    _FigureRow("rms torque", "rms_torque_Nm", "N·m"),
    _FigureRow("variation of the commands", "current_variation_A_s", "A/s"),
    _FigureRow("copper loss", "copper_loss_J", "J"),
    _FigureRow("work on the rotor", "mechanical_work_J", "J"),
    _FigureRow("energy", "energy_J", "J"),
)


def print_runs(runs: Sequence[dict[str, Any]]) -> None:
    """Print the reports of runs."""
    if len(runs) == 1:
        _print_one(runs[0])
    else:
        _print_differences(runs)


def _print_one(run: dict[str, Any]) -> None:
    console = tables.terminal_console()
    ending = run["status"] or "not closed"
    title = f"{run['scenario']} under {run['law']}: {ending} at {run['simulated_s']:.3f} s"
    table = tables.new_table(title, "tracking error, mrad (degrees)", *ANGLES)
    if run["status"]:
        table.title_style = COLOURS[named(run["status"]).level]
    for row in ROWS:
        if row.each_axis:
            table.add_row(row.label, *(_figure(value, row.unit) for value in run[row.key] or ()))
    table.add_row(
        "strongest at", *("\n".join(map(_peak, run["error_peaks"][axis])) or "–" for axis in ANGLES)
    )
    console.print(table)
    for row in ROWS:
        if not row.each_axis:
            console.print(f"{row.label} {_figure(run[row.key], row.unit)}")
    facts = [f"{name} {run[name]}" for name in FACTS[2:6]]
    console.print(escape(", ".join(facts) + (f", {run['reason']}" if run["reason"] else "")), soft_wrap=True)
    for event in run["events"][:MOST_EVENTS]:
        console.print(escape(f"{event['t_s']:8.3f} s  {event['text']}"), soft_wrap=True)
    if (more := len(run["events"]) - MOST_EVENTS) > 0:
        console.print(f"and {more} more events; --json has them all")


def _peak(peak: dict[str, float]) -> str:
    return f"{three_digits(peak['frequency_Hz'])} Hz: {angle(peak['amplitude_rad'])}"


def _print_differences(runs: Sequence[dict[str, Any]]) -> None:
    title = f"{len(runs)} runs, differences from the first"
    table = tables.new_table(title, "angles in mrad (degrees)", *(Path(run["path"]).name for run in runs))
    for label, *cells in differences(runs):
        table.add_row(label, *map(escape, cells))
    tables.terminal_console().print(table)


def differences(runs: Sequence[dict[str, Any]]) -> Iterator[list[str]]:
    """Yield facts and figures, one cell for each run; the others with their difference from the first."""
    for name in FACTS:
        yield [name, *("–" if run[name] is None else f"{run[name]}" for run in runs)]
    for row in ROWS:
        for place, axis in enumerate(ANGLES) if row.each_axis else ((None, ""),):
            values = [_entry(run[row.key], place) for run in runs]
            cells = [_figure(values[0], row.unit)]
            cells += [_with_difference(values[0], value, row.unit) for value in values[1:]]
            yield [f"{row.label} {axis}".strip(), *cells]


def _entry(value: Any, place: int | None) -> float | None:
    return value if place is None or value is None else value[place]


def _figure(value: float | None, unit: str) -> str:
    if value is None:
        return "–"
    if unit == "rad":
        return angle(value)
    return f"{three_digits(value)}{'' if unit == '1' else f' {unit}'}"


def _with_difference(first: float | None, value: float | None, unit: str) -> str:
    """Return a figure, and below it the difference from the first, absolute and in percent."""
    if first is None or value is None:
        return _figure(value, unit)
    if (difference := value - first) == 0:
        return "the same"
    sign = "+" if difference > 0 else "-"
    percent = f", {sign}{three_digits(100 * abs(difference / first))} %" if first else ""
    return f"{_figure(value, unit)}\n{sign}{_figure(abs(difference), unit)}{percent}"


NONE = "–"
MOST = 15
"""Trials of a front that are printed, evenly along it; the table has all."""


def print_tuning(name: str, result: dict[str, Any]) -> None:
    """Print the best trial of each law, or its front, with the gains at the start."""
    console = tables.terminal_console()
    for law, of_law in result["laws"].items():
        _print_law(f"{name}, {law}: {_counted(of_law)}", of_law)
        if len(of_law["best"]) > MOST:
            console.print(f"{MOST} of {len(of_law['best'])} on the front")
        if of_law["lost"]:
            console.print(f"lost first: {escape(of_law['lost'])}", soft_wrap=True)
        if len(of_law["best"]) == 1:
            console.print(escape(of_law["best"][0]["command"]), soft_wrap=True)
    console.print(f"table  {escape(result['table'])}", soft_wrap=True)


def _print_law(title: str, of_law: dict[str, Any]) -> None:
    chosen = [trial for trial in (of_law["start"], *of_law["best"]) if trial]
    if not chosen:
        tables.terminal_console().print(escape(f"{title}: none completed"), soft_wrap=True)
        return
    gains = list(chosen[0]["gains"])
    values = next((list(trial["values"]) for trial in chosen if trial["values"]), [])
    is_fresh = any(trial["fresh"] or trial["fresh_reason"] for trial in chosen)
    fresh = [f"{name}, fresh seeds" for name in values] if is_fresh else []
    table = tables.new_table(title, "trial", *gains, *values, *fresh)
    rows = [("start", of_law["start"])] if of_law["start"] else []
    for label, trial in rows + [(str(trial["trial"]), trial) for trial in _some(of_law["best"])]:
        cells = ["off" if value is None else f"{value:.4g}" for value in map(trial["gains"].get, gains)]
        cells += _cells(trial["values"], values, trial["ended"])
        cells += _cells(trial["fresh"], values, "lost") if is_fresh else []
        table.add_row(label, *cells)
    tables.terminal_console().print(table)


def _cells(figures: dict[str, float] | None, names: list[str], otherwise: str) -> list[str]:
    return (
        [f"{figures[name]:.4g}" for name in names] if figures else [otherwise if names else NONE] * len(names)
    )


def _some(best: list[dict[str, Any]]) -> list[dict[str, Any]]:
    if len(best) <= MOST:
        return best
    return [best[round(place * (len(best) - 1) / (MOST - 1))] for place in range(MOST)]


def _counted(of_law: dict[str, Any]) -> str:
    ended = ", ".join(f"{count} {how}" for how, count in of_law["ended"].items() if count)
    return f"{ended or 'no trials'}; {of_law['rows']} rows"
