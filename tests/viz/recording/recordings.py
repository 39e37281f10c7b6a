"""Runs that are recorded, and what is read of them."""

import numpy as np
import pyarrow as pa
from rerun.chunk import RrdReader

from spheretwin import scenario as scenarios
from spheretwin.provenance import facts_of
from spheretwin.session import Session
from spheretwin.simulation import simulate
from spheretwin.viz.layout.view import TIMELINE
from spheretwin.viz.recording.recorder import Recorder


def recorded(path, name="nutation", **changes):
    scenario = scenarios.load(name, {"duration": 2.3, **changes})
    session = Session(scenario)
    facts = facts_of(session.scenario)
    with Recorder(session.actuator, session.signals, facts, path=path) as recorder:
        return session, simulate(scenario, sinks=[recorder])


def rows_of(path, entity, component, field=None):
    """Times in ns and values of one component, or of one field of it, in order."""
    times, values = [], []
    chunks = (
        RrdReader(path).stream().filter(content=f"/{entity}", components=component, has_timeline=TIMELINE)
    )
    for chunk in chunks:
        batch = chunk.to_record_batch()
        column = batch.column(component)
        if field:
            column = column.flatten().field(field)
        while pa.types.is_nested(column.type):
            column = column.flatten()
        times.append(np.asarray(batch.column(TIMELINE).cast(pa.int64())))
        values.append(np.asarray(column).reshape(len(batch), -1))
    times, values = np.concatenate(times), np.concatenate(values)
    order = np.argsort(times, kind="stable")
    return times[order], values[order]


def hold_facts(**changes):
    session = Session(scenarios.load("hold", {"duration": 0.1, **changes}))
    return session, facts_of(session.scenario)
