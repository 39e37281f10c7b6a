"""One short run in both kinds of files, what killed processes leave of it, and runs made of columns."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.analysis.recorded_run import Reviewed
from spheretwin.models.telemetry.run_record import RunRecord
from spheretwin.models.telemetry.signals import Signal, width
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.records.outputs import Outputs
from spheretwin.session import Session
from spheretwin.simulation import follow

PLANT = {"plant.engine": "lagrangian"}
# Under a law without columns of its own from 1.5 s on, and with a part that fails: events of every kind.
# Ideal hardware with a fault has a loop of its own, which no other test needs; the prototype allows faults.
WITH_EVENTS = {
    **PLANT,
    "hardware": "prototype",
    "duration": 2.2,
    "fault": [{"target": "coil.07", "mode": "open", "start_s": 0.3, "detection": True}],
    "event": [{"t_s": 1.5, "set": "controller.law", "value": "pd"}],
}
SIGNALS = (Signal("t_s", "s", 1, "time"), Signal("x_rad", "rad", 2, "a pair", ("α", "β")))


def written(folder, name="run", scenario="hold", **changes):
    """A run's telemetry and recording, by the same sinks as the command's."""
    telemetry, recording = folder / f"{name}.parquet", folder / f"{name}.rrd"
    with Session(scenarios.load(scenario, {**PLANT, **changes})) as session:
        files = Outputs(session, recording, telemetry, live=False)
        follow(session, session.scenario.ticks, files.sinks)
        assert files.close() == []
    return telemetry, recording


def made_of(values, period_s=1e-3):
    """A run with some values (n, 2) as its one signal."""
    table = Table(SIGNALS, np.zeros((len(values), width(SIGNALS))))
    table["t_s"][:] = np.arange(len(values)) * period_s
    table["x_rad"][:] = values
    record = RunRecord({"controller": {"period_s": period_s}}, (), len(values), {}, {}, Status.COMPLETED)
    return Reviewed(Path("made.parquet"), record, table, (), True, record.metadata())


def named(run, path):
    return replace(run, path=Path(path))
