"""Live view of a shadow: the content of its recording as it grows, and a lane of a watch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.status import Level
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme
from spheretwin.viz.comparison.shadow_recording import (
    BANDS,
    TEXT,
    Line,
    ShadowContent,
    layout,
    plots_of,
    send_lines,
    settled_rows,
    titles_of,
)
from spheretwin.viz.decimation import FirstRows
from spheretwin.viz.layout.layout import blueprint
from spheretwin.viz.layout.plots import following_axis
from spheretwin.viz.layout.styles import MIDDLE, THIN
from spheretwin.viz.layout.view import LIVE_WINDOW_S, application_of
from spheretwin.viz.recording.live import TOGETHER_S, LivePage
from spheretwin.viz.recording.part import RecordingSubject, drawable, time_index
from spheretwin.viz.scene.entities import FRAME_RATE_Hz

Array = NDArray[np.float64]

WINDOWS, ALARMS = "watch/windows", "watch/alarms"


class ShadowView:
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
        rr.set_strict_mode(True)  # otherwise a mistake is a warning, and its data are dropped
        subject, titles = replace(subject, live=True), titles_of(signals)
        _ = subject.meshes  # a missing one is reported before there is a page
        key = repr((subject.view, *titles, watched))
        self._recording = rr.RecordingStream(application_of("spheretwin-shadow-live", key))
        self._recording.set_log_time_enabled(False)
        self._page = LivePage(self._recording)
        self._frames = FirstRows(FRAME_RATE_Hz)
        self._tables: list[Table] = []
        self._currents: list[Array] = []
        self._text = ""
        axis = following_axis(LIVE_WINDOW_S)
        below = _lane(axis) if watched else rrb.TextDocumentView(origin=f"/{TEXT}", name="verdict")
        self._recording.send_blueprint(blueprint(layout(subject, titles, axis, below), live=True))
        self._content = ShadowContent(self._recording, subject)
        self._page.send()

    @property
    def address(self) -> str:
        """Page to open in a browser."""
        return self._page.address

    def write(self, telemetry: Table, current_A: Array, text: str = "") -> None:
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
        self._tables.append(telemetry)
        self._currents.append(current_A)
        self._text = text
        if telemetry["t_s"][-1] - self._tables[0]["t_s"][0] >= TOGETHER_S:
            self.flush()

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
            send_lines(self._recording, WINDOWS, t_s, lines)
        if alarms:
            times, texts = zip(*alarms, strict=True)
            columns = rr.TextLog.columns(
                text=[drawable(text) for text in texts], level=[Level.WARN] * len(texts)
            )
            self._recording.send_columns(ALARMS, time_index(np.array(times)), columns)

    def close(self) -> None:
        """Stop the server."""
        self._page.close()

    def flush(self) -> None:
        """Show the rows that wait."""
        if not self._tables:
            return
        rows = Table(self._tables[0].signals, np.vstack([table.values for table in self._tables]))
        current_A = np.vstack(self._currents)
        self._tables, self._currents = [], []
        for name in BANDS:
            if name in (signal.name for signal in rows.signals):
                rows[name][~settled_rows(rows, name)] = np.nan
        places = self._frames.first_places(rows["t_s"])
        if len(places):
            shown = Table(rows.signals, rows.values[places])
            self._content.write(shown, current_A[places], plots_of(shown))
        if self._text:
            document = rr.TextDocument(drawable(self._text), media_type=rr.MediaType.MARKDOWN)
            self._recording.log(TEXT, document, static=True)
        self._page.send()


def _lane(axis: rrb.TimeAxis) -> rrb.Container:
    """Return the views of a watch: its windows, and its alarms as text."""
    windows = rrb.TimeSeriesView(origin=f"/{WINDOWS}", name="watch, by window; alarms from 1", axis_x=axis)
    columns = rrb.TextLogColumns(text_log_columns=["loglevel", "body"])
    alarms = rrb.TextLogView(origin=f"/{ALARMS}", name="alarms", columns=columns)
    return rrb.Vertical(windows, alarms)
