"""Signals whose values are states, as lanes of a timeline: one for each part that ever changes its state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import palette
from spheretwin.viz.layout.paths import STATES
from spheretwin.viz.recording.columns import time_index
from spheretwin.viz.recording.parts.part import Part, Subject


class Lane(NamedTuple):
    """Changes of one part's state."""

    entity: str
    t_s: NDArray[np.float64]
    states: list[str]
    possible: tuple[str, ...]


class StateChanges:
    """Finds changes of states in a run's telemetry, chunk by chunk; before the first row all are 0."""

    def __init__(self) -> None:
        self._last: dict[str, NDArray[np.float64]] = {}

    def of(self, rows: Table) -> list[Lane]:
        """Lanes that have changes in one chunk."""
        return [lane for signal in rows.signals if signal.states for lane in self._lanes(rows, signal)]

    def _lanes(self, rows: Table, signal: Signal) -> list[Lane]:
        values = rows[signal.name].reshape(len(rows), -1)
        last = self._last.get(signal.name, np.zeros(signal.size))
        changed = values != np.concatenate([last[None], values[:-1]])
        self._last[signal.name] = values[-1].copy()
        return [
            Lane(
                _entity(signal, int(place)),
                rows["t_s"][changed[:, place]],
                [signal.states[int(value)] for value in values[changed[:, place], place]],
                signal.states,
            )
            for place in np.flatnonzero(changed.any(axis=0))
        ]


def _entity(signal: Signal, place: int) -> str:
    names = [STATES, signal.name, *signal.labels[place : place + 1]]
    return "/".join(rr.escape_entity_path_part(name.replace(" ", "-")) for name in names)


class States(Part):
    """Lanes of a timeline."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._changes = StateChanges()
        self._styled: set[str] = set()

    def write(self, recording: rr.RecordingStream, rows: Table) -> None:
        """Record the changes of a chunk."""
        for entity, t_s, states, possible in self._changes.of(rows):
            if entity not in self._styled:
                self._styled.add(entity)
                fine, *others = possible
                colours = [palette.FINE, *[palette.FAILURE] * len(others)]
                style = rr.StateConfiguration(values=[fine, *others], colors=colours)
                recording.log(entity, style, static=True)
            recording.send_columns(entity, time_index(t_s), rr.StateChange.columns(state=states))
