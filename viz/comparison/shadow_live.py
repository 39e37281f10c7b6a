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
from spheretwin.viz.comparison.ghosts import Line, send_lines
from spheretwin.viz.comparison.shadow_recording import (
    TEXT,
    layout,
    parts_of_shadow,
    titles_of,
    with_currents,
)
from spheretwin.viz.layout.layout import blueprint
from spheretwin.viz.layout.plots import following_axis
from spheretwin.viz.layout.styles import MIDDLE, THIN
from spheretwin.viz.layout.view import LIVE_WINDOW_S, application_of
from spheretwin.viz.recording.live import LiveStream
from spheretwin.viz.recording.part import RecordingSubject, drawable, log_markdown, time_index

Array = NDArray[np.float64]

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
