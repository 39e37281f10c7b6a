"""Content of runs: columns of short runs under each part, effect of each field, sessions and files."""

import json

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.control.laws import LAWS
from spheretwin.faults.targets import TARGETS
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.run import figures_of
from spheretwin.scenario.fields import families, fields_of
from spheretwin.scenario.sections import Scenario
from spheretwin.session import Session
from spheretwin.simulation import simulate
from spheretwin.trajectories import SHAPES
from tests.content.content import content_test, scratch
from tests.content.short_runs import LAGRANGIAN, SHORT, brief
from tests.content.values import array, number, tree

TICKS = 40
PROTOTYPE = {"hardware": "prototype", "duration": 0.04, **LAGRANGIAN}
ELECTRONICS = {"hardware": "electronics", "plant.engine": "mujoco"}
"""Hardware and engine whose loops other tests compile, too."""


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


def of_hardware():
    hardware = ({**SHORT, **LAGRANGIAN}, {**SHORT, **ELECTRONICS}, PROTOTYPE)
    return "\n".join(run_text("nutation", each) for each in hardware)


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
    listed += [{"estimator.kind": kind, **ELECTRONICS} for kind in families(Scenario)["estimator.kind"]]
    limited = {"controller.law": "pd", "disturbance.load": 9.0}
    listed += [{"allocation": kind, **limited} for kind in ("least_norm", "bounded")]
    listed += [
        {"trajectory": {"shape": shape, **({"file": f"{folder}/w.csv"} if shape == "waypoints" else {})}}
        for shape in SHAPES
    ]
    approach = {"start_s": 0.01, "lasts_s": 0.02, "angle_rad": [0.01, 0.0, 0.02], "shape_s": 0.5}
    listed += [{"trajectory.approach": approach}]
    sinusoid = {
        "amplitude_Nm": [0.1, 0.2, 0.3],
        "frequency_Hz": [10.0, 0.0, 90.0],
        "phase_rad": [0.0, 1.0, 2.0],
    }
    listed += [
        {"disturbance.terms": [{"kind": kind, **more}]}
        for kind, more in (
            ("constant", {"torque_Nm": [0.1, -0.2, 0.3]}),
            ("steps", {"times_s": [0.01, 0.02], "torques_Nm": [[0.1, 0, 0.2], [0, -0.3, 0]]}),
            ("sinusoidal", sinusoid),
            ("table", {"file": f"{folder}/t.csv"}),
            ("table", {"file": f"{folder}/t.csv", "between": "held"}),
            ("random", {"bound_Nm": [0.1, 0.0, 1e-3]}),
            ("random", {"gamma_envelope": "growing"}),
        )
    ]
    listed += [
        {"controller.governor.acceleration_rad_s2": [5.0, 6.0, 7.0]},
        {"controller.prediction.on": True, **ELECTRONICS},
        {
            "controller.feed_forward.friction": [1.0, 0.5, 0.2],
            "controller.feed_forward.inertia": [1.0, 0.9, 0.8],
            **ELECTRONICS,
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
            given = what.value is not None and what.value.default is None
            value = {"value": max(what.value.least, min(what.value.largest, 0.01))} if given else {}
            fault = {"target": target.names(18)[-1], "mode": mode, "start_s": 0.01, "end_s": 0.03, **value}
            with Session(scenarios.load("nutation", {**PROTOTYPE, "fault": [fault]})) as session:
                table = session.advance(TICKS)
            marks = array(table["fault"].sum(axis=1))
            lines += [f"{fault}: fault {marks}", *brief(table)]
    return "\n".join(lines)


PARTS = "sensors drive plant estimator watchdog detector nominal controller disturbance"
SECTIONS = tuple(f"{part}." for part in PARTS.split())


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


KINDS = ("plant.thermal.on", "plant.stiction.on", "plant.end_stops.on")
OMITTED = ("controller.period_s", "plant.step_s", *KINDS)
"""Fields that are not changed: periods that do not fit then, and what selects another kind of loop."""


def differs(name, values, usual):
    """True if a column differs by more than rounding, amplified in a short run: it depends on the processor.

    Where rounding crosses a limit, a share of a period at the limit changes by a step: a hundredth of these
    shares is no difference.
    """
    far = np.abs(values - usual) > 1e-9 * np.abs(usual).max()
    return np.count_nonzero(far) > (0.01 * far.size if name.endswith("_limited") else 0)


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
        if not name.startswith(sections) or other is None or name not in known or name in OMITTED:
            continue
        try:
            table = run({name: other})
        except SpheretwinError as error:
            lines.append(f"{name} = {other}: {error}")
            continue
        names, usual_names = ([signal.name for signal in rows.signals] for rows in (table, usual))
        changed = [
            each for each in names if each not in usual_names or differs(each, table[each], usual[each])
        ]
        last = [number(each) for each in table["q_rad"][-1]] if changed else []
        summed = [each for each in changed if each in ("current_A", "q_measured_rad", "copper_loss_W")]
        sums = {each: number(float(np.abs(table[each]).sum())) for each in summed}
        lines.append(f"{name} = {other}: {' '.join(changed) or 'no column'}; {' '.join(last)} {sums}")
    return "\n".join(lines)


CASES = {
    "run_hardware": of_hardware,
    "run_parts": of_parts,
    "run_faults": of_faults,
    "run_fields": lambda: effect_of_each_field(PROTOTYPE, SECTIONS),
    "run_fields_of_compensators": lambda: effect_of_each_field(
        COMPENSATED, ("nominal.", "controller.", "detector.", "drive.delay")
    ),
    "run_fields_set_in_a_run": lambda: effect_of_each_field(PROTOTYPE, SECTIONS, at_tick=20),
}


test_content = content_test(CASES)
