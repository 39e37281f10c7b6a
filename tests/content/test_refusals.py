"""Messages about invalid models, curves, fields, laws, trajectories, logs and linear models."""

import contextlib
import re
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
from scipy import signal

from spheretwin import scenario as scenarios
from spheretwin.analysis import tolerances
from spheretwin.control.law import Law
from spheretwin.io_systems import LoopSystem
from spheretwin.linear import linearise
from spheretwin.machine import Log
from spheretwin.machine import columns as column_maps
from spheretwin.machine.link import frame_format
from spheretwin.machine.raw_table import RawTable
from spheretwin.models import actuator as actuators
from spheretwin.models import torque_curve, torque_field
from spheretwin.models.base.errors import shown
from spheretwin.models.telemetry.signals import Signal, common_signals
from spheretwin.scenario.sections import MOST_FAULTS
from spheretwin.trajectories.disturbances import TableDisturbance
from spheretwin.trajectories.trajectory import checked
from spheretwin.trajectories.waypoints import Waypoints
from tests.content.content import content_test, refusal, scratch
from tests.models.model_files import edited
from tests.models.poses import SECOND
from tests.twin.disturbance_cases import TORQUES


def listed(call, inputs):
    """Return a line for each input of a call: what it was, and the message."""
    return "\n".join(f"{shown(given)}: {refusal(call, given)}" for given in inputs)


def of_texts(read, suffix, texts):
    """Return the messages about files of some texts."""
    path = scratch("refusals") / f"mine{suffix}"

    def read_text(text):
        path.write_bytes(text.encode())
        return read(path)

    return listed(read_text, texts)


GAMMA = '<joint name="gamma" axis="0 0 1"/>'
FRONT = '<numeric name="pole_front_radius_m" data="{}"/>'
MIDDLE = 'name="coil_middle" class="coil" pos="0.063'
INERTIA = 'diaginertia="2.219e-3 2.176e-3 2.256e-3"'
MASS = '<inertial pos="0 0 {}" mass="1.6"'

ACTUATORS = [
    ('axis="0 1 0"', 'axis="0 0 1"'), (GAMMA, GAMMA.replace("/>", ' type="slide"/>')), (GAMMA, ""),
    ('range="-80 80"', 'range="-170 170"'), ('range="-80 80"', 'range="-80 90"'),
    *(('data="8"', f'data="{value}"') for value in ("inf", "-8", "1000000001")),
    *(('data="1.3"', f'data="{value}"') for value in ("1e-300", "1e-8")),
    *(('data="0.9e-3"', f'data="{value}"') for value in ("1300.0000013", "0")),
    ('data="1.2"', 'data="1e300"'), ('data="320"', 'data="1e-300"'),
    *(('size="0.010 0.005"', f'size="{size}"') for size in ("1e-300 0.005", "0.010 1e-12", "0.010 0.0004")),
    *((FRONT.format("0.05"), FRONT.format(radius)) for radius in ("0.009", "-0.05", "nan")),
    *(('size="0.011 0.0125"', f'size="{size}"') for size in ("1e6 0.0125", "0.011 1e300")),
    ('pos="0.045 0 0"', 'pos="0 0 0"'), ('pos="0.063 0 0"', 'pos="1e300 0 0"'), (MIDDLE, f"{MIDDLE}00001"),
    (INERTIA, 'diaginertia="1e300 1e300 1e300"'), ('"coil_turns" data="320"', '"coil_windings" data="320"'),
    ('data="0.003"', 'data="0.012"'), *(('user="-1"', f'user="{user}"') for user in ("2", "-1.00000001")),
    ('name="shaft_tip"', 'name="tip"'), ('pos="0 0 0.12"', 'pos="0 0 nan"'),
    (MASS.format(0), MASS.format("1e300")), ('<frame euler="0 28 0">', '<frame euler="0 29 0">'),
]  # fmt: skip


def invalid_actuators():
    """The shipped actuator with a part of its text replaced, and groups of the one with a field."""
    folder = scratch("actuators")
    text = SECOND.read_text().replace("torque_field.csv", str(SECOND.with_name("torque_field.csv")))

    def second(edit):
        assert text.count(edit[0]) >= 1
        (path := folder / "second.xml").write_text(text.replace(*edit, 1))
        return actuators.load(path)

    groups = [('user="-4"', f'user="{group}"') for group in ("4.5", "0", "3", "900")]
    of_shipped = listed(lambda edit: actuators.load(edited(folder, edit)), ACTUATORS)
    return "\n".join([of_shipped, listed(second, [*groups, ("torque_field.csv", "elsewhere.csv")])])


HEADER = "phi_deg,torque_Nm_per_A"
ROWS = [f"{phi},0.001" for phi in range(0, 181, 20)]
FLAT = [f"{phi},0" for phi in range(0, 181, 20)]
BUMP = ["0,0", *ROWS[1:-1], "180,0"]
COMPUTED_FOR = "# Computed for coil turns:"

CURVES = [
    ["phi_deg,torque", *ROWS], [], [HEADER, "0,0", "40,0", "20,0", *ROWS[3:]],
    [HEADER, *ROWS[:-1], "180,nan"], [HEADER, *ROWS[:5], "90,north", *ROWS[5:]],
    [HEADER, *ROWS[:5], "90", *ROWS[5:]], [HEADER, "0,0", "90,0.01", "180,0"], [HEADER],
    [HEADER, *ROWS[1:]], [HEADER, *ROWS[:-1]], [HEADER, "-20,0", *ROWS], [HEADER, "0,0", "400,0", *ROWS[1:]],
    [HEADER, *ROWS], [HEADER, *FLAT], [HEADER.replace(",", ";"), *ROWS],
    [HEADER, *ROWS[:4], '"80,0.001'], [HEADER, *ROWS[:4], "80,0.001,7", *ROWS[5:]],
    [HEADER + ",phi_deg", *(f"{row},1" for row in ROWS)],
    [HEADER, "0,0", "20,1e308", "40,-1e308", *ROWS[3:-1], "180,0"],
    [HEADER, "0,0", "20,0.1", "20.0000000000001,0.1", *ROWS[2:]], [HEADER, *ROWS[:-1], "180.00000001,0"],
    *([COMPUTED_FOR + value, HEADER, *BUMP] for value in (" many", " nan", "")),
]  # fmt: skip

HEAD = "theta_deg,phi_deg,x_Nm_per_A,y_Nm_per_A,z_Nm_per_A"
FIELD = [f"{t},{p},{0.01 * (t % 180 != 0)},0,0.01" for t in range(0, 181, 30) for p in range(0, 360, 45)]

FIELDS = [
    [HEAD.replace("z_Nm", "z_mNm"), *FIELD], [HEAD], [HEAD, *FIELD[:16]],
    [HEAD, *(row for row in FIELD if ",315," not in row)], [HEAD, *FIELD[:-1]],
    [HEAD, *FIELD[:-1], "180,314,0,0,0.01"], [HEAD, *(row.replace("30,", "31,") for row in FIELD)],
    [HEAD, *FIELD, FIELD[-1]], *([HEAD, *FIELD[:-1], f"180,315,0,0{end}"] for end in (",nan", ",north", "")),
    [HEAD, *FIELD[:-1], "180,315,0,0,0.02"],
    [HEAD, *(re.sub(",0.01,0,0.01|,0.0,0,0.01", ",0,0,0", row) for row in FIELD)],
    [HEAD, *(row.replace("0.01", "1e9") for row in FIELD)],
]  # fmt: skip


def invalid_tables():
    curves, fields = (["\n".join(lines) for lines in each] for each in (CURVES, FIELDS))
    return of_texts(torque_curve.read, ".csv", curves) + of_texts(torque_field.read, ".csv", fields)


def step(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0


NUMBERS = [
    [1.0 + 2.0j], ["1.5"], "1.5", None, [Fraction(1, 2)], [10**5000],
    np.array(["2020-01-01"], dtype="datetime64[D]"), [[1.0], [1.0, 2.0]], 1.0, np.zeros((2, 2)),
    [0.0, np.nan], [-np.inf], np.array(["1e4000"], dtype=np.longdouble),
]  # fmt: skip

LAWS = [
    *({field: numbers} for field in ("parameters", "state") for numbers in NUMBERS),
    *({"name": name} for name in ("", 3, "a\nb", "\x1b[2J", "a\udcff")), {"step": None}, {"step": "pd"},
    {"signals": "gain"}, {"signals": 3}, {"signals": [Signal("gain", "1", 4, "")]},
    {"signals": [Signal("gain", "1", 10**5000, "")]}, {"signals": [Signal("b", "1", 1, "")] * 2},
    *({"signals": [Signal(each.name, "1", 1, "")]} for each in common_signals(18)),
    *({"period_s": period_s} for period_s in (0.0, -1e-3, np.nan, np.inf, "1e-3")),
    *({"current_limit_A": limit_A} for limit_A in (0.0, -2.0, np.nan, "2", None)),
]  # fmt: skip


def made_law(changes):
    return Law(**{"name": "mine", "step": step, "parameters": [1.0], "state": np.zeros(3), **changes})


dT = 1e-3


def like(**changes):
    """Return what has the matrices of a system, some of them changed."""
    usual = {"A": [[0.5]], "B": [[1.0, 0, 0]], "C": [[1.0], [0], [0]], "D": np.zeros((3, 3)), "dt": dT}
    return SimpleNamespace(**{**usual, **changes})


def gain(matrix):
    return like(A=np.zeros((0, 0)), B=np.zeros((0, matrix.shape[1])), C=np.zeros((len(matrix), 0)), D=matrix)


SYSTEMS = [
    signal.StateSpace([[-1.0]], [[1.0]], [[1.0]], [[0.0]]), signal.TransferFunction([1.0], [1.0, 1.0]),
    signal.dlti([1.0], [1.0, 0.5]), *(like(dt=dt) for dt in (0, np.nan, -1e-3)),
    signal.TransferFunction([1.0, 2.0, 3.0], [1.0, 0.5], dt=dT),
    signal.ZerosPolesGain([0.1, 0.2], [0.5], 1.0, dt=dT),
    SimpleNamespace(num=[[[1.0]]], den=[[[0.0]]], dt=dT), like(A=[[np.nan]]),
    like(D=np.full((3, 3), np.inf)), like(B=[[1j, 0, 0]]), like(C=[["1"], ["0"], ["0"]]),
    like(A=[[1.0], [1.0, 2.0]]), like(B=[[1.0, 0]]), like(C=[[1.0, 0, 0]]), like(A=np.zeros((1, 2))),
    SimpleNamespace(num=[[[np.inf]]], den=[[[1.0]]], dt=dT),
    *(gain(np.zeros(shape)) for shape in ((2, 3), (3, 1), (3, 9), (1, 3))), np.eye(3), SimpleNamespace(dt=dT),
]  # fmt: skip


LEAD = signal.TransferFunction([20.0, -19.0], [1.0, -0.6], dt=dT)
NUMBERS_OF_LTI = [
    {"inertia_kg_m2": [1.0, 2.0]}, {"constant_torque_Nm": "much"}, {"constant_torque_Nm": [0.0, np.inf, 0.0]},
]  # fmt: skip


def invalid_laws():
    systems = [f"{place}: {refusal(Law.from_lti, system)}" for place, system in enumerate(SYSTEMS)]
    numbers = listed(lambda given: Law.from_lti(LEAD, **given), NUMBERS_OF_LTI)
    return "\n".join([listed(made_law, LAWS), *systems, numbers])


class Own:
    """Trajectory of a user."""

    def __init__(self, sample):
        self.sample = sample

    def __repr__(self):
        return "Own"


def failing(t):
    return 1 / 0


SAMPLES = [
    None, Own, Own(1.0), Own(failing), Own(lambda t: np.zeros((len(t), 3))),
    Own(lambda t: np.zeros((3, 3, 3))), Own(lambda t: np.zeros((len(t), 3, 3), np.float32)),
    Own(lambda t: [[[0.0] * 3] * 3]), Own(lambda t: [[0.0], [0.0, 1.0]]),
    Own(lambda t: np.full((len(t), 3, 3), np.nan)), Own(lambda t: np.full((len(t), 3, 3), np.inf)),
]  # fmt: skip
POSES = "t_s,alpha_rad,beta_rad,gamma_rad\n0,0,0,0\n"
WAYPOINTS = [
    POSES, POSES + "1,0,nan,0\n", f"# bench\n{POSES}0,1,0,0\n", POSES.replace("_rad", "") + "1,0,0,0\n",
]  # fmt: skip


def invalid_trajectories():
    own = "\n".join(f"{place}: {refusal(checked, sample)}" for place, sample in enumerate(SAMPLES))
    waypoints = of_texts(lambda path: Waypoints(file=str(path)), ".csv", WAYPOINTS)
    torques = of_texts(
        lambda path: TableDisturbance(file=str(path)), ".csv", [TORQUES.replace("0.3", "2000")]
    )
    return "\n".join([own, waypoints, torques])


ANGLES, CURRENTS = {"columns": ["a", "b", "c"]}, {"columns": ["i*"]}
COLUMNS = [
    *({"angles": {**ANGLES, **more}} for more in (
        {"columns": ["a", "b"]}, {"unit": "grad"}, {"sign": [1, 0, 1]}, {"sign": [1, 1]}, {"scale": [0.0]},
        {"wrap": [-1.0]}, {"factor": [1.0]}, {"columns": ["a", "b", "d"]},
    )),
    *({"currents": {**CURRENTS, **more}} for more in (
        {"columns": []}, {"kind": "voltage"}, {"scale": [1.0, 2.0, 3.0]}, {"columns": ["j*"]},
    )),
]  # fmt: skip
T_s, I_A, q_rad = np.arange(5) * dT, np.zeros((5, 18)), np.zeros((5, 3))
LOGS = [
    (T_s[:1], I_A[:1], q_rad[:1]), (0.0, I_A, q_rad), (T_s, I_A[:4], q_rad), (T_s, I_A, q_rad[:, :2]),
    (T_s, I_A, q_rad, "voltages"),
]  # fmt: skip
FRAMES = [
    *(f"field = [{{{text}}}]" for text in (
        'name = "angel"', 'name = "angle", unit = "turn"', 'name = "angle"}, {name = "angle"',
        'name = "sequence", type = "float32"', 'name = "time"', 'name = "angle", scale = 0.0',
    )),
    *(f'{text}\nfield = [{{name = "angle"}}]' for text in (
        "start = [300]", 'encoding = "json"\nend = [10]', 'checksum = "md5"',
    )),
]  # fmt: skip
TOLERANCES = [
    "", "[signals]", "signals = 1", "no toml",
    *(f"[signals.q_rad]\n{text}" for text in ("absolute = -1.0", "absolute = inf", "relativ = 1")),
]  # fmt: skip


def invalid_logs():
    """Messages about maps of columns, logs, descriptions of frames, and tolerances."""
    file = dict.fromkeys(["t_s", "a", "b", "c", "i0", "i1"], np.zeros(3))

    def mapped(fields):
        return column_maps.of_fields({"angles": ANGLES, "currents": CURRENTS, **fields}).log(
            RawTable("bad", file)
        )

    logs = [f"{place}: {refusal(Log, *given, name='bad')}" for place, given in enumerate(LOGS)]
    frames = of_texts(
        lambda path: frame_format.load(str(path)), ".toml", (f"[measurement]\n{lines}\n" for lines in FRAMES)
    )
    return "\n".join(
        [
            listed(mapped, COLUMNS),
            *logs,
            frames,
            of_texts(lambda path: tolerances.load(str(path)), ".toml", TOLERANCES),
        ]
    )


LINEAR = [
    *(({}, {"pose_rad": pose}) for pose in (
        [1.5, 0.0, 0.0], [0.0, np.pi / 2, 0.0], [0.0, 0.0], [0.0, np.nan, 0.0], "upright",
    )),
    ({}, {"inputs": "voltages"}), ({}, {"kind": "matlab"}),
    ({"plant.payload_kg": 60.0}, {"pose_rad": [0.3, -0.2, 0.4]}), ({"plant.group_gain": [0.0] * 18}, {}),
    ({"drive.time_constant_s": [2e-3] * 9 + [6e-3] * 9}, {"pose_rad": [0.3, -0.2, 0.4], "lag": True}),
]  # fmt: skip

SCENARIOS = [
    {"controller.law": "pdd"}, {"law": "pd"}, *({"duration": value} for value in (np.nan, np.inf, 1e-9)),
    *({"seed": value} for value in (1.5, True, None, 10**5000, "9" * 5000)), {"disturbance.load": 1e300},
    *({"controller.period_s": value} for value in (7e-4, 1e-4, 1.0000001e-3)), {"trajectory": {}},
    {"disturbance.terms": [{"kind": "constant", "torque": [1.0, 2.0, 3.0]}]},
    {"disturbance.terms": [{"kind": "constant", "torque_Nm": [1.0, 2.0, "x"]}]},
    {"trajectory": {"shape": "multisine", "components": [{"amplitude_rad": [0.0, 0.0, 1e9]}]}},
    *({"name": name} for name in ("a\x1b[31mb", "a\nb", "\udcff")), {"description": "\x07"},
    *({"plant.mjcf": path} for path in ("a\0b", "~\0/b")), {"": 1}, {"controller.": 1}, {3: 1},
    {".".join("a" * 5000): 1}, {"plant": {("a", 1): 2}}, {"a\x1b[2J": 1},
    {"drive.supply_V": 24.0, "drive.drop_up_V": 24.0}, {"drive.supply_V": 24.0, "drive.drop_down_V": 30.0},
    {"drive.drop_up_V": 30.0}, {"sensors.encoder.start_error_rad": 0.1},
    {"sensors.potentiometer.electrical_angle_rad": 1.0, "sensors.potentiometer.nonlinearity_rad": 0.07},
    {"sensors.potentiometer.hysteresis_rad": 0.004, "sensors.potentiometer.repeatability_rad": 0.003},
    {"trajectory.shape": "tilt", "trajectory.angle_rad": [0.0] * 3},
    {"trajectory.angle_rad": [0.0] * 3, "trajectory.shape": "tilt"},
    *({"fault": [{"target": "coil.00", "mode": "open"}] * count} for count in (MOST_FAULTS, MOST_FAULTS + 1)),
]  # fmt: skip
SOURCES = {
    "broken.toml": "duration = = 2", "empty.toml": "", "digits.toml": f"seed = {'9' * 5000}",
    "zero.toml": "duration = 1\0", "date.toml": "seed = 1979-05-27\n[trajectory]\nshape = 'hold'",
    **dict.fromkeys(["spiral", "nutatoin", "", "a\x1b\nb", f"{'x' * 20_000}.toml"]),
}  # fmt: skip


def invalid_scenarios():
    """Messages about fields and sources of scenarios, and about what has no linear model."""
    folder = scratch("sources")
    for name, text in SOURCES.items():
        if text is not None:
            (folder / name).write_text(text)
    with contextlib.chdir(folder):
        sources = listed(scenarios.load, SOURCES)
    fields = listed(lambda changes: scenarios.load("nutation", {"seed": 0, **changes}), SCENARIOS)
    damped = edited(folder, ('axis="0 0 1"/>', 'axis="0 0 1" damping="1e-3"/>'))
    cases = [*LINEAR, ({"plant.mjcf": str(damped)}, {})]
    linear = listed(lambda given: linearise(scenarios.load("hold", given[0]), **given[1]), cases)
    timed = scenarios.load("hold", {"event": [{"t_s": 0.1, "set": "disturbance.load", "value": 1.0}]})
    return "\n".join([sources, fields, linear, refusal(LoopSystem, timed)])


CASES = {
    "refused_actuators": invalid_actuators, "refused_tables": invalid_tables, "refused_laws": invalid_laws,
    "refused_trajectories": invalid_trajectories, "refused_logs": invalid_logs,
    "refused_scenarios": invalid_scenarios,
}  # fmt: skip


test_content = content_test(CASES)
