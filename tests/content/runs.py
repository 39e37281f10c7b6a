"""Runs of constructed rows: every signal of a scenario, without a simulation."""

import zlib
from pathlib import Path

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.records.provenance import facts_of
from spheretwin.run import Run
from spheretwin.scenario.sections import Scenario
from spheretwin.session import Session
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.viz.recording.stream import Stream

PERIOD_s = 1e-3

FAULTS = [
    {"target": "coil.07", "mode": "open", "start_s": 0.1, "detection": True},
    {"target": "coil.03", "mode": "short", "start_s": 0.15, "reported_to_controller": True},
    {"target": "encoder.gamma", "mode": "stuck", "start_s": 0.2, "end_s": 0.25},
]


def session_of(name: str = "hold", **changes) -> Session:
    """Return a session that never advances."""
    return Session(scenarios.load(name, {"plant.engine": "lagrangian", **changes}))


def rows_of(session: Session, ticks: int) -> Table:
    """Return rows of all signals of a session: saw teeth with unique heights and steps of unique lengths.

    They are products and remainders of whole numbers and decimals: the same on every machine.
    """
    table = Table(session.signals, np.zeros((ticks, width(session.signals))))
    tick = np.arange(ticks)[:, None]
    for place, signal in enumerate(session.signals):
        block = table[signal.name].reshape(ticks, -1)
        entry = np.arange(signal.size)
        if signal.states:
            block[:] = (tick // (ticks // 5 + 7 * entry + place)) % len(signal.states)
        else:
            period = 60 + 11 * entry + 3 * place
            block[:] = 0.02 * (1 + entry + 0.1 * place) * ((tick % period) / period - 0.3)
    table["t_s"][:] = PERIOD_s * np.arange(ticks)
    table["error_rad"][:] = table["q_rad"] - table["q_ref_rad"]
    table["current_A"][:] *= 8.0 / np.abs(table["current_A"]).max()
    table["allocation_scale"][:] = np.where(np.arange(ticks) % 97 < 9, 0.7, 1.0)
    return table


def write(stream: Stream, table: Table, status: Status, rows_at_once: int = 97) -> None:
    """Send all rows of a run in chunks, and its end."""
    for first in range(0, len(table), rows_at_once):
        stream.write(table.rows(first, min(first + rows_at_once, len(table))))
    stream.finish(status)


def recording(path: Path, session: Session, ticks: int, status: Status, **options) -> Path:
    """Return the recording of a constructed run."""
    with Recorder(
        session.actuator, session.signals, facts_of(session.scenario), path=path, **options
    ) as recorder:
        write(recorder, rows_of(session, ticks), status)
    return path


def made_run(scenario: Scenario, name: str, most_ticks: int = 1500) -> Run:
    """Return a run of constructed rows whose size follows from a name; some end before their time."""
    lot = zlib.crc32(name.encode())
    status = Status.LEFT_WORKSPACE if lot % 13 == 0 else Status.COMPLETED
    with Session(scenario) as session:
        ticks = min(session.scenario.ticks, most_ticks)
        table = rows_of(session, max(1, ticks if status == Status.COMPLETED else 3 * ticks // 5))
        table["t_s"][:] *= session.scenario.controller.period_s / PERIOD_s
        # Every kind of figure has its own size in each run, and every hinge its own share of it.
        share = [1.0, 0.4 + lot % 7 / 5, 0.2 + lot % 5 / 4]
        table["error_rad"][:] *= (0.05 + lot % 997 / 997) * np.array(share)
        for name in ("current_command_A", "current_A", "mean_current_A"):
            table[name][:] *= 0.2 + lot % 31 / 20
        table["torque_command_Nm"][:] *= 0.5 + lot % 43 / 10
        saturated = np.arange(len(table)) % (3 + lot % 61) == 0
        table["allocation_scale"][:] = np.where(saturated, 0.6, 1.0)
        table["q_rad"][:] = table["q_ref_rad"] + table["error_rad"]
        return Run(session.initial_scenario, status, table, np.nan, session.actuator)
