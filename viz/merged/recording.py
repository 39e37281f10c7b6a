"""Several runs as one recording."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import cast

import numpy as np
import rerun as rr

from spheretwin.models.telemetry.table import Table
from spheretwin.viz import palette
from spheretwin.viz.compared.colours import on_dark, run_colours
from spheretwin.viz.compared.desired import leaders
from spheretwin.viz.compared.quantities import Quantity, drawn
from spheretwin.viz.compared.run import Run
from spheretwin.viz.layout.paths import SCENARIO
from spheretwin.viz.layout.seen import labelled
from spheretwin.viz.layout.styles import MIDDLE, THICK, THIN
from spheretwin.viz.merged.bodies import Tip, body
from spheretwin.viz.merged.layout import ASKED, COMPARE, RUNS, TIP, Plot, View, application, layout
from spheretwin.viz.merged.series import send_line
from spheretwin.viz.merged.stream import Below, recorded
from spheretwin.viz.recording.parts.log import log_lines
from spheretwin.viz.recording.parts.part import Part, Subject
from spheretwin.viz.recording.parts.signals import Signals
from spheretwin.viz.recording.parts.states import StateChanges, States
from spheretwin.viz.recording.recorder import MOST_ROWS
from spheretwin.viz.scene.marks import size_of
from spheretwin.viz.scene.meshes import read_meshes

# Of a range of what hardly differs from zero; and steps for which the lowest of the plots is high enough.
LEAST, STEPS = 1e-3, 6


def write(path: Path, runs: Sequence[Run], subjects: Sequence[Subject], text: str) -> Path:
    """Write a recording of several runs; returns its path.

    Below the name of each stands what its own recording holds, and what is drawn beside the others'.

    Parameters
    ----------
    path : Path
    runs : sequence of Run
        Two at least, of names that tell them apart.
    subjects : sequence of Subject
        Of each run.
    text : str
        What the runs are, in Markdown.

    Raises
    ------
    InputError
        No file can be made there, or a mesh of a model cannot be read.
    SpheretwinError
        Writing failed; what was there before is untouched.
    """
    for subject in subjects:
        read_meshes(subject.facts.mjcf)  # found missing before there is a file
    tables = [run.table for run in runs]
    quantities, leading = drawn(tables), leaders(tables)
    view = View(
        tuple(run.name for run in runs),
        tuple(runs[place].name for place in leading),
        tuple(
            Plot(each.name, each.heading, each.group, each.desired is not None, _limits(each, runs))
            for each in quantities
        ),
        max(float(table["t_s"][-1]) for table in tables),
        tuple(run.name for run in runs if StateChanges().of(run.table)),
        tuple(run.name for run in runs if run.events),
        size_of(subjects[0].actuator),
    )
    colours = [on_dark(colour) for colour in run_colours([run.law for run in runs])]
    with recorded(path, application(view), layout(view)) as recording:
        recording.send_recording_name(f"{len(runs)} runs")
        recording.log(RUNS, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
        for place, (run, subject, colour) in enumerate(zip(runs, subjects, colours, strict=True)):
            below = cast(rr.RecordingStream, Below(recording, run.name))
            parts = [
                Signals(subject),
                body(subject, colour, ghost=place > 0),
                Tip(subject, TIP, "q_rad", f"{place + 1}", colour),
                States(subject),
            ]
            _write_run(below, run, parts)
            for each in quantities:
                entity, t_s, values = f"{COMPARE}/{each.name}", run.table["t_s"], each.of(run.rows)
                width = THICK if each.desired else MIDDLE  # what was asked for lies over it
                send_line(below, entity, run.label, t_s, values, colour, width)
        for place in leading:
            run, asked = runs[place], Below(recording, f"{ASKED}/{runs[place].name}")
            _write_asked(
                cast(rr.RecordingStream, asked), run, subjects[place], quantities, alone=len(leading) == 1
            )
    return path


def _write_run(recording: rr.RecordingStream, run: Run, parts: Sequence[Part]) -> None:
    """What a recording of the run alone has, but for the text of its scenario."""
    recording.log(SCENARIO, rr.AnyValues(record=json.dumps(dict(run.record))), static=True)
    log_lines(recording, list(run.events))
    for part in parts:
        _write_part(recording, run, part)


def _write_asked(
    recording: rr.RecordingStream,
    run: Run,
    subject: Subject,
    quantities: Sequence[Quantity],
    *,
    alone: bool,
) -> None:
    """What was asked for: lines, and the path of the tip."""
    colour, label = palette.DESIRED_TRACE, "asked for" if alone else f"asked for in {run.label}"
    _write_part(recording, run, Tip(subject, TIP, "q_ref_rad", "", colour))
    for each in quantities:
        if each.desired:
            send_line(
                recording, each.name, label, run.table["t_s"], each.desired(run.rows), palette.ASKED, THIN
            )


def _limits(quantity: Quantity, runs: Sequence[Run]) -> tuple[float, float]:
    """Range of all values of all runs, in which numbers can be read."""
    if quantity.limits:
        return quantity.limits
    values = np.concatenate([quantity.of(run.rows) for run in runs])
    told = values[np.isfinite(values)]
    return labelled(float(np.min(told, initial=0.0)), float(np.max(told, initial=0.0)), LEAST, STEPS)


def _write_part(recording: rr.RecordingStream, run: Run, part: Part) -> None:
    part.begin(recording)
    for rows in _chunks(run.table):
        part.write(recording, rows)


def _chunks(table: Table) -> Iterator[Table]:
    """Rows as many as one chunk of a recording has."""
    for first in range(0, len(table), MOST_ROWS):
        yield table.rows(first, first + MOST_ROWS)
