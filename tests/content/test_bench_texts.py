"""Content of the bench: its status after each command, its journal, settings and history, and its clients."""

import dataclasses
import math

from spheretwin import scenario as scenarios
from spheretwin.bench.commands import COMMANDS
from spheretwin.bench.modes import Limits, approach_fields, current_motion, hold_shape, jog_shape, point_shape
from spheretwin.bench.operators import Operators
from spheretwin.bench.pace import Pace
from spheretwin.cli.bench import choices_of, settings_of, shape_settings
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.session import Session
from spheretwin.trajectories import SHAPES
from tests.content.content import content_test, scratch
from tests.content.values import array, lines, plain, tree
from tests.twin.bench.cases import QUIET, Clock, bench

VARIABLE = {"missed", "missed_share", "realtime_factor"}
"""Entries of a status that depend on the clock."""


def differences(before, after, prefix=""):
    """Return the entries of nested values that changed, by dotted name."""
    changed = {}
    for name, value in after.items():
        if isinstance(value, dict) and isinstance(before.get(name), dict):
            changed |= differences(before[name], value, f"{prefix}{name}.")
        elif before.get(name) != value:
            changed[f"{prefix}{name}"] = value
    return changed


COIL = {"target": "coil.07", "mode": "open"}

SCRIPT = [
    ("start", {}, 20), ("set", {"name": "disturbance.load", "value": 0.5}, 10), ("hold", {}, 30),
    ("snapshot", {"name": "s"}, 1), ("point", {"pose_rad": [0.1, -0.05, 0.2]}, 150),
    ("jog", {"rates_rad_s": [0.05, -0.1, 0.3]}, 60), ("add_fault", {"fault": COIL}, 20),
    ("add_fault", {"fault": {**COIL, "target": "coil.02"}}, 5), ("clear_faults", {"place": 0}, 5),
    ("clear_faults", {"place": 7}, 0), ("manual", {"group": 4, "current_A": 0.3}, 10),
    ("manual", {"currents_A": [0.01] * 18}, 10), ("manual", {"group": 99}, 0),
    ("trajectory", {"fields": {"shape": "sinusoid", "frequency_Hz": 1.0}}, 80),
    ("set", {"name": "trajectory.frequency_Hz", "value": 0.8}, 40),
    ("set", {"name": "controller.law", "value": "pid"}, 20),
    ("set", {"name": "plant.step_s", "value": 0.00025}, 5), ("limits", {"rate_rad_s": 0.4}, 5),
    ("limits", {}, 0), ("limits", {"rate_rad_s": -1.0}, 0), ("restore", {"name": "x"}, 0),
    ("restore", {"name": "s"}, 20), ("speed", {"factor": 2.0}, 5), ("set", {"name": "seed", "value": 5}, 5),
    ("set", {"name": "hardware", "value": "electronics"}, 0), ("pause", {}, 10), ("step", {"ticks": 7}, 10),
    ("reset", {}, 5), ("start", {}, 30), ("off", {}, 10), ("stop", {}, 10), ("hold", {}, 5),
    ("restore", {"name": "s"}, 0), ("reset", {}, 0), ("load", {"source": "tilt", "overrides": QUIET}, 0),
    ("start", {}, 25), ("set", {"name": "manual.currents_A", "value": None}, 0),
    ("trajectory", {"fields": {"shape": "hold", "approach": {"x": 1}}}, 0), ("grant", {"to": "nobody"}, 0),
    ("keep", {}, 0), ("record", {"telemetry": "FOLDER/r.parquet"}, 15), ("keep", {}, 5),
    ("save", {"file": "FOLDER/saved.toml"}, 0), ("replay", {"file": "FOLDER/r.parquet"}, 5), ("hold", {}, 5),
]  # fmt: skip

END = [
    ("set", {"name": "disturbance.load", "value": 1000.0}, 1500), ("hold", {}, 3),
    ("snapshot", {"name": "t"}, 0), ("reset", {}, 0),
]  # fmt: skip

REFUSED = [
    ("step", {}), ("steer", {}), ("stpo", {}), (3, {}), ("speed", {"factor": 0.01}), ("speed", {}),
    ("speed", {"factor": 1.0, "colour": "red"}), ("speed", {"factor": "2"}), ("off", {"now": True}),
    ("off", {"now": {1}}), ("point", {"pose_rad": [0, 1]}), ("point", {"pose_rad": [0.0, 1.39, 0.0]}),
    ("jog", {"rates_rad_s": [math.inf, 0, 0]}), ("manual", {"group": 18}), ("manual", {}),
    ("manual", {"currents_A": [1.0] * 17}), ("set", {"name": "disturbance.load", "value": math.nan}),
    ("set", {"name": "trajectory.approach.start_s", "value": 1.0}), ("clear_faults", {"place": 0}),
    ("record", {}), ("record", {"telemetry": "/no/such/run.parquet"}), ("save", {"file": "/no/such/s.toml"}),
    ("replay", {"file": "/no/such/run.parquet"}), ("load", {"source": "nowhere"}),
    *(("set", {"name": name, "value": value}) for name, value in (
        ("controller.law", "magic"), ("plant.payload_kg", -1.0), ("nothing", 1.0),
        ("fault", [{"target": "coil.99", "mode": "open"}]), ("trajectory.shape", "spiral"),
    )),
    *(("capture", given) for given in (
        {"on": "level", "signal": "eror_rad"}, {"on": "level", "signal": "error_rad", "entry": 3},
        {"on": "fault", "before_s": 2.0, "length_s": 2.0}, {"on": "fault", "length_s": 1e3},
    )),
]  # fmt: skip


def a_script_of_commands():
    """Status after each of some commands: what changed since the one before."""
    folder, lines = scratch("bench"), []
    with bench(plant__end_stops__on=False) as made:
        before = {}
        for name, arguments, ticks in [*SCRIPT, *((*each, 0) for each in REFUSED), *END]:
            given = {
                key: value.replace("FOLDER", str(folder)) if isinstance(value, str) else value
                for key, value in arguments.items()
            }
            ticket = made.command(name, **given)
            ran = made.advance(ticks)
            if name == "keep":
                made._bench_state.recording.join()
                made.advance(0)
            after = plain(made.state())
            lines.append(f"## {name} {arguments}: {ran} ticks, refused: {ticket.refused}")
            changed = differences(before, after)
            lines += tree({key: changed[key] for key in changed if key not in VARIABLE})
            before = after
        lines += ["## bins", *tree({**plain(made.bins()), "run": 0})]
        lines += [made.scenario_toml(), made.command_line()]
    table, metadata = read_parquet(folder / "r.parquet")
    lines += [f"{signal.name}: {array(table[signal.name])}" for signal in table.signals]
    lines += [(folder / "saved.toml").read_text(encoding="utf-8"), f"journal {metadata.get('journal')}"]
    return "\n".join(lines)


def a_script_of_operators():
    """Operator, watching and asking clients after each of their commands, and what is refused."""
    clock = Clock()
    operators, lines = Operators(2.0, 10.0, clock), []
    steps = [
        (0, "register", "a"), (1, "register", "b"), (1, "ask", "b"), (1, "ask", "c"), (1, "ask", "b"),
        (2, "check", "b"), (2, "check", None), (2, "grant", "b", "c"), (2, "grant", "a", "x"),
        (3, "grant", "a", "c"), (3, "check", "a"), (4, "leave", "c"), (4, "leave", "b"), (5, "check_silence"),
        (6, "check_silence"), (6.5, "check_silence"), (7, "check_silence"), (7, "ask", "d"),
        (8, "register", "a"), (16.9, "check_silence"), (17.5, "check_silence"), (18, "register", "a"),
        (18.5, "check_silence"), (19, "ask", "a"), (30, "check_silence"), (31, "check_silence"),
        (32, "register", "e"), (33, "ask", "f"), (42.5, "check_silence"),
    ]  # fmt: skip
    steps += [(50, "register", f"client {place}") for place in range(70)]
    for now, name, *arguments in steps:
        clock.now = now
        try:
            result = getattr(operators, name)(*arguments)
        except InputError as error:
            result = error
        lines.append(
            f"{now} {name} {arguments}: {result} | {operators.operator}, watching {operators.watching[:4]},"
            f" asking {operators.asking}"
        )
    return "\n".join(lines)


def a_script_of_the_pace():
    """Ticks, waits and counts of chunks that are fast, slow and late, at several speeds."""
    clock = Clock()
    pace, lines, t_s = Pace(clock), [], 0.0
    for speed, took_s in [
        *[(1.0, 0.001)] * 8, *[(1.0, 0.015)] * 3, *[(2.0, 0.006)] * 4, *[(1.0, 0.3)] * 2, *[(0.1, 0.001)] * 3,
        *[(1e6, 0.002)] * 4, *[(1e6, 0.012)] * 2, *[(1.0, 0.004)] * 4, *[(1.0, 0.01)] * 2, (20.0, 0.0041),
        (20.0, 0.0039),
    ]:  # fmt: skip
        pace.speed = speed
        ticks, wait_s = pace.ticks(1e-3), pace.wait_s()
        clock.now += wait_s + took_s
        t_s += 1e-3 * ticks
        pace.record_chunk(ticks, 1e-3, t_s, took_s)
        lines.append(
            f"{speed:g} {took_s:g}: {ticks} ticks, wait {wait_s:.9g} s, factor {pace.realtime_factor():.9g},"
            f" chunks {pace.chunks}, missed {pace.missed}, share {pace.missed_share:.9g},"
            f" fastest {pace.fastest}"
        )
    pace.record_chunk(1, 1e-3, 0.0, 0.001)  # time goes back
    lines.append(f"back: factor {pace.realtime_factor():.9g}")
    clock.now += 1.5
    lines.append(f"later: factor {pace.realtime_factor():.9g}, wait {pace.wait_s():.9g} s")
    pace.rest()
    lines.append(
        f"rest: wait {pace.wait_s():.9g} s, chunks {pace.chunks}, ticks {pace.ticks(5e-4)} {pace.ticks(0.5)}"
    )
    pace.clear()
    lines.append(f"clear: chunks {pace.chunks}, missed {pace.missed}, share {pace.missed_share:.9g}")
    return "\n".join(lines)


def shapes_of_modes():
    """Shapes and approaches that modes make of a motion."""
    content = {}
    with Session(scenarios.load("sinusoid", QUIET)) as session:
        session.advance(137)
        motion, limits, reach = current_motion(session), Limits(), session.actuator.hinge_range_rad
        shapes = {
            "hold": hold_shape(motion, limits, reach),
            "point": point_shape((0.1, -0.2, 3.0), reach),
            "point far": point_shape((1.2, -1.3, -9.0), reach),
            "jog": jog_shape(motion, (0.1, -0.2, 0.3), limits, reach),
            "jog far": jog_shape(motion, (9.0, -0.2, 50.0), limits, reach),
            "sinusoid": SHAPES["sinusoid"](),
            "nutation": SHAPES["nutation"](),
        }
        content["motion"] = plain(motion)
        for slow in (Limits(), Limits(rate_rad_s=0.2), Limits(acceleration_rad_s2=1.0)):
            for name, shape in shapes.items():
                approach = approach_fields(shape, motion, 1.5, 0.25, slow, reach)
                both = {"shape": shape.model_dump(mode="json"), "approach": approach}
                content[f"{slow}, {name}"] = plain(both)
    return lines(content)


def arguments_of_commands():
    lines = []
    for name, command in COMMANDS.items():
        fields = command.arguments.model_json_schema().get("properties")
        lines += [f"{name}: by {command.by}, {fields}", f"    {command.text}"]
    return "\n".join(lines)


def row(setting):
    """Return the entries of a setting as a line."""
    entries = dataclasses.astuple(setting) if dataclasses.is_dataclass(setting) else setting
    return " | ".join(map(str, entries))


def choices():
    """What the page of a bench offers."""
    with bench(controller__law="pid", plant__end_stops__on=False) as made:
        offered = choices_of(made, scratch("bench_folder"))
        content = {
            "targets": {name: list(modes) for name, modes in offered.targets.items()},
            "scenarios": list(offered.scenarios()),
            "shapes": list(offered.shapes),
            "laws": list(offered.laws()),
            "limits": plain(offered.limits),
            "settings": list(map(row, offered.settings())),
            "fields": list(map(row, settings_of(made.fields()[:3]))),
            "shape": {name: list(map(row, shape_settings(name, made))) for name in (*SHAPES, "x")},
        }
    return lines(content)


CASES = {
    "bench_script": a_script_of_commands, "bench_shapes": shapes_of_modes,
    "bench_operators": a_script_of_operators, "bench_pace": a_script_of_the_pace,
    "bench_arguments": arguments_of_commands, "bench_choices": choices,
}  # fmt: skip


test_content = content_test(CASES)
