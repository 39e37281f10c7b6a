"""Derived quantities, and at the end of a run the layout with the ranges and titles that are due to it."""

from __future__ import annotations

from time import monotonic

import numpy as np
import rerun as rr

from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.layout import layout, opening_layout
from spheretwin.viz.layout.paths import SUMMARY, derived
from spheretwin.viz.layout.styles import quantity_style
from spheretwin.viz.quantities.error_angle import ERROR_ANGLE
from spheretwin.viz.quantities.quantity import Kept, Rows
from spheretwin.viz.quantities.registry import quantities_of
from spheretwin.viz.recording.columns import scalars, time_index
from spheretwin.viz.recording.parts.drawn.bins import Binned, Bins
from spheretwin.viz.recording.parts.drawn.ended import log_end
from spheretwin.viz.recording.parts.drawn.summary import Summary
from spheretwin.viz.recording.parts.drawn.survey import Picked, Survey, watched
from spheretwin.viz.recording.parts.part import Part, Subject

# A bin leaves one row or two: no more than 50 a second.
RATE_Hz = 25.0

# A file has a layout before the one of its end from then on, in s of the clock: it takes some 100 kB.
OPENED_AFTER_s = 2.0

# After these ends there is nothing that was planned and did not come.
_AS_PLANNED = (Status.COMPLETED, Status.RUNNING)


class Quantities(Part):
    """Of each bin of time what the quantity says of itself that matters."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._quantities = quantities_of({signal.name for signal in subject.signals})
        self._watched = watched(subject.signals)
        self._picked = Picked(self._watched)
        self._survey = Survey(
            {**{quantity.name: quantity.size for quantity in self._quantities}, **self._watched}
        )
        averaged = [each.kept is Kept.MEAN for each in self._quantities for _ in range(each.size)]
        self._averaged = np.array(averaged + [False] * sum(self._watched.values()))
        self._bins = Bins(RATE_Hz, at_once=subject.live)
        self._summary = Summary(subject.facts)
        self._before: Table | None = None
        self._begun_s: float | None = None  # of the clock, when the first rows came: all is compiled then
        self._opened = False

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log how the quantities look, and for whoever watches what is known of the run from its start."""
        for quantity in self._quantities:
            recording.log(derived(quantity.name), quantity_style(quantity), static=True)
        if self.subject.live:
            _log_summary(recording, self._summary.running())

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record what bins the rows of a chunk have completed."""
        self._open(recording)
        facts = self.subject.facts
        given = Rows(rows, self._before or rows.rows(0, 1), self.subject.actuator, facts.current_limit_A)
        with np.errstate(all="ignore"):  # of a run that diverged, the last rows may hold no numbers
            values = {quantity.name: quantity.values(given) for quantity in self._quantities}
        self._before = Table(rows.signals, rows.values[-1:].copy())
        self._summary.add(rows, values[ERROR_ANGLE.name][:, 0])
        columns = np.concatenate([*values.values(), self._picked.of(rows)], axis=1)
        self._record(recording, self._bins.add(rows["t_s"], columns))

    def finish(self, recording: rr.RecordingStream, status: Status) -> None:
        """Record the last bin, and lay the recording out for what the run has shown."""
        self._record(recording, self._bins.rest())
        _log_summary(recording, self._summary.ended(status))
        last_s = self._summary.last_s
        ended_s = None if status in _AS_PLANNED else last_s
        if ended_s is not None:
            log_end(recording, ended_s)
        recording.send_blueprint(layout(self.subject.view, self._survey.seen(ended_s)))

    def _open(self, recording: rr.RecordingStream) -> None:
        """Lay a file out for whoever finds it without its end; most runs end before it could be killed."""
        self._begun_s = self._begun_s or monotonic()
        if self._opened or self.subject.live or monotonic() - self._begun_s < OPENED_AFTER_s:
            return
        self._opened = True
        _log_summary(recording, self._summary.running())
        recording.send_blueprint(opening_layout(self.subject.view))

    def _record(self, recording: rr.RecordingStream, binned: Binned | None) -> None:
        if binned is None:
            return
        low, high = (np.where(self._averaged, binned.mean, bound) for bound in (binned.low, binned.high))
        self._survey.add(binned.t_s, low, high)
        t_s, both = binned.pairs()
        drawn = {
            Kept.BOTH: (time_index(t_s), both),
            Kept.LEAST: (time_index(binned.t_s), binned.low),
            Kept.GREATEST: (time_index(binned.t_s), binned.high),
            Kept.MEAN: (time_index(binned.t_s), binned.mean),
        }
        first = 0
        for quantity in self._quantities:
            index, values = drawn[quantity.kept]
            block = np.ascontiguousarray(values[:, first : first + quantity.size])
            recording.send_columns(derived(quantity.name), index, [scalars(block, quantity.size)])
            first += quantity.size


def _log_summary(recording: rr.RecordingStream, text: str) -> None:
    recording.log(SUMMARY, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
