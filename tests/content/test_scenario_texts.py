"""Content of scenarios: every field with default and range; messages about values that are refused."""

import json

from pydantic import TypeAdapter
from pydantic_core import PydanticUndefined

from spheretwin import scenario as scenarios
from spheretwin.models.base.errors import InputError
from spheretwin.scenario import reading
from spheretwin.scenario.changes import is_fixed, scheduled_changes, with_change
from spheretwin.scenario.fields import every_field, quantity_text
from spheretwin.scenario.hardware import HARDWARE, ORIGINS
from spheretwin.scenario.sections import Scenario
from spheretwin.study import study as studies
from spheretwin.study.axes import AnyAxis
from spheretwin.study.grid import Grid
from spheretwin.study.study import Study
from tests.content.content import content_test, refusal
from tests.content.values import lines, plain

NAMES = [name for name, _ in every_field(Scenario)]


def without_words(schema):
    """Return a JSON schema without titles and descriptions: types, bounds, defaults and choices."""
    if isinstance(schema, list):
        return [without_words(inside) for inside in schema]
    if not isinstance(schema, dict):
        return schema
    return {
        key: without_words(inside)
        for key, inside in schema.items()
        if key not in ("title", "description") or isinstance(inside, dict)
    }


def schema_text(schema):
    """Return the sections of a JSON schema, a line for each field."""
    parts = {**schema.pop("$defs", {}), "": schema}
    return "\n".join(
        f"{part}.{name}: {json.dumps(without_words(field), ensure_ascii=False)}"
        for part, content in parts.items()
        for name, field in (content.get("properties") or {"choices": content}).items()
    )


def fields_of_scenarios():
    """Each field with its default, name in words and extra facts, and whether it may change in a run."""
    listed = {}
    for name, field in every_field(Scenario):
        default = field.get_default(call_default_factory=True, validated_data={})
        listed[name] = {
            "default": "required" if default is PydanticUndefined else str(default)[:200],
            "words": quantity_text(name),
            "fixed": is_fixed(name),
            "extra": str(field.json_schema_extra),
        }
    return lines(listed)


def hardware_sets():
    return lines({"values": {name: dict(HARDWARE[name]) for name in HARDWARE}, "origins": ORIGINS})


def defaults_of_shipped_scenarios():
    """Each shipped scenario with each hardware set, complete."""
    content = {}
    for name in reading.shipped():
        for hardware in HARDWARE:
            scenario = scenarios.load(name, {"hardware": hardware})
            content[f"{name}, {hardware}"] = json.loads(scenario.model_dump_json())
    return lines(content)


def _wrong(field_name, value):
    return refusal(scenarios.load, "hold", {field_name.replace("#", "0"): value})


def messages_about_values():
    """Messages about a text, a number far out of range and a list for each field."""
    return "\n".join(
        f"{name} = {json.dumps(value)}: {_wrong(name, value).removeprefix('scenario hold: ')}"
        for name in NAMES
        for value in ("x", -1e300, [1.0, 2.0])
    )


COIL = {"target": "coil.03", "mode": "open"}
EVENT = {"t_s": 0.1, "set": "disturbance.load", "value": 1.0}

COMBINATIONS = {
    "steps": [
        {"plant.step_s": 0.0003},
        {"controller.period_s": 0.0004, "plant.step_s": 0.0005},
        {"duration": 1e-5},
    ],
    "events": [
        {"event": [{**EVENT, "set": name}]}
        for name in ("duration", "plant.mjcf", "seed", "controller", "nothing", "fault.0")
    ]
    + [
        {"event": [EVENT, {**EVENT, "value": "much"}]}, {"event": [{**EVENT, "t_s": -1}]},
        {"event": [{"t_s": 1}]},
        {"event": [{**EVENT, "t_s": 0.5, "value": 5e9}, {**EVENT, "set": "controller.law", "value": "pdd"}]},
        {"event": {"a": 1}}, {"event": [3]}, {"event.1.t_s": 3},
    ],
    "faults": [
        {"fault": [{**COIL, **more}]}
        for more in (
            {"mode": "gain"}, {"mode": "gain", "value": 9.0}, {"mode": "open", "value": 1.0},
            {"start_s": -1.0}, {"start_s": 1.0, "end_s": 0.5}, {"target": "coil"}, {"target": "coil.x"},
            {"target": "coil.99"},
            {"target": "encoder.alpha", "mode": "stuck", "reported_to_controller": True},
            {"target": "encoder.delta"}, {"target": "pot.beta", "mode": "open"},
            {"target": "supply", "mode": "short"}, {"mode": "bored"}, {"detect": True},
            {"target": "adc.alpha", "mode": "stuck"}, {"target": "dac.02", "mode": "stuck"},
        )
    ]
    + [{"fault": [COIL, COIL]}, {"fault": [COIL, {**COIL, "mode": "short"}]}],
    "laws": [
        {"controller.law": "pd", "controller.integral": 3.0},
        {"controller.law": "afsm", "controller.stiffness": 2.0}, {"controller.law": "nothing.py:Law"},
        {"controller.law": "Law"}, {"controller.law": ["pd"]}, {"controller.preset": "x"},
        {"estimator.kind": "x"}, {"allocation": "x"}, {"hardware": "protoype"},
    ],
    "trajectories": [{"trajectory": {"shape": shape}} for shape in ("table", "waypoints", "steps", "spiral")]
    + [
        {"trajectory": {"shape": "waypoints", "times_s": [0, 1], "angles_rad": [[0, 0, 0]]}},
        {"trajectory": {"shape": "waypoints", "times_s": [1, 0], "angles_rad": [[0, 0, 0], [0.1, 0, 0]]}},
        {"trajectory.approach": "x"},
        {"trajectory.shape": "hold", "trajectory.frequency_Hz": 1.0},
    ],
    "disturbances": [
        {"disturbance.terms": [term]}
        for term in (
            {"kind": "x"}, {}, {"kind": "steps", "times_s": [1.0], "torques_Nm": []}, {"kind": "table"},
            {"kind": "steps", "times_s": [1.0, 0.5], "torques_Nm": [[0, 0, 0], [0, 0, 1]]},
            {"kind": "sinusoidal", "frequency_Hz": -1.0}, {"kind": "constant", "torque_Nm": [1, 2]},
            {"kind": "random", "bound_Nm": -1},
        )
    ],
    "names": [
        {"controler.law": "pd"}, {"law": "pd"}, {"plant.x.y": 1}, {"seed.deep": 1}, {"fault.0.known": True},
        {"load": 1}, {"a..b": 1},
    ],
}  # fmt: skip


def messages_about_combinations():
    return "\n".join(
        f"{group}: {json.dumps(overrides)}: {refusal(scenarios.load, 'nutation', overrides)}"
        for group, listed in COMBINATIONS.items()
        for overrides in listed
    )


def messages_about_changes():
    """Messages about changes during a run, and the fields that follow an accepted one."""
    scenario = scenarios.load("nutation")
    names = (
        "controller.law estimator.kind trajectory.shape plant.engine duration fault nominal.equals_truth"
        " allocation event a..b seed drive.current_limit_A disturbance.terms controller trajectory"
    )
    return "\n".join(
        f"{name} = {json.dumps(value)}: {refusal(with_change, scenario, name, value)}"
        for name in names.split()
        for value in ("pid", "hold", "x", 2.0, None, [], {"shape": "hold"}, COIL, True)
    )


def results_of_changes():
    """What differs in the fields of a scenario after a change."""
    content = {}
    base = scenarios.load("sinusoid", {"controller.law": "pid", "hardware": "electronics", "fault": [COIL]})
    changes = [
        ("controller.law", "afsm"), ("controller.law", "pd"), ("trajectory.shape", "hold"),
        ("fault", {"target": "coil.05", "mode": "open"}), ("fault", []), ("estimator.kind", "kalman"),
        ("disturbance.load", 2.0), ("nominal.equals_truth", True), ("nominal.modelling_error", 0.1),
        ("fault.0.mode", "short"), ("disturbance.terms", [{"kind": "constant"}]),
        ("trajectory", {"shape": "hold", "angle_rad": [0.1, 0, 0]}),
    ]  # fmt: skip
    before = dict(_flat(json.loads(base.model_dump_json())))
    for name, value in changes:
        try:
            after = dict(_flat(json.loads(with_change(base, name, value).model_dump_json())))
        except InputError as error:
            content[f"{name} = {value}"] = str(error)
            continue
        content[f"{name} = {value}"] = {
            key: f"{before.get(key, 'absent')} -> {after.get(key, 'absent')}"
            for key in {**before, **after}
            if before.get(key, "absent") != after.get(key, "absent")
        }
    return lines(content)


def _flat(value, prefix=""):
    if isinstance(value, dict):
        for key, inside in value.items():
            yield from _flat(inside, f"{prefix}{key}.")
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for place, inside in enumerate(value):
            yield from _flat(inside, f"{prefix}{place}.")
    else:
        yield prefix.rstrip("."), value


def schedules():
    """Changes of events and faults, in the order in which they act."""
    events = [
        {"t_s": 0.0305, "set": "disturbance.load", "value": 1.0},
        {"t_s": 0.01, "set": "fault", "value": COIL},
        {"t_s": 0.01, "set": "controller.law", "value": "pd"},
        {"t_s": 0.0300000001, "set": "seed_", "value": 1},
        {"t_s": 0.02, "set": "fault", "value": {**COIL, "start_s": 0.5}},
    ]
    scenario = scenarios.load("hold", {"event": [event for event in events if event["set"] != "seed_"]})
    return lines({"changes": plain(scheduled_changes(scenario))})


FLAGS = [
    ["--duration", "2"], ["--duration=2"], ["--duration"], ["x"], ["--plant.initial-rad", "0", "0.1", "-0.2"],
    ["--name", "12"], ["--seed", "true"], ["--seed", "null"], ["--plant.mjcf", "7"],
    ["--event.0.t-s", "1", "--event.0.set", "duration"], ["--seed", "1e3"], ["--duration", "1e999"],
    ["--duration", "inf"], ["--duration", "nan"], ["--a", "[1, 2]"], ["--a", '{"b": 1}'],
    ["--controller.law", "pd", "--controller.law", "pid"], ["--duration="], ["--a", "-1"],
    ["--a", "1", "b", "false"],
]  # fmt: skip


def flags():
    content = []
    for tokens in FLAGS:
        try:
            content.append(f"{tokens}: {reading.overrides(tokens)!r}")
        except InputError as error:
            content.append(f"{tokens}: {error}")
    return "\n".join(content)


STUDY = {"name": "a", "scenario": "hold"}
AXIS = {"field": "duration", "kind": "values", "values": [1.0, 2.0]}
MANY = {"field": "duration", "kind": "linspace", "first": 1, "last": 2, "count": 100000}
GAIN = {"field": "controller.stiffness", "low": 1.0, "high": 2.0}
OBJECTIVE = {"metric": "rms_torque_Nm"}

STUDIES = (
    [
        {"scenario": "x"}, {"name": ""}, {"name": "a/b"}, {"seeds": 0}, {"samples": 3}, {"metrics": ["x"]},
        {"metrics": []}, {"law": [{}]}, {"law": [{"law": "x"}]}, {"law": [{"law": "pd"}, {"law": "pd"}]},
        {"fields": {"x": 1}}, {"fields": {"duration": -1}}, {"axis": [AXIS, AXIS]},
        {"axis": [{**AXIS, "field": "x"}]}, {"axis": [{**AXIS, "values": []}]},
        {"axis": [{**AXIS, "values": [1.0, 1.0]}]},
        {"axis": [{**AXIS, "zip": "a"}, {"field": "seed", "kind": "values", "values": [1], "zip": "a"}]},
        {"axis": [{**AXIS, "kind": "uniform"}]},
        {"axis": [{"field": "duration", "kind": "uniform", "low": 2, "high": 1}]},
        {"axis": [{"field": "duration", "kind": "uniform", "low": 1.0, "high": 2.0}]},
        {"axis": [{"field": "duration", "kind": "linspace", "first": 0, "last": 1, "count": 0}]},
        {"axis": [{"field": "duration", "kind": "logspace", "first": 0, "last": 1, "count": 3}]},
        {"axis": [{"field": "duration", "kind": "linspace", "first": 1, "last": 2, "count": 1000000}] * 2},
        {"axis": [{**MANY, "field": name} for name in ("duration", "disturbance.load")]},
        {"axis": [{**AXIS, "field": "seed"}]},
        {"axis": [{**AXIS, "field": "controller.law", "values": ["pd", "pid"]}]},
        {"axis": [{**AXIS, "field": "name", "values": ["x", "y"]}]},
        {"axis": [{**AXIS, "field": "event.0.t_s"}]}, {"design": "x"}, {"samples": 0}, {"seed": -1},
        {"common_seeds": 1}, {"x": 1}, {"optimise": {"gain": [], "objective": [OBJECTIVE]}},
        {"optimise": {"gain": [GAIN], "objective": [OBJECTIVE] * 3}},
        {"optimise": {"gain": [GAIN], "objective": []}},
        {"optimise": {"gain": [GAIN, GAIN], "objective": [OBJECTIVE]}},
    ]
    + [
        {"optimise": {"gain": [{**GAIN, **more}], "objective": [OBJECTIVE]}}
        for more in (
            {"low": 2.0}, {"low": 3.0}, {"low": 0.0, "log": True}, {"start": 0.5}, {"start": 2.0},
            {"start": 2.5}, {"sets": [{"field": "x"}]}, {"field": "", "sets": [{"field": "x"}]},
            {"field": ""}, {"field": "nothing"}, {"law": "x"}, {"name": "n" * 101}, {"reason": "r" * 201},
            {
                "field": "",
                "name": "n",
                "sets": [{"field": "controller.stiffness", "power": 2.0}],
                "low": -1.0,
            },
        )
    ]
    + [
        {"optimise": {"gain": [GAIN], "objective": [{**OBJECTIVE, **more}]}}
        for more in (
            {"metric": "x"}, {"of": ["alpha"]}, {"metric": "rms_error_rad", "of": ["alpha", "alpha"]},
            {"over": "x"}, {"limits": [2.0, 1.0]}, {"limits": [0.0]},
            {"direction": "maximise", "over": "geometric_mean"}, {"direction": "maximise", "limits": [1.0]},
            {"limits": [1.0]}, {"metric": "rms_error_rad", "of": ["delta"]},
        )
    ]
    + [
        {"optimise": {"gain": [GAIN], "objective": [OBJECTIVE, {**OBJECTIVE, "over": "median"}], **more}}
        for more in (
            {}, {"sampler": "local"}, {"sampler": "x"}, {"trials": 0}, {"trials": 100001}, {"fresh": -1},
            {"fresh": 1001}, {"together": 0}, {"draws": 0}, {"perturbations": 0}, {"prune": 1},
        )
    ]
)  # fmt: skip


def made_rows(fields):
    return Grid(studies.made({**STUDY, **fields}, "mine"))


def messages_about_studies():
    return "\n".join(f"{json.dumps(fields)}: {refusal(made_rows, fields)}" for fields in STUDIES)


def schemas():
    return "\n".join(schema_text(TypeAdapter(kind).json_schema()) for kind in (Study, AnyAxis))


CASES = {
    "scenario_fields": fields_of_scenarios,
    "scenario_schema": lambda: schema_text(Scenario.model_json_schema()), "scenario_hardware": hardware_sets,
    "scenario_shipped": defaults_of_shipped_scenarios, "scenario_messages": messages_about_values,
    "scenario_combinations": messages_about_combinations, "scenario_changes": messages_about_changes,
    "scenario_changed_fields": results_of_changes, "scenario_schedule": schedules, "scenario_flags": flags,
    "study_messages": messages_about_studies, "study_schema": schemas,
}  # fmt: skip


test_content = content_test(CASES)
