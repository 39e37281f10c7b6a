"""Shadow of a machine: the machine as measured, its twin as a ghost, and what the twin estimates.

A recording has all rows; a live view grows, and has a lane of a watch.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.models.telemetry.status import Level
from spheretwin.models.telemetry.table import Table, with_currents
from spheretwin.viz import theme
from spheretwin.viz.comparison.ghosts import ROTOR, Ghost, Line, PartBelow, send_lines, write_part
from spheretwin.viz.decimation import FirstRows
from spheretwin.viz.layout.extents import labelled
from spheretwin.viz.layout.layout import blueprint, eye
from spheretwin.viz.layout.plots import following_axis, time_axis
from spheretwin.viz.layout.styles import MIDDLE, THICK, THIN
from spheretwin.viz.layout.view import LIVE_WINDOW_S, application_of
from spheretwin.viz.recording.currents import CoilCurrents
from spheretwin.viz.recording.live import LiveStream
from spheretwin.viz.recording.part import RecordingPart, RecordingSubject, drawable, log_markdown, time_index
from spheretwin.viz.recording.recorder import recorded
from spheretwin.viz.recording.scene3d import MovingActuator
from spheretwin.viz.scene.entities import FRAME_RATE_Hz, size_of
from spheretwin.viz.scene.meshes import WORLD

MACHINE, TWIN, TEXT, PLOTS = "machine", "twin", "verdict", "plots"

CONFIDENCE = 1.96
"""Standard deviations on each side of a 95 % band."""

SHADE = 0.65
"""Share of grey in the colour of a band: the estimate stands out."""

_FARTHEST = 8.0  # innovations beyond it are cut


class ShadowPlot(NamedTuple):
    """Lines of a plot for some rows."""

    name: str
    lines: tuple[Line, ...]
    limits: tuple[float, float]


ANGLE, INNOVATION = "angle", "innovation"

BANDS = {
    "qdot_estimated_rad_s": ("hinge rates with 95 % band [rad/s]", 1.0),
    "disturbance_estimated_Nm": ("disturbance torque with 95 % band [mN·m]", 1e3),
    "offset_estimated_rad": ("offsets of the sensors with 95 % band [mrad]", 1e3),
}
"""Title and scale of the plots of an estimate, by its signal."""

TITLES = {
    ANGLE: "hinge angles [rad]: α red, β green, γ violet; estimated above measured (grey)",
    INNOVATION: "measured minus predicted angle over its expected deviation [1]; 95 % within the grey lines",
    **{name: title for name, (title, _) in BANDS.items()},
}
"""Titles of the plots by their names."""


def titles_of(signals: Sequence[Signal]) -> dict[str, str]:
    """Return the titles of the plots of a shadow with some signals."""
    own = {ANGLE, INNOVATION, *_bands(signals)}
    return {name: title for name, title in TITLES.items() if name in own}


class ShadowPlots(RecordingPart):
    """Lines of the plots; of a live view the rows of every frame, without bands that are wide at first."""

    def __init__(self, subject: RecordingSubject) -> None:
        super().__init__(subject)
        self._frames = FirstRows(FRAME_RATE_Hz)

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the rows of a chunk."""
        if self.subject.live:
            places = self._frames.first_places(rows["t_s"])
            shown = Table(rows.signals, rows.values[places])
            for name in _bands(rows.signals):
                shown[name][~settled_rows(rows, name)[places]] = np.nan
            rows = shown
        for plot in plots_of(rows) if len(rows) else ():
            send_lines(recording, f"{PLOTS}/{plot.name}", rows["t_s"], *plot.lines)


def parts_of_shadow(subject: RecordingSubject) -> list[RecordingPart]:
    """Return the parts of the recording of a shadow: bodies, currents and plots."""
    return [
        PartBelow(MACHINE, MovingActuator(subject, "q_measured_rad")),
        PartBelow(MACHINE, CoilCurrents(subject)),
        PartBelow(TWIN, Ghost(subject, theme.ESTIMATE, "q_estimated_rad")),
        ShadowPlots(subject),
    ]


def write(path: Path, telemetry: Table, current_A: Array, subject: RecordingSubject, text: str) -> None:
    """Write the recording of a shadow.

    Parameters
    ----------
    path : Path
    telemetry : Table
        Of `machine.shadow`, at least one row.
    current_A : (n, groups) array, A
        Currents of the log; NaN is drawn as 0.
    subject : RecordingSubject
        Actuator and facts; its signals are not used.
    text : str
        Verdict, in Markdown.

    Raises
    ------
    InputError
        No file can be made there, or a mesh of the model cannot be read.
    SpheretwinError
        Writing failed; the previous file is unchanged.
    """
    _ = subject.meshes  # a missing one is reported before there is a file
    plots = plots_of(telemetry)
    application = application_of("spheretwin-shadow", repr([plot._replace(lines=()) for plot in plots]))
    limits = {plot.name: plot.limits for plot in plots}
    axis, titles = time_axis(float(telemetry["t_s"][-1])), titles_of(telemetry.signals)
    text_view = rrb.TextDocumentView(origin=f"/{TEXT}", name="verdict")
    views = layout(subject, titles, axis, text_view, limits)
    with recorded(path, application, blueprint(views)) as recording:
        recording.send_recording_name("shadow")
        log_markdown(recording, TEXT, text)
        table = with_currents(telemetry, current_A)
        for part in parts_of_shadow(subject):
            write_part(recording, table, part)


def _bands(signals: Sequence[Signal]) -> list[str]:
    """Return the signals with a band, among some."""
    names = {signal.name for signal in signals}
    return [name for name in BANDS if name in names]


def plots_of(telemetry: Table) -> list[ShadowPlot]:
    """Return the plots of some rows: a quantity of all hinges in each."""
    measured, estimated = telemetry["q_measured_rad"], telemetry["q_estimated_rad"]
    before = [Line(f"{ANGLES[i]} measured", measured[:, i], theme.COMMAND, THICK) for i in range(3)]
    above = [Line(f"{ANGLES[i]} estimated", estimated[:, i], theme.AXIS_COLOURS[i], THIN) for i in range(3)]
    normalised = telemetry["innovation_normalised"]
    limit = np.full(len(telemetry), CONFIDENCE)
    farthest = float(np.clip(1.1 * np.nanmax(np.abs(normalised), initial=CONFIDENCE), 0.0, _FARTHEST))
    innovations = [Line(ANGLES[i], normalised[:, i], theme.AXIS_COLOURS[i], THIN) for i in range(3)]
    limits = [
        Line("upper limit", limit, theme.COMMAND, MIDDLE),
        Line("lower limit", -limit, theme.COMMAND, MIDDLE),
    ]
    plots = [
        ShadowPlot(ANGLE, (*before, *above), _range(measured)),
        ShadowPlot(INNOVATION, (*innovations, *limits), (-farthest, farthest)),
    ]
    for name in _bands(telemetry.signals):
        lines = tuple(_band(telemetry, name, BANDS[name][1]))
        settled = settled_rows(telemetry, name)
        plots.append(ShadowPlot(name, lines, _range(np.stack([line.values[settled] for line in lines]))))
    return plots


def settled_rows(telemetry: Table, name: str) -> NDArray[np.bool_]:
    """Return True for rows whose band is not much wider than usual.

    Before the first rows the filter knows nothing: its band would hide all that follows.
    """
    deviation = telemetry[f"{name}_std"]
    return np.all(deviation <= 3 * np.median(deviation, axis=0), axis=1)


def _range(values: Array) -> tuple[float, float]:
    """Return limits of a plot of some values."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    return labelled(low, high, 1e-6)


def _band(telemetry: Table, name: str, scale: float) -> Iterator[Line]:
    """Yield the shades of the bands of all hinges, then the estimates above them.

    A shade is a line that goes from one limit to the other in each row: a viewer fills no areas.
    """
    mean, half = scale * telemetry[name], scale * CONFIDENCE * telemetry[f"{name}_std"]
    half[1::2] *= -1
    for i, colour in enumerate(theme.AXIS_COLOURS):
        shade = theme.mixed(colour, theme.COMMAND, SHADE)
        yield Line(f"{ANGLES[i]} ± 95 %", (mean + half)[:, i], shade, THIN)
    for i, colour in enumerate(theme.AXIS_COLOURS):
        yield Line(ANGLES[i], mean[:, i], colour, THICK)


def layout(
    subject: RecordingSubject,
    titles: Mapping[str, str],
    axis: rrb.TimeAxis,
    below: rrb.View | rrb.Container,
    limits: Mapping[str, tuple[float, float]] | None = None,
) -> rrb.Container:
    """Return the views of a shadow: the scene with another view below it, and the plots.

    Parameters
    ----------
    subject : RecordingSubject
    titles : mapping
        Title of each plot by its name.
    axis : TimeAxis
    below : View or Container
    limits : mapping, optional
        Range of each plot; that of its visible values unless given.
    """
    scene = rrb.Spatial3DView(
        origin="/",
        contents=[f"/{MACHINE}/{WORLD}/**", f"/{TWIN}/{ROTOR}/**"],
        name="machine as measured; the twin's estimate as a ghost",
        line_grid=False,
        eye_controls=eye(size_of(subject.actuator)),
    )
    plots = [
        rrb.TimeSeriesView(
            origin=f"/{PLOTS}/{name}",
            name=title,
            axis_x=axis,
            axis_y=rrb.ScalarAxis(range=limits[name]) if limits else None,
            plot_legend=rrb.PlotLegend(visible=False),  # it would cover the lines; the title has the colours
        )
        for name, title in titles.items()
    ]
    return rrb.Horizontal(
        rrb.Vertical(scene, below, row_shares=[3, 2]),
        rrb.Vertical(*plots),
        column_shares=[2, 3],
        name="shadow",
    )


WINDOWS, ALARMS = "watch/windows", "watch/alarms"


class ShadowView(LiveStream):
    """Live view of a shadow, with 60 rows a second, for any number of viewers.

    Parameters
    ----------
    subject : RecordingSubject
        Actuator and facts; its signals are not used.
    signals : sequence of Signal
        Columns of the telemetry.
    watched : bool
        True for a lane of a watch, False for the verdict on the rows so far.

    Raises
    ------
    InputError
        A mesh of the model cannot be read.
    SpheretwinError
        Rerun's viewer is not there.
    """

    def __init__(
        self, subject: RecordingSubject, signals: Sequence[Signal], *, watched: bool = False
    ) -> None:
        subject, titles = replace(subject, live=True), titles_of(signals)
        axis = following_axis(LIVE_WINDOW_S)
        below = _lane(axis) if watched else rrb.TextDocumentView(origin=f"/{TEXT}", name="verdict")
        self._text = ""
        super().__init__(
            subject,
            parts_of_shadow(subject),
            application_of("spheretwin-shadow-live", repr((subject.view, *titles, watched))),
            blueprint(layout(subject, titles, axis, below), live=True),
        )

    def show(self, telemetry: Table, current_A: Array, text: str = "") -> None:
        """Show the next rows, together with others of one second.

        Parameters
        ----------
        telemetry : Table
            Of the shadow.
        current_A : (n, groups) array, A
            Currents of the log.
        text : str
            Verdict on all rows so far, in Markdown.
        """
        self._text = text
        self.write(with_currents(telemetry, current_A))

    def send(self) -> None:
        """Send viewers the data and the verdict."""
        if self._text:
            log_markdown(self.recording, TEXT, self._text)
        super().send()

    def judge(
        self, windows: Sequence[tuple[float, float, float]], alarms: Sequence[tuple[float, str]]
    ) -> None:
        """Show windows of a watch with the next rows, and its alarms.

        Parameters
        ----------
        windows : sequence of tuple
            End in s, mean square of the residuals over that of the noise, largest sum over its threshold.
        alarms : sequence of tuple
            Time in s and text.
        """
        if windows:
            t_s, chi2, evidence = (np.array(column) for column in zip(*windows, strict=True))
            lines = [
                Line("mean square of the residuals over that of the noise", chi2, theme.ESTIMATE, MIDDLE),
                Line("largest sum over its threshold", evidence, theme.WARNING, MIDDLE),
                Line("alarm", np.ones(len(t_s)), theme.FAILURE, THIN),
            ]
            send_lines(self.recording, WINDOWS, t_s, *lines)
        if alarms:
            times, texts = zip(*alarms, strict=True)
            columns = rr.TextLog.columns(
                text=[drawable(text) for text in texts], level=[Level.WARN] * len(texts)
            )
            self.recording.send_columns(ALARMS, time_index(np.array(times)), columns)


def _lane(axis: rrb.TimeAxis) -> rrb.Container:
    """Return the views of a watch: its windows, and its alarms as text."""
    windows = rrb.TimeSeriesView(origin=f"/{WINDOWS}", name="watch, by window; alarms from 1", axis_x=axis)
    columns = rrb.TextLogColumns(text_log_columns=["loglevel", "body"])
    alarms = rrb.TextLogView(origin=f"/{ALARMS}", name="alarms", columns=columns)
    return rrb.Vertical(windows, alarms)
