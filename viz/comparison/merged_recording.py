"""Several runs as one recording: all in one actuator, and each quantity of all in one plot."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rerun as rr
from rerun.components import MarkerShape

from spheretwin.models.base.arrays import Array
from spheretwin.viz import theme
from spheretwin.viz.comparison.ghosts import Ghost, Line, Tip, below, send_lines, write_part
from spheretwin.viz.comparison.merged_layout import (
    BESIDE_TEXTS,
    COMPARE,
    DIFFERENCE,
    END,
    ERRORS,
    LARGE,
    LEGEND,
    MARKS,
    REFERENCE,
    RUNS,
    TIP,
    ComparisonView,
    QuantityPlot,
    application,
    layout,
)
from spheretwin.viz.comparison.runs import (
    ComparedRun,
    PlotRange,
    common_rows,
    leaders,
    quantity_ranges,
    settled_bounds,
    value_bounds,
)
from spheretwin.viz.layout.extents import labelled
from spheretwin.viz.layout.styles import MIDDLE, THICK, THIN
from spheretwin.viz.layout.view import SCENARIO
from spheretwin.viz.quantities import ERROR, Quantity, compared_quantities
from spheretwin.viz.recording.currents import CoilCurrents
from spheretwin.viz.recording.part import (
    RecordingPart,
    RecordingSubject,
    drawable,
    log_markdown,
    scalars,
    time_index,
)
from spheretwin.viz.recording.recorder import recorded
from spheretwin.viz.recording.scene3d import MovingActuator
from spheretwin.viz.recording.signals import Signals
from spheretwin.viz.recording.status import StateChanges, StateLanes, log_lines
from spheretwin.viz.scene.entities import size_of

STEPS = 6
"""Steps that can be labelled in the lowest of the plots."""


EDGE = 0.04
"""Share of the height of a plot that a mark at its edge takes."""


def write(path: Path, runs: Sequence[ComparedRun], subjects: Sequence[RecordingSubject], text: str) -> Path:
    """Write a recording of several runs; returns its path.

    Below the name of each run is the content of its own recording, and its lines in the common plots.

    Parameters
    ----------
    path : Path
    runs : sequence of ComparedRun
        At least two, with unique names.
    subjects : sequence of RecordingSubject
        Subject of each run.
    text : str
        Description of the runs, in Markdown.

    Raises
    ------
    InputError
        No file can be made there, or a mesh of a model cannot be read.
    SpheretwinError
        Writing failed; the previous file is unchanged.
    """
    for subject in subjects:
        _ = subject.meshes  # a missing one is reported before there is a file
    tables = [run.table for run in runs]
    quantities, leading = compared_quantities(tables), leaders(tables)
    ranges = quantity_ranges(quantities, runs, leading)
    errors = [quantity for quantity in quantities if quantity.group == ERRORS]
    differences = [_differences(quantity, runs) for quantity in errors]
    view = ComparisonView(
        tuple(run.name for run in runs),
        tuple(runs[place].name for place in leading),
        tuple(
            _plot_of(quantity, of_quantity, [quantity.column(run.rows) for run in runs])
            for quantity, of_quantity in zip(quantities, ranges, strict=True)
        ),
        _difference_plots(errors, differences, runs),
        max(float(table["t_s"][-1]) for table in tables),
        tuple(run.name for run in runs if StateChanges().of(run.table)),
        tuple(run.name for run in runs if run.events),
        tuple(run.name for run in runs if run.early_end),
        size_of(subjects[0].actuator),
    )
    colours = [theme.rgb(colour) for colour in theme.run_colours([run.law for run in runs])]
    with recorded(path, application(view), layout(view)) as recording:
        recording.send_recording_name(f"{len(runs)} runs")
        log_markdown(recording, RUNS, "\n".join([text, *_outside(quantities, ranges)]))
        _log_legend(recording, runs, colours)
        for place, (run, subject, colour) in enumerate(zip(runs, subjects, colours, strict=True)):
            of_run = below(recording, run.name)
            bodies = [Ghost(subject, colour)] if place else [MovingActuator(subject), CoilCurrents(subject)]
            parts: list[RecordingPart] = [
                Signals(subject),
                *bodies,
                Tip(subject, TIP, "q_rad", f"{place + 1}", colour),
                StateLanes(subject),
            ]
            _write_run(of_run, run, parts)
            for quantity, plot in zip(quantities, view.plots, strict=True):
                values = quantity.column(run.rows)
                width = THICK if quantity.desired else MIDDLE  # the reference is drawn over it
                entity = f"{COMPARE}/{quantity.name}"
                send_lines(of_run, entity, run.table["t_s"], Line(run.label, values, colour, width))
                _send_marks(of_run, f"{MARKS}/{quantity.name}", run, values, colour, (place, len(runs)))
                if run.early_end:
                    _send_end(of_run, f"{END}/{quantity.name}", run, _visible(values, plot.limits), colour)
        for quantity, of_runs in zip(errors, differences, strict=True):
            for run, colour, difference in zip(runs[1:], colours[1:], of_runs, strict=True):
                line = Line(run.label, difference.values, colour)
                send_lines(below(recording, run.name), f"{DIFFERENCE}/{quantity.name}", difference.t_s, line)
        for place in leading:
            run, reference = runs[place], below(recording, f"{REFERENCE}/{runs[place].name}")
            _write_reference(reference, run, subjects[place], quantities, alone=len(leading) == 1)
    return path


def _write_run(recording: rr.RecordingStream, run: ComparedRun, parts: Sequence[RecordingPart]) -> None:
    """Write the content of the run's own recording, except the text of its scenario."""
    recording.log(SCENARIO, rr.AnyValues(record=json.dumps(dict(run.record))), static=True)
    log_lines(recording, list(run.events))
    for part in parts:
        write_part(recording, run.table, part)


def _write_reference(
    recording: rr.RecordingStream,
    run: ComparedRun,
    subject: RecordingSubject,
    quantities: Sequence[Quantity],
    *,
    alone: bool,
) -> None:
    """Write the reference: lines, and the path of the tip."""
    colour, label = theme.DESIRED_TRACE, "reference" if alone else f"reference of {run.label}"
    write_part(recording, run.table, Tip(subject, TIP, "q_ref_rad", "", colour))
    for quantity in quantities:
        if quantity.desired:
            line = Line(label, quantity.desired(run.rows), theme.COMMAND, THIN)
            send_lines(recording, quantity.name, run.table["t_s"], line)


def _plot_of(quantity: Quantity, of_quantity: PlotRange, of_runs: Sequence[Array]) -> QuantityPlot:
    """Return the plot of a quantity, with limits of all values if some are outside of its range."""
    low, high, outside = of_quantity
    limits = quantity.limits or labelled(low, high, quantity.floor, STEPS)
    heading, desired = _heading(quantity), quantity.desired is not None
    whole = labelled(*value_bounds(of_runs), quantity.floor, STEPS) if outside else limits
    return QuantityPlot(quantity.name, heading, quantity.group, desired, limits, whole)


SYMBOLS = {"torque_command_norm_Nm": "τ", "largest_current_A": "i", "torque_margin": "margin"}
"""Names of quantities above plots of a small window; those of a hinge have the name of the hinge."""


def _heading(quantity: Quantity) -> str:
    """Return symbol and unit of a quantity that stands next to two others, else its title."""
    if quantity.group in (LARGE, BESIDE_TEXTS):
        return quantity.heading
    return f"{SYMBOLS.get(quantity.name, quantity.title.split()[0])} {quantity.unit}".removesuffix(" 1")


class ErrorDifference(NamedTuple):
    """Errors of a run minus those of the first one at the ticks of both."""

    t_s: Array
    values: Array


def _difference_plots(
    errors: Sequence[Quantity], differences: Sequence[Sequence[ErrorDifference]], runs: Sequence[ComparedRun]
) -> tuple[QuantityPlot, ...]:
    """Return the plots of the differences, with one range."""
    together = [np.concatenate([of.values for of in parts]) for parts in zip(*differences, strict=True)]
    limits = labelled(*settled_bounds(runs[1:], together, ERROR.floor), ERROR.floor, STEPS)
    return tuple(QuantityPlot(of.name, _heading(of), ERRORS, False, limits, limits) for of in errors)


def _differences(quantity: Quantity, runs: Sequence[ComparedRun]) -> list[ErrorDifference]:
    """Return the differences of every run but the first."""
    first, *others = runs
    differences = []
    for run in others:
        rows, of_first = common_rows(run.table, first.table)
        values = quantity.column(run.rows)[rows] - quantity.column(first.rows)[of_first]
        differences.append(ErrorDifference(run.table["t_s"][rows], values))
    return differences


def _outside(quantities: Sequence[Quantity], ranges: Sequence[PlotRange]) -> list[str]:
    """Return lines of Markdown that state the values outside of the ranges."""
    lines = [
        f"- {quantity.heading.replace('[', '(').replace(']', ')')}: {item.text()}"
        for quantity, of_quantity in zip(quantities, ranges, strict=True)
        for item in of_quantity.outside
    ]
    return ["", "## Values outside of the axes of plots marked as cut", "", *lines] if lines else []


def _log_legend(
    recording: rr.RecordingStream, runs: Sequence[ComparedRun], colours: Sequence[theme.Colour]
) -> None:
    """Log the colour and the label of each run below one another: a 2D view's y points down."""
    places = np.arange(len(runs), dtype=np.float64)
    ends = [[[0.0, y], [1.0, y]] for y in places]
    shade, radii = list(colours), rr.Radius.ui_points(2.0)
    labels = [drawable(f"{run.legend}; {run.errors}" if run.errors else run.legend) for run in runs]
    recording.log(LEGEND, rr.LineStrips2D(ends, colors=shade, radii=radii), static=True)
    texts = rr.Points2D(
        [[0.5, y] for y in places],
        colors=[theme.label_colour(colour) for colour in colours],
        radii=rr.Radius.ui_points(0.0),
        labels=labels,
        show_labels=True,
    )
    recording.log(f"{LEGEND}/text", texts, static=True)
    outlines = [[0.0, y] + 0.12 * _outline(place) for place, y in enumerate(places)]
    recording.log(f"{LEGEND}/{MARKS}", rr.LineStrips2D(outlines, colors=shade, radii=radii), static=True)


_OUTLINES = {
    MarkerShape.Circle: (24, 0),
    MarkerShape.Diamond: (4, 0),
    MarkerShape.Square: (4, 45),
    MarkerShape.Up: (3, -90),
    MarkerShape.Down: (3, 90),
    MarkerShape.Left: (3, 180),
    MarkerShape.Right: (3, 0),
}
"""Marker of each run; corners of its outline in the legend, and the direction of the first one, degrees."""

_MARKS_A_RUN = 12


def _outline(place: int) -> Array:
    """Return the closed outline of the marker of a run in the legend, (n, 2); a cross after the last."""
    if place % (len(_OUTLINES) + 1) == len(_OUTLINES):
        return np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
    corners, first_deg = list(_OUTLINES.values())[place % (len(_OUTLINES) + 1)]
    angles = np.radians(first_deg + np.linspace(0, 360, corners + 1))
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _send_marks(
    recording: rr.RecordingStream,
    entity: str,
    run: ComparedRun,
    values: Array,
    colour: theme.Colour,
    turn: tuple[int, int],
) -> None:
    """Send markers on the line of a run; those of different runs are at different times.

    Parameters
    ----------
    turn : (int, int)
        Place of the run, and number of runs.
    """
    place, count = turn
    shares = (np.arange(_MARKS_A_RUN) + (place + 0.5) / count) / _MARKS_A_RUN
    rows = np.unique((shares * len(values)).astype(int))
    rows = rows[np.isfinite(values[rows])]
    marker = [*_OUTLINES, MarkerShape.Plus][place % (len(_OUTLINES) + 1)]
    look = rr.SeriesPoints(names=[run.label], colors=[colour], markers=[marker], marker_sizes=[5.0])
    recording.log(entity, look, static=True)
    if len(rows):
        recording.send_columns(entity, time_index(run.table["t_s"][rows]), [scalars(values[rows], 1)])


def _visible(values: Array, limits: tuple[float, float]) -> Array:
    """Return values within limits, so far from these that a mark is drawn completely."""
    low, high = limits
    edge = EDGE * (high - low)
    return np.clip(values, low + edge, high - edge)


def _send_end(
    recording: rr.RecordingStream, entity: str, run: ComparedRun, values: Array, colour: theme.Colour
) -> None:
    """Send a cross at the last value of a run that is not complete, within the limits of the plot."""
    finite = np.flatnonzero(np.isfinite(values))[-1:]
    if len(finite):
        look = rr.SeriesPoints(names=[run.legend], colors=[colour], markers=["Cross"], marker_sizes=[6.0])
        recording.log(entity, look, static=True)
        recording.send_columns(entity, time_index(run.table["t_s"][finite]), [scalars(values[finite], 1)])
