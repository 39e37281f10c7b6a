"""Content of runs: columns of short runs under each part, effect of each field, sessions and files."""

import json
from dataclasses import replace

import numpy as np
import pytest

from spheretwin import outputs, replay
from spheretwin import run as run_module
from spheretwin import scenario as scenarios
from spheretwin.active_config import initial_config, warnings_of
from spheretwin.control.laws import LAWS
from spheretwin.faults.targets import TARGETS
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.telemetry.run_record import Change, RunRecord
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.provenance import facts_of
from spheretwin.run import figures_of
from spheretwin.scenario.fields import families, fields_of
from spheretwin.scenario.sections import Scenario
from spheretwin.session import Session
from spheretwin.simulation import follow, simulate
from spheretwin.trajectories import SHAPES
from tests.content.content import check, scratch
from tests.content.values import array, number, tree

TICKS = 40
LAGRANGIAN = {"plant.engine": "lagrangian"}
PROTOTYPE = {"hardware": "prototype", "duration": 0.04}


def columns(table):
    """Name, unit, labels and values of each column."""
    return [
        f"{signal.name} [{signal.unit}] {signal.meaning}; {' '.join((*signal.labels, *signal.states))}: "
        + (array(table[signal.name]) if len(table) else "no rows")
        for signal in table.signals
    ]


def run_text(name, overrides, columns_of=columns):
    """Status, columns, figures and warnings of a short run."""
    try:
        scenario = scenarios.load(name, overrides)
        with Session(scenario) as session:
            warnings = session.warnings()
        run = simulate(scenario)
    except SpheretwinError as error:
        return f"## {name} {overrides}\n{error}"
    return "\n".join(
        [
            f"## {name} {json.dumps(overrides)}",
            f"{run.status}, {len(run.telemetry)} rows, warnings {warnings}, {scenario.trajectory.notes()}",
            *columns_of(run.telemetry),
            *tree(figures_of(run)),
        ]
    )


SHORT = {"duration": 0.04}


def brief(table):
    """Last pose, reference, currents and torque alone."""
    names = {
        "q_rad",
        "q_ref_rad",
        "qdot_ref_rad_s",
        "q_measured_rad",
        "current_A",
        "torque_command_Nm",
        "disturbance_Nm",
    }
    return [
        f"{signal.name}: {array(table[signal.name][-20:])}"
        for signal in table.signals
        if signal.name in names
    ]


def of_hardware():
    return "\n".join(
        [
            run_text("nutation", {**SHORT, **LAGRANGIAN}),
            run_text("nutation", {**SHORT, "hardware": "electronics"}),
            run_text("nutation", PROTOTYPE),
        ]
    )


def of_parts():
    """Runs with each law, estimator, allocation, trajectory and disturbance."""
    folder = scratch("run_parts")
    (folder / "t.csv").write_text(
        "t_s,alpha_Nm,beta_Nm,gamma_Nm\n0.01,0.1,0,0\n0.02,0.3,-0.2,0\n0.03,0,0,0.4\n"
    )
    (folder / "w.csv").write_text(
        "t_s,alpha_rad,beta_rad,gamma_rad\n0,0,0,0\n0.02,0.01,-0.01,0.02\n0.04,0,0.01,0.03\n"
    )
    base = {**SHORT, **LAGRANGIAN}
    listed = [{"controller.law": law} for law in LAWS]
    listed += [
        {"estimator.kind": kind, "hardware": "electronics"} for kind in families(Scenario)["estimator.kind"]
    ]
    listed += [
        {"allocation": kind, "controller.law": "pd", "disturbance.load": 9.0}
        for kind in ("least_norm", "bounded")
    ]
    listed += [
        {"trajectory": {"shape": shape, **({"file": f"{folder}/w.csv"} if shape == "waypoints" else {})}}
        for shape in SHAPES
    ]
    listed += [
        {
            "trajectory.approach": {
                "start_s": 0.01,
                "lasts_s": 0.02,
                "angle_rad": [0.01, 0.0, 0.02],
                "shape_s": 0.5,
            }
        }
    ]
    listed += [
        {"disturbance.terms": [{"kind": kind, **more}]}
        for kind, more in (
            ("constant", {"torque_Nm": [0.1, -0.2, 0.3]}),
            ("steps", {"times_s": [0.01, 0.02], "torques_Nm": [[0.1, 0, 0.2], [0, -0.3, 0]]}),
            (
                "sinusoidal",
                {
                    "amplitude_Nm": [0.1, 0.2, 0.3],
                    "frequency_Hz": [10.0, 0.0, 90.0],
                    "phase_rad": [0.0, 1.0, 2.0],
                },
            ),
            ("table", {"file": f"{folder}/t.csv"}),
            ("table", {"file": f"{folder}/t.csv", "between": "held"}),
            ("random", {"bound_Nm": [0.1, 0.0, 1e-3]}),
            ("random", {"gamma_envelope": "growing"}),
        )
    ]
    listed += [
        {"controller.governor.acceleration_rad_s2": [5.0, 6.0, 7.0]},
        {"controller.prediction.on": True, "hardware": "electronics"},
        {
            "controller.feed_forward.friction": [1.0, 0.5, 0.2],
            "hardware": "electronics",
            "controller.feed_forward.inertia": [1.0, 0.9, 0.8],
        },
        {"manual.currents_A": [0.1] * 18},
        {"watchdog.on": True, "watchdog.largest_rate_rad_s": 0.05},
        {"nominal.equals_truth": True, "plant.payload_kg": 0.1},
        {"plant.initial_rad": [0.1, 0.2, 0.3], "plant.initial_rad_s": [0.1, 0, -0.1]},
    ]
    return "\n".join(run_text("nutation", {**base, **overrides}, brief) for overrides in listed)


def of_faults():
    """Each mode of each target, in a prototype, from tick 10 to tick 30."""
    lines = []
    for target in TARGETS.values():
        for mode, what in target.modes.items():
            value = (
                {}
                if what.value is None or what.value.default is not None
                else {"value": max(what.value.least, min(what.value.largest, 0.01))}
            )
            fault = {"target": target.names(18)[-1], "mode": mode, "start_s": 0.01, "end_s": 0.03, **value}
            with Session(scenarios.load("nutation", {**PROTOTYPE, "fault": [fault]})) as session:
                table = session.advance(TICKS)
            marks = array(table["fault"].sum(axis=1))
            lines += [f"{fault}: fault {marks}", *brief(table)]
    return "\n".join(lines)


SECTIONS = (
    "sensors.",
    "drive.",
    "plant.",
    "estimator.",
    "watchdog.",
    "detector.",
    "nominal.",
    "controller.",
    "disturbance.",
)


def varied(value):
    """Return another value of a number or of numbers; None if there is none."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return value * 1.25 if value else 1e-3
    if isinstance(value, tuple) and value:
        inside = [varied(entry) for entry in value]
        return None if None in inside else inside
    return None


COMPENSATED = {
    **PROTOTYPE,
    "controller.prediction.on": True,
    "controller.feed_forward.friction": [1.0, 1.0, 1.0],
    "controller.feed_forward.inertia": [1.0, 1.0, 1.0],
    "fault": [{"target": "coil.02", "mode": "open", "start_s": 0.01, "detection": True}],
}


def effect_of_each_field(base, sections, at_tick=0):
    """Columns of a run that change if one field has another value, and the new pose and currents.

    The value is that of the scenario, or it is set after some ticks: then the states of all parts are
    transferred to parts with another parameter.
    """
    scenario = initial_config(scenarios.load("nutation", base), None, None).scenario
    given = scenarios.load("nutation", base)
    fields = {name: value for name, value, _ in fields_of(scenario)}
    known = {name for name, _, _ in fields_of(given)}

    def run(overrides):
        with Session(scenarios.load("nutation", {**base, **({} if at_tick else overrides)})) as session:
            if at_tick:
                session.advance(at_tick)
                for name, value in overrides.items():
                    session.set(name, value)
            return session.advance(TICKS - at_tick)

    usual, lines = run({}), []
    for name, value in fields.items():
        other = varied(value)
        if not name.startswith(sections) or other is None or name not in known:
            continue
        if name in ("controller.period_s", "plant.step_s", "plant.thermal.on", "plant.stiction.on"):
            continue  # other kinds of loop, and periods that do not fit
        try:
            table = run({name: other})
        except SpheretwinError as error:
            lines.append(f"{name} = {other}: {error}")
            continue
        changed = [
            signal.name
            for signal in table.signals
            if signal.name not in {each.name for each in usual.signals}
            or table[signal.name].tobytes() != usual[signal.name].tobytes()
        ]
        last = [number(each) for each in table["q_rad"][-1]] if changed else []
        sums = {
            each: number(float(np.abs(table[each]).sum()))
            for each in changed
            if each in ("current_A", "q_measured_rad", "copper_loss_W")
        }
        lines.append(f"{name} = {other}: {' '.join(changed) or 'no column'}; {' '.join(last)} {sums}")
    return "\n".join(lines)


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
        try:
            call(*arguments, **named)
            lines.append(f"{title}: accepted")
        except (InputError, SpheretwinError) as error:
            lines.append(f"{title}: {error}")

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
            ("duration", 1.0),
            ("x", 1),
            ("controller.law", "x"),
            ("plant.engine", "mujoco"),
            (3, 1),
            ("controller.period_s", 0.01),
            ("disturbance.load", "x"),
            ("trajectory.frequency_Hz", -1.0),
            ("drive.supply_V", 24.0),
            ("sensors.adc.bits", 12),
            ("fault", {"target": "coil.77", "mode": "open"}),
        ):
            attempt(f"set {name} {value}", session.set, name, value)
        for given in (
            {},
            {"q_rad": [3.0, 0, 0]},
            {"q_rad": [1, 2]},
            {"current_A": [0.0]},
            {"current_A": [99.0] * 18},
            {"qdot_rad_s": [float("nan"), 0, 0]},
        ):
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
    run = simulate(
        scenarios.load(
            "nutation",
            {**SHORT, **LAGRANGIAN, "fault": [{"target": "coil.03", "mode": "open", "start_s": 0.02}]},
        )
    )
    folder = scratch("run_objects")
    lines = [repr(run), run._repr_html_().partition("<svg")[0][:3000]]
    frame = run.to_pandas()
    lines += [f"pandas {name}: {array(frame[name].to_numpy())}" for name in frame.columns][::7]
    lines += [f"index {array(frame.index.to_numpy())} {frame.index.name} {frame.shape}"]
    arrow = run.to_arrow()
    lines += [f"arrow {field.name}: {field.type}" for field in arrow.schema]
    lines += [f"log {line}" for line in run._log()]
    record = run.provenance
    lines += tree({"status": record.status, "journal": list(record.journal), "ticks": record.ticks})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_module, "import_module", _not_installed)
        for convert in (run.to_pandas, run.to_polars, run.to_xarray):
            with pytest.raises(InputError) as refusal:
                convert()
            lines.append(f"{convert.__name__}: {refusal.value}")
    for name in ("a.csv", "a", "b.parquet", "b.rrd"):
        try:
            run.save(folder / name)
            lines.append(f"{name}: saved")
        except SpheretwinError as error:
            lines.append(f"{name}: {error}")
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
    attempt(
        "twice",
        outputs.check,
        [one, folder / "x" / ".." / "one.parquet"] if (folder / "x").mkdir() is None else [],
    )
    attempt("folder", outputs.check, [folder])
    for rate, record, period_s in (
        (None, None, 1e-3),
        (10.0, None, 1e-3),
        (1000.0, one, 1e-3),
        (1000.1, one, 1e-3),
        (999.9, one, 1e-3),
    ):
        attempt(
            f"rate {rate} {record and record.name} {period_s}", outputs.check_rate, rate, record, period_s
        )
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
        ("ticks", {"ticks": 0}),
        ("first", {"first_tick": 120}),
        ("law", {"journal": (Change(3, "controller.law", "mine"),)}),
        ("file", {"files": {str(actuators.MJCF_PATH): "0" * 64}}),
        ("scenario", {"scenario": {}}),
        ("field", {"scenario": {"x": 1}}),
        ("change", {"journal": (Change(3, "x", 1),)}),
        ("value", {"journal": (Change(3, "plant.mjcf", 3),)}),
    ):
        other = folder / f"{title}.parquet"
        table.write_parquet(other, replace(record, **change).metadata())
        attempt(f"replay {title}", replay.read, other)
    table.write_parquet(folder / "bare.parquet", {})
    attempt("replay bare", replay.read, folder / "bare.parquet")
    facts = facts_of(initial_config(scenarios.load("nutation", {"seed": 5}), None, None).scenario)
    lines += tree({"facts": {**vars(facts), "mjcf": facts.mjcf.name}})
    return "\n".join(lines)


CASES = {
    "run_sinks": of_sinks,
    "run_outputs": of_outputs,
    "run_hardware": of_hardware,
    "run_parts": of_parts,
    "run_faults": of_faults,
    "run_fields": lambda: effect_of_each_field(PROTOTYPE, SECTIONS),
    "run_fields_of_compensators": lambda: effect_of_each_field(
        COMPENSATED, ("nominal.", "controller.", "detector.", "drive.delay")
    ),
    "run_fields_set_in_a_run": lambda: effect_of_each_field(PROTOTYPE, SECTIONS, at_tick=20),
    "run_sessions": of_sessions,
    "run_objects": run_objects,
}


@pytest.mark.parametrize("name", CASES)
def test_the_content_is_the_approved_one(name):
    check(name, CASES)
