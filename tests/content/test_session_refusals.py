"""Messages about invalid plants, model files, sessions, changes during a run, environments and machines."""

import re

import numpy as np

from spheretwin import plant
from spheretwin import scenario as scenarios
from spheretwin.bench import Bench
from spheretwin.control.laws.lqi import regulator
from spheretwin.envs import TwinVectorEnv
from spheretwin.loop.external import Measurement
from spheretwin.loop.inputs import InputGenerator
from spheretwin.machine import IdentifySettings, Log, identify, shadow
from spheretwin.machine.link.controller_scenario import check_measurement
from spheretwin.machine.link.transports import open_transport
from spheretwin.metrics import MaxAbsCurrent
from spheretwin.metrics.reduction import PlannedRun
from spheretwin.models.actuator import load as load_actuator
from spheretwin.models.magnetics import Arrangement
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table
from spheretwin.plant.plant_step import roll_out
from spheretwin.session import Session
from tests.content.content import content_test, refusal, scratch
from tests.content.test_refusals import listed
from tests.control.test_manual_currents import series_file
from tests.control.test_user_law import FILE
from tests.models.model_files import edited
from tests.twin.model_files import model_file
from tests.twin.plant import user_models
from tests.twin.plant.motions import friction
from tests.twin.session_cases import ENGINES, REFUSED, session

ZEROS, NAN = np.zeros, [0.0, np.nan, 0.0]


def with_entry(size, value):
    return [*np.ones(size - 1), value]


VECTORS = {"q": 3, "qdot": 3, "currents": 18, "disturbance": 3}
ARRAYS = ["inertia_kg_m2", "coulomb_Nm", "viscous_Nm_s", "constant_torque_Nm", "spring_Nm_rad"]
STEPS = [
    *((name, [0.0] * (size + more)) for name, size in VECTORS.items() for more in (-1, 1)),
    *((name, with_entry(size, value)) for name, size in VECTORS.items()
      for value in (np.nan, np.inf, -np.inf)),
    *(("dt", value) for value in (np.nan, np.inf, 0.0, -1e-3, 1.5)),
    *((name, values) for name in ARRAYS for values in ([1.0] * 2, [1.0] * 4, with_entry(3, np.nan))),
    *(("torque_gain", values) for values in ([], [1.0] * 17, [1.0] * 19, with_entry(18, np.inf))),
    ("inertia_kg_m2", [1e-3, 0.0, 1e-3]), ("weight_moment_Nm", np.nan), ("friction_smoothing_rad_s", 0.0),
]  # fmt: skip
ROLLS = [((2, 17), 1, (2, 3)), ((2, 18), -1, (2, 3)), ((2, 18), 1, (1, 3)), ((2, 18), 1, (2, 2))]
STATES = [
    (ZEROS(2), ZEROS(3), slice(None)), (ZEROS((2, 3)), ZEROS(3), slice(None)), (NAN, ZEROS(3), slice(None)),
    (ZEROS(3), NAN, 1), (ZEROS((2, 3)), ZEROS(3), 1), (ZEROS((3, 3)), ZEROS(3), [0, 2]),
]  # fmt: skip
NONE = [0.0] * 3
FRICTIONS = [
    ([0, -1e-3, 0], NONE, 1e-3), (NONE, NAN, 1e-3), (NONE, [1e-3], 1e-3), (NONE, NONE, 0.0),
    (NONE, NONE, np.inf),
]  # fmt: skip


def invalid_plants():
    """Single steps, sequences, many plants at once, and parameters; the plants stay as they were."""
    good = {"q": ZEROS(3), "qdot": ZEROS(3), "currents": ZEROS(18), "disturbance": ZEROS(3), "dt": 5e-4}
    parameters = plant.parameters("nutation")
    rows = Arrangement.zeros(**parameters.magnetics.sizes | {"groups": 12})
    fewer = parameters.magnetics._replace(arrangement=rows)
    fewer = parameters._replace(magnetics=fewer, torque_gain=parameters.torque_gain[:12])

    def step(change):
        name, value = change
        value = np.array(value) if isinstance(value, list) else value
        changed = good | {name: value}
        own = parameters if name in good else parameters._replace(**{name: value})
        state = plant.State(changed["q"], changed["qdot"])
        return plant.step(state, changed["currents"], changed["disturbance"], own, changed["dt"])

    def roll(sizes):
        currents, steps, q = sizes
        state = plant.State(ZEROS(3), ZEROS(3))
        return roll_out(state, ZEROS(currents), ZEROS(3), parameters, 5e-4, steps, ZEROS(q))

    many = plant.Plants([parameters] * 3)
    many.set_state([0.1, 0.0, 0.0], [1.0, 0.0, 0.0])
    calls = {
        **{f"dt, steps {dt}, {n}": lambda dt=dt, n=n: many.step(ZEROS(18), ZEROS(3), dt, n)
           for dt, n in ((np.nan, 1), (0.0, 1), (2.0, 1), (5e-4, -1), (5e-4, 1.5))},
        "torque of no step": lambda: many.step_torque(ZEROS(3), 0.0, 1),
        "torque": lambda: many.step_torque(ZEROS((4, 3)), 5e-4),
        "sequence": lambda: many.roll_out(ZEROS((1, 3, 18)), ZEROS(3), 5e-4, -1),
        "disturbance": lambda: many.step(ZEROS(18), NAN, 5e-4),
        "inertia": lambda: plant.Plants(parameters._replace(inertia_kg_m2=np.ones(1))),
        "none": lambda: plant.Plants(parameters, 0),
        "a count": lambda: plant.Plants([parameters] * 2, 2),
        "groups": lambda: plant.Plants([parameters, fewer]),
        "changes of a loaded one": lambda: plant.parameters(scenarios.load("tilt"), {"plant.payload_kg": 1}),
        **{str(changes): lambda changes=changes: plant.parameters("tilt", changes) for changes in (
            {"plant.stiction.on": True}, {"plant.cable.hysteresis_Nm": [1e-3] * 3}, {"plant.payload": 1.0},
        )},
    }  # fmt: skip
    return "\n".join(
        [
            listed(step, STEPS),
            listed(lambda q: plant.torque_matrix(np.array(q), parameters), [[0.0] * 2, [0.0] * 4, NAN]),
            listed(roll, ROLLS),
            *(f"{place}: {refusal(many.set_state, *state)}" for place, state in enumerate(STATES)),
            *(f"{name}: {refusal(call)}" for name, call in calls.items()),
            f"state: {many.q_rad.tolist()}, {many.qdot_rad_s.tolist()}",
            listed(lambda given: friction(*given, 5e-4), FRICTIONS),
            listed(lambda given: regulator(*given), [(0.0, 0.0, 1e9, 1.0), (3e7, 6e-4, 6e-9, 1e-3)]),
        ]
    )


COUPLED = {"hardware": "prototype", "plant.engine": "lagrangian", "drive.coil_coupling": 1.0}
SCENARIOS = [
    {"plant.mass.products_kg_m2": [5e-3, 0.0, 0.0]},
    {"plant.mass.ring_inertia_kg_m2": [[3e-4, 1e-4, 1e-4], [0.0] * 3]},
    {"plant.mass.axis_tilt_error_rad": 0.1},
    {"plant.mass.axis_offset_m": [[1e-2, 0.0], [0.0] * 2, [0.0] * 2]},
    {**COUPLED, "hardware": "ideal"}, {**COUPLED, "drive.inductance_H": 1e-5},
    {**COUPLED, "drive.inductance_H": [9e-4] * 17 + [1e-6]},
    {"manual.currents_A": [0.0, 1.0]}, {"manual.currents_A": [np.nan] * 18},
    {"controller.law": "afsm_eso", "controller.preset": "slow"},
    {"trajectory": {"shape": "multisine", "components": [{"frequency": 1.0}]}},
    *({"trajectory": {"shape": "steps", **steps}} for steps in (
        {"times_s": [1.0, 2.0]}, {"times_s": [1.0, 1.0], "angles_rad": [NONE, NONE]}, {"times_s": [np.nan]},
    )),
    {"trajectory": {"shape": "tilt", "rounding_rad_s2": 0.01}},
    {"drive.resistance_ohm": [1.3] * 17}, {"nominal.inductance_H": []}, {"drive.inductance_H": [9e-4, "x"]},
    {"drive.shutdown_degC": "hot"},
]  # fmt: skip
NUMBERS_OF_MODELS = [
    {"group_resistance_ohm": [1.3] * 17}, {"group_inductance_H": [9e-4] * 17 + [-1.0]},
    {"group_heat_capacity_J_K": 0.0}, {"group_heat_capacity": 60.0}, {"stator_capacity_J_K": 900.0},
    {"coil_turns": [320.0] * 18}, {"stator_heat_capacity_J_K": -1.0},
]  # fmt: skip
SOURCES = {
    "Feedbak": FILE, "number": FILE, "mine": "import nothing_of_that_name", "two": "1 +", "three": None,
    "Feedback": FILE,
    "Broken": f"{FILE}\nclass Broken(LawParameters):\n    def build(self, known):\n        return 1 / 0",
    "Lazy": f"{FILE}\nclass Lazy(LawParameters):\n    pass",
    "governor": FILE.replace("damping:", "governor:"),
}  # fmt: skip
OF_LAW = [{"stiffness": (1.0, -2.0, 3.0)}, {"stifness": 3.0}]


def invalid_sessions():
    """What no session begins with, a scenario's event sets, or is set during a run, for each engine."""
    folder = scratch("sessions")

    def begin(changes, law=None):
        Session(scenarios.load("hold", changes), law).close()

    def of_file(name, fields=()):
        path = folder / f"{name}.py"
        if SOURCES[name] is not None:
            path.write_text(SOURCES[name])
        given = {f"controller.{field}": value for field, value in dict(fields).items()}
        begin({"controller.law": f"{path}:{'Feedback' if name == 'governor' else name}", **given})

    def of_model(name):
        path = edited(folder, *user_models.REFUSED[name], name="model.xml")
        begin({"plant.mjcf": str(path)})

    lines = [listed(begin, SCENARIOS), listed(of_file, list(SOURCES)), listed(of_model, user_models.REFUSED)]
    lines += [refusal(of_file, "Feedback", fields) for fields in OF_LAW]
    for groups, more in ((17, {}), (0, {}), (18, {"manual.currents_A": [0.0] * 18})):
        file = {"manual.file": series_file(folder, [0.0], [[0.1] * groups], groups)}
        lines.append(f"file of {groups}: {refusal(begin, file | more)}")
    lines.append(refusal(Bench, scenarios.load("hold", {**file, "manual.currents_A": None})))
    lines.append(
        listed(lambda numbers: begin({"plant.mjcf": model_file(folder, **numbers)}), NUMBERS_OF_MODELS)
    )
    growing = [{"kind": "random", "bound_Nm": [0.01] * 3, "gamma_envelope": "growing"}]
    inputs = InputGenerator(scenarios.load("sinusoid", {"disturbance.terms": growing}))
    lines.append(listed(inputs.check_horizon, [200_000, 240_000]))
    events = [{"t_s": 0.1, "set": name, "value": value} for name, value in (
        ("plant.group_gain", [1.0, 2.0]), ("nominal.torque_curve", "/nowhere/curve.csv"),
        ("controller.law", f"{folder}/Broken.py:Broken"), ("controller.law", f"{folder}/Lazy.py:Lazy"),
    )]  # fmt: skip
    lines.append(listed(begin, [{"event": [event]} for event in events]))
    lines += [refusal(Session, *given) for given in (
        ("nutation",), (None,), (scenarios.load("hold"), "mine.py:Mine"), (scenarios.load("hold"), 3.0),
    )]  # fmt: skip
    lines.append(refusal(InputGenerator, scenarios.load("hold"), 3.0))
    lines.append(refusal(Session, scenarios.load("hold"), external=3))
    metric = MaxAbsCurrent(PlannedRun(scenarios.load("hold"), load_actuator(), 10))
    for signal in (Signal("error_rad", "rad", 3, "errors"), Signal("current_A", "A", 3, "currents")):
        lines.append(refusal(metric.write, Table((signal,), ZEROS((10, 3)))))
    for engine in ENGINES:
        with session(**{"plant.engine": engine}) as live:
            lines += [engine, listed(lambda change, live=live: live.set(*change), REFUSED)]
    text = re.sub("line \\d{2,}", "line N", "\n".join(lines))
    return re.sub(r"\S+/x{9,}…x*", "x…x", text)  # as many as fit beside the path of one of two folders


ENVIRONMENTS = [
    {"task": "Jump"}, {"num_envs": 0}, {"torque_limit": 1.0}, {"episode_s": -1.0},
    {"changes": {"hardware": "electronics"}}, {"changes": {"plant.payload": 1.0}},
    {"changes": {"plant.mass.axis_tilt_rad": [[0.02, 0.0], [0.0, 0.0], [0.0, 0.0]]}},
    {"axes": ({"kind": "values", "field": "plant.payload_kg", "values": [0.1]},)},
]  # fmt: skip
CALLS = [
    ("step", {"actions": ZEROS((2, 4))}), ("step", {"actions": np.full((2, 3), np.nan)}),
    ("reset", {"seed": [1]}), ("reset", {"options": {"mask": 1}}),
    ("reset", {"options": {"reset_mask": np.ones(3, bool)}}),
]  # fmt: skip
IDENTIFIED = [
    (["plant.coulomb"], {}), ([], {}),
    *((["torque_scale"], {"window_s": window_s}) for window_s in (0.005, 1, 5)),
]  # fmt: skip
ADDRESSES = [
    "", "udp", "udp://", "udp://host", "udp://:x", "udp://:99999", "tcp://:5", "serial:", "udp://:5/path",
    "serial:/dev/x@fast", "udp://:0", "--", "serial:/dev/no-such-line@9600", "serial:/dev/null",
]  # fmt: skip


def invalid_machines():
    """Messages about environments, logs that do not fit, addresses, and what a machine does not measure."""
    env = TwinVectorEnv(2, "Hold", variants=1)
    env.reset()
    T_s = 1e-3 * np.arange(1600)

    def log(groups=18, times=T_s):
        return Log(times, ZEROS((len(T_s), groups)), ZEROS((len(T_s), 3)), name="log")

    def identified(given):
        return identify(log(), "sinusoid", given[0], {}, IdentifySettings(**given[1]))

    lines = [
        listed(lambda settings: TwinVectorEnv(**{"variants": 1, **settings}), ENVIRONMENTS),
        *(f"{name}: {refusal(getattr(env, name), **given)}" for name, given in CALLS),
        listed(identified, IDENTIFIED),
        *(refusal(shadow, log(*given), "sinusoid") for given in ((17,), (18, -T_s), (18, 0.0 * T_s))),
        listed(lambda address: open_transport(address, listening=False), ADDRESSES),
        # TEST-NET-1 of RFC 5737: no machine has it.
        refusal(open_transport, "udp://192.0.2.1:5005", listening=True),
    ]  # fmt: skip
    for changes, *rest in (({}, None, ZEROS(18)), ({"detector.detect": True}, ZEROS(3), None)):
        with Session(scenarios.load("sinusoid", changes)) as live:
            lines.append(refusal(check_measurement, live.initial_scenario, Measurement(ZEROS(3), *rest)))
    return "\n".join(lines)


CASES = {
    "refused_plants": invalid_plants, "refused_sessions": invalid_sessions,
    "refused_machines": invalid_machines,
}  # fmt: skip


test_content = content_test(CASES)
