"""Content of sessions, of the objects of a run, of sinks and of written files."""

from dataclasses import replace

import pytest

from spheretwin import run as run_module
from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.config.config_warnings import warnings_of
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.telemetry.run_record import Change, RunRecord
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.records import outputs, replay
from spheretwin.records.provenance import facts_of
from spheretwin.session import Session
from spheretwin.simulation import follow, simulate
from tests.content.content import content_test, refusal, scratch
from tests.content.short_runs import LAGRANGIAN, SHORT, brief
from tests.content.values import array, number, tree


def of_sessions():
    """A session with changes, snapshots and another state, and what it refuses."""
    lines = []

    def report(title, session, table=None):
        lines.append(
            f"## {title}: tick {session.tick}, t {number(session.t_s)} s, {session.status},"
            f" ended {session.ended}, {session!r}"
        )
        lines.extend(f"{name}: {array(getattr(session, name))}" for name in ("q_rad", "qdot_rad_s"))
        if table is not None:
            lines.extend(brief(table))

    def attempt(title, call, *arguments, **named):
        lines.append(f"{title}: {refusal(call, *arguments, **named)}")

    events = [
        {"t_s": 0.005, "set": "disturbance.load", "value": 0.5},
        {"t_s": 0.02, "set": "controller.law", "value": "pid"},
        {"t_s": 0.03, "set": "fault", "value": {"target": "coil.01", "mode": "open"}},
        {"t_s": 9.0, "set": "allocation", "value": "bounded"},
    ]
    scenario = scenarios.load("sinusoid", {**LAGRANGIAN, "duration": 0.1, "event": events})
    lines += warnings_of(scenario, initial_config(scenario, None, None).files)
    with Session(scenario) as session:
        report("start", session)
        report("10 ticks", session, session.advance(10))
        snapshot = session.snapshot()
        report("30 ticks", session, session.advance(30))
        session.set("disturbance.load", 1.0)
        session.set("fault", {"target": "coil.05", "mode": "short"})
        session.set_state(q_rad=[0.1, 0.0, -0.1], qdot_rad_s=[0, 0, 1.0], current_A=[0.2] * 18)
        report("after changes", session, session.advance(15))
        lines += [f"journal {change}" for change in session.journal]
        for name, value in (
            ("duration", 1.0), ("x", 1), ("controller.law", "x"), ("plant.engine", "mujoco"), (3, 1),
            ("controller.period_s", 0.01), ("disturbance.load", "x"), ("trajectory.frequency_Hz", -1.0),
            ("drive.supply_V", 24.0), ("sensors.adc.bits", 12),
            ("fault", {"target": "coil.77", "mode": "open"}),
        ):  # fmt: skip
            attempt(f"set {name} {value}", session.set, name, value)
        for given in (
            {}, {"q_rad": [3.0, 0, 0]}, {"q_rad": [1, 2]}, {"current_A": [0.0]}, {"current_A": [99.0] * 18},
            {"qdot_rad_s": [float("nan"), 0, 0]},
        ):  # fmt: skip
            attempt(f"set_state {given}", session.set_state, **given)
        for ticks in (-1, 1.5, "x", True, 10**13):
            attempt(f"advance {ticks}", session.advance, ticks)
        attempt("restore 3", session.restore, 3)
        session.restore(snapshot)
        report("restored", session, session.advance(30))
        lines += [f"journal {change}" for change in session.journal]
        report("0 ticks", session, session.advance(0))
        report("to the end", session, session.advance(1000))
        report("beyond", session, session.advance(5))
        other = Session(scenarios.load("sinusoid", LAGRANGIAN), law=None)
        attempt("restore in another", other.restore, snapshot)
        report("another", other, other.advance(3))
        other.close()
    attempt("advance after close", session.advance, 1)
    attempt("set after close", session.set, "disturbance.load", 1.0)
    return "\n".join(lines)


def _not_installed(package):
    raise ModuleNotFoundError(package)


def run_objects():
    """Text, page, tables and files of a run."""
    fault = {"target": "coil.03", "mode": "open", "start_s": 0.02}
    run = simulate(scenarios.load("nutation", {**SHORT, **LAGRANGIAN, "fault": [fault]}))
    folder = scratch("run_objects")
    lines = [repr(run), run._repr_html_().partition("<svg")[0][:3000]]
    frame = run.to_pandas()
    lines += [f"pandas {name}: {array(frame[name].to_numpy())}" for name in frame.columns][::7]
    lines += [f"index {array(frame.index.to_numpy())} {frame.index.name} {frame.shape}"]
    arrow = run.to_arrow()
    lines += [f"arrow {field.name}: {field.type}" for field in arrow.schema]
    lines += [f"log {line}" for line in run._changes()]
    record = run.provenance
    lines += tree({"status": record.status, "journal": list(record.journal), "ticks": record.ticks})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_module, "import_module", _not_installed)
        for convert in (run.to_pandas, run.to_polars, run.to_xarray):
            lines.append(f"{convert.__name__}: {refusal(convert)}")
    for name in ("a.csv", "a", "b.parquet", "b.rrd"):
        lines.append(f"{name}: {refusal(run.save, folder / name).replace('accepted', 'saved')}")
    return "\n".join(lines)


class Calls:
    """Sink that lists its calls."""

    def __init__(self, name, lines):
        self._name, self._lines = name, lines

    def write(self, rows):
        first, last = (number(rows["t_s"][place]) for place in (0, -1)) if len(rows) else ("none", "none")
        self._lines.append(
            f"{self._name}: {len(rows)} rows from {first} to {last} s, {len(rows.signals)} columns"
        )

    def note(self, t_s, text):
        self._lines.append(f"{self._name}: note at {number(t_s)} s: {text}")

    def finish(self, status):
        self._lines.append(f"{self._name}: {status}")


EVENTS = [
    {"t_s": 0.0, "set": "disturbance.load", "value": 0.5},
    {"t_s": 0.05, "set": "controller.law", "value": "pid"},
    {"t_s": 0.05, "set": "disturbance.load", "value": 0.25},
]
FAULTS = [
    {"target": "coil.03", "mode": "open", "start_s": 0.02, "end_s": 0.06, "detection": True},
    {"target": "pot.alpha", "mode": "offset", "value": 0.01, "start_s": 0.02},
]
JOURNAL = (
    Change(0, "disturbance.load", 0.1),
    Change(30, "controller.law", "pd"),
    Change(120, "disturbance.load", 0.2),
)


def of_sinks():
    """Calls of two sinks: rows, messages and end, of complete, interrupted, failed and continued runs."""
    lines = []

    def follow_text(title, ticks, overrides=None, **options):
        lines.append(f"## {title}")
        changes = {**LAGRANGIAN, "duration": 0.12, **(overrides or {})}
        with Session(scenarios.load("sinusoid", changes)) as session:
            status = follow(session, ticks, [Calls("first", lines), Calls("second", lines)], **options)
            lines.append(f"{status}, tick {session.tick}, {session.journal}, {session.events}")

    follow_text("complete", 120, {"event": EVENTS, "fault": FAULTS, "hardware": "electronics"})
    follow_text("journal", 120, journal=JOURNAL)
    follow_text("no tick", 0, journal=JOURNAL)
    stops = iter([False, True])
    follow_text("interrupted", 5000, {"plant.step_s": 0.0001}, stop_requested=lambda: next(stops))
    follow_text("left", 400, {"controller.law": "pd", "disturbance.load": 900.0})
    follow_text(
        "short chunks", 1200, {"plant.step_s": 1e-6, "duration": 2.0}, stop_requested=lambda: len(lines) > 120
    )
    run = simulate(
        "sinusoid", {**LAGRANGIAN, "duration": 0.05, "event": EVENTS}, sinks=[Calls("sink", lines)]
    )
    lines.append(f"{run.status} {len(run.telemetry)} {run.record.ticks} {run.record.journal}")
    again = simulate(scenarios.load("hold", LAGRANGIAN), {"duration": 0.01, "controller.law": "pd"})
    lines.append(f"{again.scenario.name} {again.scenario.controller.law} {len(again.telemetry)}")
    return "\n".join(lines)


def of_outputs():
    """Files that are written from a tick on, and what is refused of files, rates and replays."""
    folder, lines = scratch("outputs"), []

    def attempt(title, call, *arguments, **named):
        try:
            lines.append(f"{title}: {call(*arguments, **named)}")
        except SpheretwinError as error:
            lines.append(f"{title}: {error}")

    one = folder / "one.parquet"
    (folder / "x").mkdir()
    attempt("twice", outputs.check, None, one, [folder / "x" / ".." / "one.parquet"])
    attempt("folder", outputs.check, None, folder)
    attempt("format", outputs.check, folder / "one.mcap", one)
    for rate, record, period_s in (
        (None, None, 1e-3), (10.0, None, 1e-3), (1000.0, one, 1e-3), (1000.1, one, 1e-3), (999.9, one, 1e-3),
    ):  # fmt: skip
        title = f"rate {rate} {record and record.name} {period_s}"
        attempt(title, outputs.check_rate, rate, record, period_s)
    changes = {**LAGRANGIAN, "duration": 0.12, "event": EVENTS, "plant.mjcf": str(actuators.MJCF_PATH)}
    for first_tick in (0, 30, 100, None):
        with Session(scenarios.load("sinusoid", changes)) as session:
            files = outputs.Outputs(session, None, one, first_tick=first_tick)
            lines.append(f"first tick {first_tick}: paths {[path.name for path in files.paths]}")
            if first_tick is None:
                session.advance(20)
                files.begin(40)
            follow(session, 120, [*files.sinks, Calls("sink", [])])
            lines.append(f"errors {files.close()}, {[path.name for path in files.paths]}")
        table, metadata = read_parquet(one)
        record = RunRecord.from_metadata(metadata)
        lines.append(
            f"{len(table)} rows from {number(table['t_s'][0])} s, {array(table['q_rad'])},"
            f" ticks {record.ticks}, first {record.first_tick}, {record.status}, journal {record.journal},"
            f" {len(record.files)} files"
        )
        plan = replay.read(one)
        lines.append(f"plan {plan.scenario.name}, {plan.ticks}, {plan.journal}, {plan.first_tick}")
    for title, change in (
        ("ticks", {"ticks": 0}), ("first", {"first_tick": 120}),
        ("law", {"journal": (Change(3, "controller.law", "mine"),)}),
        ("file", {"files": {str(actuators.MJCF_PATH): "0" * 64}}), ("scenario", {"scenario": {}}),
        ("field", {"scenario": {"x": 1}}), ("change", {"journal": (Change(3, "x", 1),)}),
        ("value", {"journal": (Change(3, "plant.mjcf", 3),)}),
    ):  # fmt: skip
        other = folder / f"{title}.parquet"
        table.write_parquet(other, replace(record, **change).metadata())
        attempt(f"replay {title}", replay.read, other)
    table.write_parquet(folder / "bare.parquet", {})
    attempt("replay bare", replay.read, folder / "bare.parquet")
    facts = facts_of(initial_config(scenarios.load("nutation", {"seed": 5}), None, None).scenario)
    lines += tree({"facts": {**vars(facts), "mjcf": facts.mjcf.name}})
    return "\n".join(lines)


CASES = {
    "run_sinks": of_sinks, "run_outputs": of_outputs, "run_sessions": of_sessions, "run_objects": run_objects,
}  # fmt: skip


test_content = content_test(CASES)
