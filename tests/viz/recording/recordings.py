"""Runs that are recorded, and what is read of them."""

import pyarrow as pa

from spheretwin import scenario as scenarios
from spheretwin.records.provenance import facts_of
from spheretwin.session import Session
from spheretwin.simulation import follow
from spheretwin.viz.layout.view import TELEMETRY, TIMELINE
from spheretwin.viz.recording.recorder import Recorder
from tests.viz.recording.panels import columns, reader, series


def session_and_facts(name="hold", **changes):
    """A session of a tenth of a second, and its facts."""
    session = Session(scenarios.load(name, {"duration": 0.1, "plant.engine": "lagrangian", **changes}))
    return session, facts_of(session.initial_scenario)


def opened(path, name="hold", rate_Hz=None, shown="overview", **changes):
    """A session of a tenth of a second, and its recorder."""
    session, facts = session_and_facts(name, **changes)
    recorder = Recorder(session.actuator, session.signals, facts, path=path, rate_Hz=rate_Hz, shown=shown)
    return session, recorder


def recorded(path, name="hold", **changes):
    """Status of a run that was recorded."""
    session, recorder = opened(path, name, **changes)
    with session, recorder:
        return follow(session, session.initial_scenario.ticks, [recorder])


def batches(path, entity, component, **of):
    """Batches of an entity that have a component."""
    for chunk in reader(path).stream().filter(content=f"/{entity}", **of):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            yield batch


def static(path, entity, component):
    """Value of a component that has no time."""
    return next(batches(path, entity, component, is_static=True)).column(component).to_pylist()[0]


def timed(path, entity, component):
    """Times in ms and values of a component, a list for each row, in the order of time."""
    rows = []
    for batch in batches(path, entity, component, has_timeline=TIMELINE):
        times = batch.column(TIMELINE).cast(pa.int64()).to_pylist()
        rows += zip(times, batch.column(component).to_pylist(), strict=True)
    return [(t_ns // 1_000_000, values) for t_ns, values in sorted(rows, key=lambda row: row[0])]


def telemetry_of(path, signal, entity=TELEMETRY):
    """Times in ns and values (n, size) of a signal of the telemetry, or of its envelope."""
    return series(columns(path, content=f"/{entity}"), entity, "values_0", signal)
