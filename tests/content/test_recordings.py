"""Approved content of recordings of constructed runs, with their layouts, and of the live view."""

from pathlib import Path

import numpy as np

from spheretwin.machine.state_estimation import signals
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.status import Level, Status
from spheretwin.models.telemetry.table import Table
from spheretwin.records.provenance import facts_of
from spheretwin.viz.comparison import merged_recording, trajectories
from spheretwin.viz.comparison import shadow as shadow_recording
from spheretwin.viz.comparison.runs import ComparedRun, EarlyEnd, LawTrajectory
from spheretwin.viz.quantities import QuantityRows
from spheretwin.viz.recording.live import LiveView
from spheretwin.viz.recording.part import RecordingSubject
from spheretwin.viz.recording.reader import rewrite
from spheretwin.viz.recording.recorder import Recorder
from tests.content.content import Cases, content_test, scratch
from tests.content.recordings import recording_text
from tests.content.runs import FAULTS, PERIOD_s, recording, rows_of, session_of, write


def every_row() -> str:
    session = session_of(duration=0.7, **{"disturbance.load": 2.0})
    return recording_text(recording(_file("every_row"), session, 500, Status.LEFT_WORKSPACE), scenario=True)


def decimated_electronics() -> str:
    """At 60 Hz, opened at another view: faults, detection, watchdog, compensators and an observer."""
    changes = {"hardware": "electronics", "fault": FAULTS, "watchdog.on": True, "controller.law": "afsm_eso"}
    session = session_of("tilt", duration=1.2, **changes)
    path = recording(_file("electronics"), session, 1200, Status.COMPLETED, rate_Hz=60.0, shown="hardware")
    return recording_text(path)


def payload() -> str:
    """A run under another law with a payload, ended by the watchdog."""
    changes = {"watchdog.on": True, "controller.law": "pd", "plant.payload_kg": 0.4}
    session = session_of("sinusoid", duration=0.4, hardware="electronics", **changes)
    return recording_text(recording(_file("payload"), session, 250, Status.FAILSAFE, shown="coils"))


def recovered() -> str:
    """A recording that was not closed, rewritten."""
    session = session_of(duration=1.0)
    path, target = _file("cut"), _file("recovered")
    table = rows_of(session, 1000)
    recorder = Recorder(
        session.actuator, session.signals, facts_of(session.scenario), path=path, rate_Hz=100.0
    )
    for first in range(0, 1000, 125):
        recorder.write(table.rows(first, first + 125))
    path.write_bytes(recorder.partial().path.read_bytes())
    recorder.close()
    return f"{rewrite(path, target).table.values.shape}\n{recording_text(target)}"


def live_view() -> str:
    session = session_of(duration=2.0, **{"controller.law": "pid"})
    view = LiveView(session.actuator, session.signals, facts_of(session.scenario), window_s=1.5)
    pieces = view._broadcast.read()
    write(view, rows_of(session, 600), Status.INTERRUPTED)
    view.close()
    path = _file("live")
    path.write_bytes(b"".join(pieces))
    return recording_text(path)


def merged() -> str:
    """Three runs of two laws and rates; one has left the workspace and has events."""
    loaded = {"disturbance.load": 1.0}
    settings = (("afsm", 600, 1e-3, {}), ("pd", 420, 1e-3, loaded), ("afsm", 350, 2e-3, {}))
    runs, subjects = [], []
    for place, (law, ticks, period_s, changes) in enumerate(settings):
        session = session_of(
            duration=0.7, **{"controller.law": law, "controller.period_s": period_s, **changes}
        )
        table = rows_of(session, ticks)
        table["t_s"][:] *= period_s / PERIOD_s
        if place == 1:
            table["q_ref_rad"][:] += 0.01
            table["q_rad"][:, 2] *= 1.5
        last_s = float(table["t_s"][-1])
        end = EarlyEnd(last_s, "left workspace", "α reached its end") if place == 1 else None
        noted = ((0.1, Level.WARN, "a warning"), (last_s, Level.ERROR, "the end")) if place == 1 else ()
        rows = QuantityRows(table, table.rows(0, 1), session.actuator, 8.0)
        label = f"{place + 1} made: {law}"
        runs.append(
            ComparedRun(f"run_{place + 1}_made", label, law, period_s, rows, {"name": label}, noted, end)
        )
        subjects.append(RecordingSubject(session.actuator, session.signals, facts_of(session.scenario)))
    path = _file("merged")
    merged_recording.write(path, runs, subjects, "**The runs**\n\n- of different laws")
    return recording_text(path)


def side_by_side() -> str:
    def of(law: str, ticks: int) -> LawTrajectory:
        t_s = 0.01 * np.arange(ticks)
        q = np.stack([0.1 * t_s * t_s, 0.2 * t_s, t_s], axis=1)
        return LawTrajectory(law, t_s, q, q + [1e-3, 2e-3, -3e-3], 0.1 + t_s)

    path = _file("side_by_side")
    laws = {"PD": of("pd", 20), "tuned PID": of("pid", 50)}
    return recording_text(trajectories.write(path, laws, session_of().actuator, "both"))


def shadow() -> str:
    """A shadow of constructed rows; rows without a measurement, and a band that is wide at first."""
    session = session_of(duration=0.4, hardware="electronics")
    table = Table(signals(False), np.zeros((400, width(signals(False)))))
    table.values[:] = rows_of(session, 400).values[:, : table.values.shape[1]]
    table["t_s"][:] = PERIOD_s * np.arange(400)
    table["q_measured_rad"][100:120, 1] = np.nan
    for name in ("qdot_estimated_rad_s", "disturbance_estimated_Nm"):
        table[f"{name}_std"][:] = np.where(np.arange(400) < 9, 1e9, 0.01)[:, None] * [1.0, 2.0, 3.0]
    subject = RecordingSubject(session.actuator, session.signals, facts_of(session.scenario))
    path, currents_A = _file("shadow"), rows_of(session, 400)["current_A"]
    shadow_recording.write(path, table, currents_A, subject, "a **verdict**")
    return recording_text(path)


def _file(name: str) -> Path:
    path = scratch("recordings") / f"{name}.rrd"
    path.unlink(missing_ok=True)
    return path


CASES: Cases = {
    "recording_every_row": every_row, "recording_decimated": decimated_electronics,
    "recording_payload": payload, "recording_recovered": recovered, "recording_live": live_view,
    "recording_merged": merged, "recording_side_by_side": side_by_side, "recording_shadow": shadow,
}  # fmt: skip


test_content = content_test(CASES)
