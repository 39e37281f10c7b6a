"""Several runs as one recording: all in one actuator, and each quantity of all in one plot."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.components import MarkerShape

from spheretwin.models.base.files import whole_file
from spheretwin.viz import theme
from spheretwin.viz.comparison.ghosts import ROTOR, Array, Ghost, Line, Tip, below, send_lines, write_part
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
from spheretwin.viz.layout.layout import blueprint, eye
from spheretwin.viz.layout.plots import time_axis, time_range
from spheretwin.viz.layout.styles import MIDDLE, THICK, THIN
from spheretwin.viz.layout.view import EVENTS, SCENARIO, application_of
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
from spheretwin.viz.recording.recorder import PIPE_PATHS, FilePipe
from spheretwin.viz.recording.scene3d import MovingActuator
from spheretwin.viz.recording.signals import Signals
from spheretwin.viz.recording.status import StateChanges, StateLanes, log_lines
from spheretwin.viz.scene.entities import TRAIL_S, size_of
from spheretwin.viz.scene.meshes import WORLD

COMPARE, MARKS, END, TIP, DIFFERENCE = "compare", "marks", "end", "tip", "difference"
"""Parts of the paths of entities, after the name of a run."""

RUNS, LEGEND = "runs", "legend"
"""Entities of all runs: their description, and their colours with labels."""

REFERENCE = "setpoint"
"""Before the name of a run: a viewer draws lines in the order of their paths, these above all others."""

LARGE, BESIDE_TEXTS = "whole", "more"
"""Groups of the error as one angle, and of plots in tabs with the texts."""

ERRORS = "error"
"""Group of the errors of the hinges, with their differences to those of the first run."""

SWITCHED = (LARGE, ERRORS)
"""Groups with tabs, which are higher: one for the settled runs, others for all values and for differences."""


Limits = tuple[float, float]


class Plot(NamedTuple):
    """Plot of one quantity of all runs."""

    name: str
    heading: str
    group: str
    desired: bool
    """True if the reference is drawn with it."""
    limits: Limits
    whole: Limits
    """Limits that contain all values."""

    @property
    def title(self) -> str:
        """Heading, and that values are outside of the limits."""
        return self.heading if self.whole == self.limits else f"{self.heading}, cut"


class ComparisonView(NamedTuple):
    """Properties of the runs on which the layout depends."""

    runs: tuple[str, ...]
    """Names."""
    leaders: tuple[str, ...]
    """Names of the runs that show the reference."""
    plots: tuple[Plot, ...]
    differences: tuple[Plot, ...]
    """Plots of the errors minus those of the first run."""
    duration_s: float
    states: tuple[str, ...]
    """Names of the runs with changes of state."""
    logs: tuple[str, ...]
    """Names of the runs with events."""
    failed: tuple[str, ...]
    """Names of the runs that are not complete."""
    size: float
    """Size of the first run's actuator, which is drawn completely."""


def application(view: ComparisonView) -> str:
    """Return the application id of recordings with one layout: a viewer keeps one layout for each."""
    return application_of("spheretwin-runs", repr(view))


def layout(view: ComparisonView) -> rrb.Blueprint:
    """Blueprint of a recording of several runs."""
    groups = dict.fromkeys(plot.group for plot in view.plots if plot.group != BESIDE_TEXTS)
    rows = [_row(view, group) for group in groups]
    texts = rrb.Tabs(
        rrb.TextDocumentView(origin=f"/{RUNS}", name="runs"),
        rrb.TextLogView(origin="/", contents=[f"/{run}/{EVENTS}" for run in view.logs], name="events"),
        *([_states(view)] if view.states else []),
        *(_plot(view, plot, plot.limits) for plot in _plots(view, BESIDE_TEXTS)),
    )
    return blueprint(
        rrb.Horizontal(
            rrb.Vertical(_bodies(view), _legend(view), texts, row_shares=[5, 0.5 + 0.6 * len(view.runs), 3]),
            rrb.Vertical(*rows, row_shares=[4 if group in SWITCHED else 3 for group in groups]),
            column_shares=[2, 3],
            name="compare",
        )
    )


def _row(view: ComparisonView, group: str) -> rrb.Container:
    """Return the plots of a group; in tabs with errors that are cut all values, and differences."""
    plots = _plots(view, group)
    tabs = [rrb.Horizontal(*(_plot(view, plot, plot.limits) for plot in plots), name="settled")]
    if group in SWITCHED and any(plot.whole != plot.limits for plot in plots):
        tabs.append(rrb.Horizontal(*(_plot(view, plot, plot.whole) for plot in plots), name="all values"))
    if group == ERRORS and view.differences:
        tabs.append(rrb.Horizontal(*map(partial(_difference, view), view.differences), name="minus run 1"))
    return rrb.Tabs(*tabs, active_tab=0) if len(tabs) > 1 else tabs[0]


def _plots(view: ComparisonView, group: str) -> list[Plot]:
    return [plot for plot in view.plots if plot.group == group]


def _plot(view: ComparisonView, plot: Plot, limits: Limits) -> rrb.TimeSeriesView:
    contents = [
        *(f"/{REFERENCE}/{run}/{plot.name}" for run in view.leaders if plot.desired),
        *(f"/{run}/{COMPARE}/{plot.name}" for run in view.runs),
        *(f"/{run}/{MARKS}/{plot.name}" for run in view.runs),
        *(f"/{run}/{END}/{plot.name}" for run in view.failed if limits == plot.limits),
    ]
    return _time_plot(view, plot.title if limits == plot.limits else plot.heading, contents, limits)


def _difference(view: ComparisonView, plot: Plot) -> rrb.TimeSeriesView:
    contents = [f"/{run}/{DIFFERENCE}/{plot.name}" for run in view.runs[1:]]
    return _time_plot(view, plot.title, contents, plot.limits)


def _time_plot(
    view: ComparisonView, title: str, contents: Sequence[str], limits: Limits
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin="/",
        contents=contents,
        name=title,
        axis_x=time_axis(view.duration_s),
        axis_y=rrb.ScalarAxis(range=limits),
        plot_legend=rrb.PlotLegend(visible=False),
        interaction=rrb.PlotInteraction(tooltip_mode="All"),
    )


def _bodies(view: ComparisonView) -> rrb.Spatial3DView:
    first, *ghosts = view.runs
    tips = [f"/{run}/{TIP}" for run in view.runs] + [f"/{REFERENCE}/{run}/{TIP}" for run in view.leaders]
    bodies = [f"/{first}/{WORLD}/**", *(f"/{run}/{ROTOR}/**" for run in ghosts)]
    return rrb.Spatial3DView(
        origin="/",
        contents=[*bodies, *(f"{tip}/**" for tip in tips)],
        name="run 1; the others as ghosts",
        line_grid=False,
        eye_controls=eye(view.size),
        overrides={f"{tip}/path": time_range(TRAIL_S) for tip in tips},
    )


def _legend(view: ComparisonView) -> rrb.Spatial2DView:
    """View of the colours and labels of the runs: a legend within a plot would cover lines."""
    bounds = rrb.VisualBounds2D(x_range=[-0.1, 1.1], y_range=[-0.5, len(view.runs) - 0.1])
    return rrb.Spatial2DView(origin=f"/{LEGEND}", name="runs", visual_bounds=bounds)


def _states(view: ComparisonView) -> rrb.StateTimelineView:
    contents = [f"/{run}/**" for run in view.states]
    return rrb.StateTimelineView(
        origin="/", contents=contents, name="states", time_view=time_axis(view.duration_s)
    )


@contextmanager
def recorded(path: Path, application: str, layout: rrb.Blueprint) -> Iterator[rr.RecordingStream]:
    """Give a stream whose recording takes the name `path` when the block ends well.

    Parameters
    ----------
    path : Path
    application : str
        Application id: a viewer keeps one layout for each.
    layout : Blueprint

    Raises
    ------
    InputError
        No file can be made there.
    SpheretwinError
        Writing failed; the previous file is unchanged.
    """
    rr.set_strict_mode(True)  # otherwise a mistake is a warning, and its data are dropped
    with whole_file(path, ".rrd") as temporary:
        pipe = FilePipe(temporary) if PIPE_PATHS.is_dir() else None
        stream = rr.RecordingStream(application)
        try:
            stream.set_log_time_enabled(False)  # simulated time is the only one that means anything
            stream.set_sinks(rr.FileSink(pipe.path if pipe else temporary), default_blueprint=layout)
            yield stream
            stream.flush()
        finally:
            stream.disconnect()
            if pipe:
                pipe.close()
        if pipe and pipe.error:
            raise pipe.error


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


def _plot_of(quantity: Quantity, of_quantity: PlotRange, of_runs: Sequence[Array]) -> Plot:
    """Return the plot of a quantity, with limits of all values if some are outside of its range."""
    low, high, outside = of_quantity
    limits = quantity.limits or labelled(low, high, quantity.floor, STEPS)
    heading, desired = _heading(quantity), quantity.desired is not None
    whole = labelled(*value_bounds(of_runs), quantity.floor, STEPS) if outside else limits
    return Plot(quantity.name, heading, quantity.group, desired, limits, whole)


SYMBOLS = {"torque_command_norm_Nm": "τ", "largest_current_A": "i", "torque_margin": "margin"}
"""Names of quantities above plots of a small window; those of a hinge have the name of the hinge."""


def _heading(quantity: Quantity) -> str:
    """Return symbol and unit of a quantity that stands next to two others, else its title."""
    if quantity.group in (LARGE, BESIDE_TEXTS):
        return quantity.heading
    return f"{SYMBOLS.get(quantity.name, quantity.title.split()[0])} {quantity.unit}".removesuffix(" 1")


class Difference(NamedTuple):
    """Errors of a run minus those of the first one at the ticks of both."""

    t_s: Array
    values: Array


def _difference_plots(
    errors: Sequence[Quantity], differences: Sequence[Sequence[Difference]], runs: Sequence[ComparedRun]
) -> tuple[Plot, ...]:
    """Return the plots of the differences, with one range."""
    together = [np.concatenate([of.values for of in parts]) for parts in zip(*differences, strict=True)]
    limits = labelled(*settled_bounds(runs[1:], together, ERROR.floor), ERROR.floor, STEPS)
    return tuple(Plot(of.name, _heading(of), ERRORS, False, limits, limits) for of in errors)


def _differences(quantity: Quantity, runs: Sequence[ComparedRun]) -> list[Difference]:
    """Return the differences of every run but the first."""
    first, *others = runs
    differences = []
    for run in others:
        rows, of_first = common_rows(run.table, first.table)
        values = quantity.column(run.rows)[rows] - quantity.column(first.rows)[of_first]
        differences.append(Difference(run.table["t_s"][rows], values))
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
    recording.log(
        LEGEND, rr.LineStrips2D(ends, colors=shade, radii=radii, labels=labels, show_labels=True), static=True
    )
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
