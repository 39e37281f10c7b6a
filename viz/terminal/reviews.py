"""Reports of recorded runs as tables, on stdout: one run, or several with their differences."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.markup import escape

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import named
from spheretwin.viz.terminal import tables
from spheretwin.viz.terminal.runs import NONE, ReportedMetric, angle, metrics, print_metrics, print_rows
from spheretwin.viz.terminal.tables import three_digits

FACTS = ("scenario", "law", "modelling_error", "load", "hardware", "seed", "status", "reason", "simulated_s")
RESULTS = ("status", "reason", "simulated_s")
"""Facts that are results of a run; the others are fields of its scenario."""

MOST_EVENTS = 12


class NominalError(NamedTuple):
    """Difference of the controller's nominal model from the truth."""

    field: str
    nominal: str
    true: str


class SignalTolerance(NamedTuple):
    """Comparison of one signal of a run with the reference."""

    signal: str
    share: float
    """Largest share of the tolerance that the signal used; above 1 it exceeds its tolerance."""
    axis: str
    """Label of the entry with that share; empty for a signal of one number."""
    t_s: float
    """Time of that share, s."""
    excess: float
    """Excess over the tolerance at that time, in the unit of the signal; 0 within it."""


def print_run_report(run: dict[str, Any], nominal_errors: Sequence[NominalError], band_rad: float) -> None:
    """Print the report of one run.

    Parameters
    ----------
    run : dict
        Report of the run.
    nominal_errors : sequence of NominalError
        What the controller believed where it differs from the truth.
    band_rad : float
        Settling band, rad.
    """
    console = tables.terminal_console()
    ending = run["status"] or "not closed"
    title = f"{run['scenario']} under {run['law']}: {ending} at {run['simulated_s']:.3f} s"
    peaks = [
        [peaks[place] if place < len(peaks) else None for peaks in run["error_peaks"].values()]
        for place in range(max(map(len, run["error_peaks"].values())))
    ]
    oscillations = [
        (f"{name} oscillation", *(_peak(peak) if peak else NONE for peak in of_axes))
        for name, of_axes in zip(("strongest", "second", "third"), peaks, strict=False)
    ]
    print_metrics(title, named(run["status"]).level if run["status"] else None, run, band_rad, oscillations)
    facts = [f"{name} {run[name]}" for name in FACTS[2:6]]
    console.print(escape(", ".join(facts) + (f", {run['reason']}" if run["reason"] else "")), soft_wrap=True)
    for event in run["events"][:MOST_EVENTS]:
        console.print(escape(f"{event['t_s']:8.3f} s  {event['text']}"), soft_wrap=True)
    if (more := len(run["events"]) - MOST_EVENTS) > 0:
        console.print(f"and {more} more events; --json has them all")
    _print_nominal_errors([Path(run["path"]).name], [nominal_errors])


def _peak(peak: Mapping[str, float]) -> str:
    return f"{three_digits(peak['frequency_Hz'])} Hz: {angle(peak['amplitude_rad'])}"


def print_comparison(
    runs: Sequence[dict[str, Any]],
    fields: Mapping[str, Sequence[str]],
    nominal_errors: Sequence[Sequence[NominalError]],
    band_rad: float,
) -> None:
    """Print how several runs differ: their scenarios, their nominal models, their figures.

    Parameters
    ----------
    runs : sequence of dict
        Report of each run.
    fields : mapping
        Fields in which the scenarios differ, with the value in each run.
    nominal_errors : sequence of sequence of NominalError
        For each run, what the controller believed where it differs from the truth.
    band_rad : float
        Settling band, rad.
    """
    console, names = tables.terminal_console(), [Path(run["path"]).name for run in runs]
    if fields:
        rows = [(field, *values) for field, values in fields.items()]
        print_rows("fields in which the runs differ", ("field", *names), rows, 1)
    else:
        console.print("The scenarios of the runs do not differ.")
    _print_nominal_errors(names, nominal_errors)
    table = tables.new_table(
        f"{len(runs)} runs, differences from the first", "angles in mrad (degrees)", *names
    )
    shared = []
    for label, *cells in differences(runs, band_rad):
        if label in FACTS and label not in RESULTS:
            if len(set(cells)) == 1:
                shared.append(f"{label} {cells[0]}")
        elif set(cells) != {NONE}:
            table.add_row(label, *map(escape, cells))
    tables.print_table(table, labels=2)
    if shared:
        console.print(f"in all runs: {escape(', '.join(shared))}")


def _print_nominal_errors(names: Sequence[str], nominal_errors: Sequence[Sequence[NominalError]]) -> None:
    """Print a row for each nominal value that differs from the truth, once for all runs that share it."""
    rows: dict[NominalError, list[str]] = {}
    for name, of_run in zip(names, nominal_errors, strict=True):
        for error in of_run:
            rows.setdefault(error, []).append(name)
    if not rows:
        return
    table = tables.new_table(
        "what the controller believed where it differs from the truth", "field", "run", "controller", "truth"
    )
    for error, of_runs in rows.items():
        label = "all" if len(of_runs) == len(names) > 1 else ", ".join(of_runs)
        table.add_row(*map(escape, (error.field, label, error.nominal, error.true)))
    tables.print_table(table, labels=2)


def print_tolerances(reference: str, run: str, signals: Sequence[SignalTolerance]) -> None:
    """Print for each signal of a run the share of its tolerance that it used, and the largest excess."""
    within = sum(signal.share <= 1 for signal in signals)
    title = f"{run} against {reference}: {within} of {len(signals)} signals within their tolerances"
    table = tables.new_table(title, "signal", "tolerance used", "largest at", "largest excess")
    for signal in signals:
        table.add_row(
            escape(signal.signal),
            _share(signal.share),
            f"{f'{signal.axis}, ' if signal.axis else ''}{signal.t_s:.6g} s" if signal.share else NONE,
            f"{signal.excess:.3g}" if signal.share > 1 else NONE,
            style="" if signal.share <= 1 else "bold red",
        )
    tables.print_table(table)


def _share(share: float) -> str:
    if not math.isfinite(share):
        return "exceeded"
    return f"×{three_digits(share)}"


def differences(runs: Sequence[dict[str, Any]], band_rad: float) -> Iterator[list[str]]:
    """Yield facts and figures, one cell for each run; the others with their difference from the first."""
    for name in FACTS:
        yield [name, *(NONE if run[name] is None else f"{run[name]}" for run in runs)]
    for row in metrics(band_rad):
        for place, axis in enumerate(ANGLES) if row.each_axis else ((None, ""),):
            values = [_entry(run[row.key], place) for run in runs]
            cells = [row.text(values[0])]
            cells += [_with_difference(values[0], value, row) for value in values[1:]]
            yield [f"{row.label} {axis}".strip(), *cells]


def _entry(value: Any, place: int | None) -> float | None:
    return value if place is None or value is None else value[place]


def _with_difference(first: float | None, value: float | None, row: ReportedMetric) -> str:
    """Return a figure, and below it the difference from the first, absolute and relative."""
    if first is None or value is None:
        return row.text(value)
    if (difference := value - first) == 0:
        return "the same"
    relative = _relative(first, value, signed=row.signed)
    return f"{row.text(value)}\n{_change(difference, row.unit)}{relative}"


def _change(difference: float, unit: str) -> str:
    """Return a difference with its sign; also one that is negligible as a figure has its digits."""
    sign, size = "+" if difference > 0 else "-", abs(difference)
    if unit == "1":
        return f"{sign}{_digits(100 * size)} %"
    if unit == "rad":
        return f"{sign}{_digits(1e3 * size)} ({sign}{_digits(math.degrees(size))}°)"
    return f"{sign}{_digits(size)} {unit}"


def _digits(value: float) -> str:
    return three_digits(value) if value >= tables.LEAST or not math.isfinite(value) else f"{value:.2e}"


def _relative(first: float, value: float, *, signed: bool) -> str:
    """Return the ratio to the first value after a multiplication sign; nothing if it has no meaning.

    A signed quantity has it only if the change is at most the first value: a smaller value is too close to
    zero to be a scale.
    """
    if first == 0 or not 0 <= value / first < math.inf or (signed and value / first > 2):
        return ""
    return f", ×{three_digits(value / first)}"
