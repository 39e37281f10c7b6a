"""Runs that are reviewed, for people, on stdout: one by itself, several by how they differ from the first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.markup import escape

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import named
from spheretwin.viz.terminal import style
from spheretwin.viz.terminal.style import three_digits
from spheretwin.viz.terminal.tables import COLOURS, ERRORS, angle

FACTS = ("scenario", "law", "modelling_error", "load", "hardware", "seed", "status", "reason", "simulated_s")
MOST_EVENTS = 12


class _Row(NamedTuple):
    """A figure of every run."""

    label: str
    key: str
    unit: str
    each_axis: bool = False


ROWS = (
    *(_Row(label, key, "rad", True) for label, key in ERRORS.items()),
    _Row("overshoot", "overshoot_rad", "rad", True),
    _Row("settled after", "settling_time_s", "s", True),
    _Row("largest current", "max_abs_current_A", "A"),
    _Row("share of ticks at the limit", "saturated_fraction", "1"),
    _Row("rms torque", "rms_torque_Nm", "N·m"),
    _Row("variation of the commands", "current_variation_A_s", "A/s"),
    _Row("copper loss", "copper_loss_J", "J"),
    _Row("work on the rotor", "mechanical_work_J", "J"),
    _Row("energy", "energy_J", "J"),
)


def print_runs(runs: Sequence[dict[str, Any]]) -> None:
    """Print what was found of runs."""
    if len(runs) == 1:
        _print_one(runs[0])
    else:
        _print_differences(runs)


def _print_one(run: dict[str, Any]) -> None:
    console = style.console()
    ending = run["status"] or "not closed"
    title = f"{run['scenario']} under {run['law']}: {ending} at {run['simulated_s']:.3f} s"
    table = style.table(title, "tracking error, mrad (degrees)", *ANGLES)
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
    told = [f"{name} {run[name]}" for name in FACTS[2:6]]
    console.print(escape(", ".join(told) + (f", {run['reason']}" if run["reason"] else "")), soft_wrap=True)
    for event in run["events"][:MOST_EVENTS]:
        console.print(escape(f"{event['t_s']:8.3f} s  {event['text']}"), soft_wrap=True)
    if (more := len(run["events"]) - MOST_EVENTS) > 0:
        console.print(f"and {more} more events; --json has them all")


def _peak(peak: dict[str, float]) -> str:
    return f"{three_digits(peak['frequency_Hz'])} Hz: {angle(peak['amplitude_rad'])}"


def _print_differences(runs: Sequence[dict[str, Any]]) -> None:
    title = f"{len(runs)} runs, differences from the first"
    table = style.table(title, "angles in mrad (degrees)", *(Path(run["path"]).name for run in runs))
    for label, *cells in differences(runs):
        table.add_row(label, *map(escape, cells))
    style.console().print(table)


def differences(runs: Sequence[dict[str, Any]]) -> Iterator[list[str]]:
    """Facts and figures, each with a cell a run: of the others also how far each is from the first's."""
    for name in FACTS:
        yield [name, *("–" if run[name] is None else f"{run[name]}" for run in runs)]
    for row in ROWS:
        for place, axis in enumerate(ANGLES) if row.each_axis else ((None, ""),):
            values = [_entry(run[row.key], place) for run in runs]
            told = [_figure(values[0], row.unit)]
            told += [_beside(values[0], each, row.unit) for each in values[1:]]
            yield [f"{row.label} {axis}".strip(), *told]


def _entry(value: Any, place: int | None) -> float | None:
    return value if place is None or value is None else value[place]


def _figure(value: float | None, unit: str) -> str:
    if value is None:
        return "–"
    if unit == "rad":
        return angle(value)
    return f"{three_digits(value)}{'' if unit == '1' else f' {unit}'}"


def _beside(first: float | None, value: float | None, unit: str) -> str:
    """A figure, and below it how far it is from the first, absolute and in percent."""
    if first is None or value is None:
        return _figure(value, unit)
    if (difference := value - first) == 0:
        return "the same"
    sign = "+" if difference > 0 else "-"
    percent = f", {sign}{three_digits(100 * abs(difference / first))} %" if first else ""
    return f"{_figure(value, unit)}\n{sign}{_figure(abs(difference), unit)}{percent}"
