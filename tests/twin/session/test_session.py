"""A session: the same bytes whatever the chunks, restored anywhere, changed on its way, or refused."""

import dataclasses
import importlib
import json
import pickle
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from itertools import product

import numba
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from spheretwin.control.law import Known, Law
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.magnetics import torque_matrix
from spheretwin.models.telemetry import file as telemetry_file
from spheretwin.models.telemetry.file import TelemetryFile
from spheretwin.models.telemetry.signals import Signal, common_signals
from spheretwin.models.telemetry.table import Table, read_parquet
from spheretwin.twin import cli
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.exogenous import BLOCK_TICKS
from spheretwin.twin.records import replay
from spheretwin.twin.records.facts import facts_of, record_of
from spheretwin.twin.session import Change, Session
from spheretwin.twin.simulation import follow, simulate

SIGNALS = common_signals(18)

SHIPPED, ENGINES = ("pd", "adaptive_fuzzy", "afsm"), ("mujoco", "lagrangian")
RANDOM = {"disturbance.random_bound_Nm": 0.05}
WORN = {"plant.coulomb_Nm": [0.004, 0.003, 0.002], "plant.viscous_Nm_s": [1e-4, 1e-4, 2e-4]}
ASKEW = {"sensors.angle_offset_rad": [0.01, -0.02, 0.005]}


def scenario(name="sinusoid", **changes):
    return scenarios.load(name, RANDOM | {key.replace("__", "."): value for key, value in changes.items()})


def session(law=None, **changes):
    return Session(scenario(**changes), law)


def rows(table):
    return table.values.tobytes()


def proportional(t, reference, measurement, parameters, state, torque):
    state[0] += 1.0  # calls
    parameters[1] *= 1.001  # a law may change what it was given
    for axis in range(3):
        error, rate = measurement[0, axis] - reference[0, axis], measurement[1, axis] - reference[1, axis]
        torque[axis] = -parameters[0] * error - parameters[1] * rate


compiled_proportional = numba.njit(proportional)

CALLS = (Signal("calls", "1", 1, "calls so far"),)


def plain_law(name="mine"):
    return Law(name, proportional, np.array([0.5, 0.05]), np.zeros(1), CALLS)


def compiled_law(name="mine"):
    return Law(name, compiled_proportional, np.array([0.5, 0.05]), np.zeros(1), CALLS)


OWN = {"plain": plain_law, "compiled": compiled_law}


@pytest.fixture(scope="session")
def sticky(tmp_path_factory):
    """A model of the user's, in which the engine's solver is cut off at each step: where it began shows."""
    text = actuators.MJCF_PATH.read_text()
    for before, after in [
        ('<option integrator="RK4"', '<option integrator="RK4" solver="Newton" iterations="1"'),
        *[
            (f'<joint name="{hinge}"', f'<joint frictionloss="0.2" name="{hinge}"')
            for hinge in ("alpha", "beta", "gamma")
        ],
    ]:
        assert text.count(before) == 1
        text = text.replace(before, after)
    path = tmp_path_factory.mktemp("model") / "sticky.xml"
    path.write_text(text.replace('meshdir="', f'meshdir="{actuators.MJCF_PATH.parent}/'))
    return str(path)


# --- chunks

LENGTH = 2 * BLOCK_TICKS + 300
VARIANTS = {"ideal": {}, "worn": WORN, "askew": ASKEW, "both": WORN | ASKEW}


@pytest.fixture(scope="module")
def whole():
    """Rows of one long call, made when first asked for."""
    made = {}

    def of(law, engine, variant):
        key = law, engine, variant
        if key not in made:
            changes = {"controller.law": law, "plant.engine": engine} | VARIANTS[variant]
            made[key] = rows(Session(scenario(**changes)).advance(LENGTH))
        return made[key]

    return of


@settings(max_examples=60)
@given(
    law=st.sampled_from(SHIPPED),
    engine=st.sampled_from(ENGINES),
    variant=st.sampled_from(sorted(VARIANTS)),
    cuts=st.lists(st.integers(0, LENGTH) | st.sampled_from([0, 1, 999, 1000, 1001, 1999, 2000]), max_size=12),
)
@example("afsm", "mujoco", "both", [0, 0, 1, 999, 1000, 1000, 1001, 2000])
@example("pd", "lagrangian", "ideal", list(range(960, 1040)))
def test_chunks_change_no_bit(whole, law, engine, variant, cuts):
    changes = {"controller.law": law, "plant.engine": engine} | VARIANTS[variant]
    ends = [*sorted(cuts), LENGTH]
    chunked = Session(scenario(**changes))
    parts = [chunked.advance(end - start) for start, end in zip([0, *ends], ends, strict=False)]
    assert b"".join(map(rows, parts)) == whole(law, engine, variant)
    assert chunked.tick == LENGTH


def test_chunks_do_not_decide_where_a_disturbance_is_lost():
    # exp(pi t) is infinite from 225.93 s on; the bound is small enough for the run to get there.
    changes = {
        "name": "hold", "controller.law": "pd", "controller.period_s": 0.02, "plant.step_s": 0.02,
        "plant.engine": "lagrangian", "disturbance.random_bound_Nm": 1e-310,
        "disturbance.gamma_envelope": "growing",
    }  # fmt: skip
    name = changes.pop("name")
    last = int(np.log(np.finfo(float).max) / np.pi / 0.02) + 1
    for chunk in (10 * BLOCK_TICKS, 700, 1):
        long = Session(scenarios.load(name, changes))
        long.advance(last - 50)
        done = 0
        while long.tick < last:
            done += len(long.advance(chunk))
        assert (long.status, long.tick, done) == ("running", last, 50)
        with pytest.raises(InputError, match="finite disturbance"):
            long.advance(chunk)
        assert long.tick == last


# --- snapshot and restore


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("law", SHIPPED)
@pytest.mark.parametrize("at", [0, 1, 437, BLOCK_TICKS, BLOCK_TICKS + 1])
def test_a_restored_session_goes_on_bit_for_bit(law, engine, at):
    changes = {"controller.law": law, "plant.engine": engine} | WORN | ASKEW
    original = session(**changes)
    original.advance(at)
    taken = original.snapshot()
    expected = rows(original.advance(BLOCK_TICKS + 100))
    original.restore(taken)  # in place
    assert original.tick == at
    assert rows(original.advance(BLOCK_TICKS + 100)) == expected
    other = session(name="hold", **{"controller.law": "pd"})  # nothing of it may remain
    other.advance(77)
    other.restore(pickle.loads(pickle.dumps(taken)))
    assert rows(other.advance(BLOCK_TICKS + 100)) == expected
    assert other.begun_as == original.begun_as


def test_a_snapshot_is_not_moved_by_what_the_session_does_next():
    original = session(**WORN)
    original.advance(50)
    taken = original.snapshot()
    before = pickle.dumps(taken)
    original.set("disturbance.load", 2.0)
    original.advance(1200)
    assert pickle.dumps(taken) == before
    original.restore(taken)
    original.advance(10)
    assert pickle.dumps(taken) == before


@pytest.mark.parametrize("kind", OWN)
def test_a_user_s_law_is_restored_with_its_memory_and_its_parameters(kind):
    original = session(OWN[kind](), name="hold")
    original.advance(120)
    taken = pickle.loads(pickle.dumps(original.snapshot()))
    expected = original.advance(300)
    assert expected["calls"][0] == 121
    other = session(OWN[kind](), name="hold")
    other.restore(taken)
    assert rows(other.advance(300)) == rows(expected)


def test_the_solver_s_warm_start_is_restored(sticky):
    original = session(**{"plant.mjcf": sticky})
    original.advance(237)
    taken = original.snapshot()
    expected = rows(original.advance(200))
    other = session(**{"plant.mjcf": sticky})
    other.restore(pickle.loads(pickle.dumps(taken)))
    assert rows(other.advance(200)) == expected
    # Without the warm start, which lies among the numbers of the state, the bits are others.
    other.restore(taken)
    data = other._machine._moving.rotor.data
    assert np.any(data.qacc_warmstart)
    data.qacc_warmstart[:] = 0.0
    assert rows(other.advance(200)) != expected


@pytest.mark.parametrize("engine", ENGINES)
def test_a_session_that_was_changed_is_restored(engine):
    original = session(**{"plant.engine": engine})
    original.advance(200)
    for name, value in [
        ("disturbance.load", 1.5), ("plant.payload_kg", 0.05), ("controller.law", "adaptive_fuzzy"),
        ("sensors.angle_offset_rad", [0.0, 0.01, 0.0]), ("plant.coulomb_Nm", [0.001, 0.001, 0.001]),
        ("trajectory.amplitude_rad", [0.1, 0.2, 0.1]), ("allocation", "bounded"),
    ]:  # fmt: skip
        original.set(name, value)
        original.advance(30)
    taken = pickle.loads(pickle.dumps(original.snapshot()))
    expected = original.advance(1000)
    other = session(**{"plant.engine": engine})
    other.restore(taken)
    assert other.journal == original.journal
    assert other.scenario == original.scenario
    assert other.signals == expected.signals
    assert rows(other.advance(1000)) == rows(expected)


CONTINUED = """
import pickle, sys
from spheretwin.twin import scenario
from spheretwin.twin.session import Session
with open(sys.argv[1], "rb") as file:
    taken = pickle.load(file)
other = Session(scenario.load("hold"), law)
other.restore(taken)
sys.stdout.buffer.write(other.advance(1100).values.tobytes())
"""


def continued(path, law="law = None", **options):
    """Rows of 1100 ticks from a pickled snapshot on, in a process of their own."""
    command = [sys.executable, "-c", f"{law}\n{CONTINUED}", str(path)]
    return subprocess.run(command, capture_output=True, check=True, **options).stdout


@pytest.mark.parametrize("model", [*ENGINES, "sticky"])
def test_another_process_goes_on_bit_for_bit(model, tmp_path, sticky):
    changes = {"plant.mjcf": sticky} if model == "sticky" else {"plant.engine": model}
    original = session(**changes | WORN)
    original.advance(613)
    original.set("disturbance.load", 1.0)
    path = tmp_path / "taken.pickle"
    path.write_bytes(pickle.dumps(original.snapshot()))
    assert continued(path) == rows(original.advance(1100))


MODULE = """
import numba, numpy as np
from spheretwin.control.law import Law

def step(t, reference, measurement, parameters, state, torque):
    for axis in range(3):
        error = measurement[0, axis] - reference[0, axis]
        state[axis] += error  # integral
        torque[axis] = -parameters[0] * error - 0.05 * measurement[1, axis] - 1e-3 * state[axis]

plain = Law("mine", step, np.array([0.5]), np.zeros(3))
fast = Law("mine", numba.njit(step), np.array([0.5]), np.zeros(3))
"""


@pytest.mark.parametrize("kind", ["plain", "fast"])
def test_another_process_goes_on_under_a_law_that_both_have(kind, tmp_path, monkeypatch):
    (tmp_path / f"of_the_user_{kind}.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    law = getattr(importlib.import_module(f"of_the_user_{kind}"), kind)
    original = session(law, name="hold")
    original.advance(413)
    path = tmp_path / "taken.pickle"
    path.write_bytes(pickle.dumps(original.snapshot()))
    law_there = f"from of_the_user_{kind} import {kind} as law"
    assert continued(path, law_there, cwd=tmp_path) == rows(original.advance(1100))


def same_future(one, other, ticks=200):
    assert (one.tick, one.journal, one.scenario, one.signals) == (
        other.tick, other.journal, other.scenario, other.signals,
    )  # fmt: skip
    return rows(one.advance(ticks)) == rows(other.advance(ticks))


def test_a_snapshot_under_a_law_that_is_missing_is_refused_and_nothing_changes():
    mine = session(plain_law(), name="hold")
    mine.advance(10)
    taken = mine.snapshot()
    for law in (None, plain_law("yours")):
        other, untouched = session(law, name="hold"), session(law, name="hold")
        other.advance(5)
        untouched.advance(5)
        with pytest.raises(InputError, match="received one under mine"):
            other.restore(taken)
        assert same_future(other, untouched)


def test_a_snapshot_that_does_not_fit_is_refused_and_nothing_changes(sticky):
    mine = session(plain_law(), name="hold")
    mine.advance(10)
    taken = mine.snapshot()
    longer = Law("mine", proportional, np.array([0.5, 0.05]), np.zeros(2), CALLS)
    fitting = dataclasses.replace(taken, machine=taken.machine._replace(rotor=taken.machine.rotor[:-1]))
    for law, snapshot, part in [
        (longer, taken, "the law's memory, received 1"),
        (plain_law(), fitting, "the engine's state"),
    ]:
        other, untouched = session(law, name="hold"), session(law, name="hold")
        other.advance(5)
        untouched.advance(5)
        with pytest.raises(InputError, match=part):
            other.restore(snapshot)
        assert same_future(other, untouched)


# --- threads


def test_runs_on_threads_are_those_made_one_after_the_other():
    runs = [
        {"controller.law": law, "disturbance.load": load, "seed": seed, "plant.engine": engine}
        for law, load, seed, engine in product(SHIPPED, (0.0, 1.0, 2.0), (0, 1), ENGINES)
    ]
    assert len(runs) == 36

    def made(changes):
        return rows(Session(scenario(**changes)).advance(400))

    serial = list(map(made, runs))
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(made, runs)) == serial
    assert len(set(serial)) == 36


class Held:
    """A plain Python law that stays within its call until it is let go."""

    def __init__(self):
        self.entered, self.go = threading.Event(), threading.Event()

    def law(self):
        def step(t, reference, measurement, parameters, state, torque):
            torque[:] = -0.5 * (measurement[0] - reference[0]) - 0.05 * (measurement[1] - reference[1])
            self.entered.set()
            assert self.go.wait(30)

        return Law("held", step, [], [])


def test_a_second_thread_is_refused_while_the_first_is_at_work():
    held = Held()
    busy = session(held.law(), name="hold")
    with ThreadPoolExecutor(1) as pool:
        advancing = pool.submit(busy.advance, 20)
        assert held.entered.wait(30)
        try:
            taken = [
                lambda: busy.advance(1),
                lambda: busy.advance(0),
                lambda: busy.set("disturbance.load", 2.0),
                lambda: busy.snapshot(),
                lambda: busy.restore(None),
            ]
            for call in taken:
                with pytest.raises(SpheretwinError, match="one thread at a time"):
                    call()
        finally:
            held.go.set()
        first = advancing.result()
    alone = session(held.law(), name="hold")
    assert rows(first) == rows(alone.advance(20))
    assert busy.journal == ()
    assert same_future(busy, alone)


def test_a_law_cannot_call_the_session_that_calls_it():
    inside = []

    def step(t, reference, measurement, parameters, state, torque):
        torque[:] = 0.0
        try:
            inside[0].snapshot()
        except SpheretwinError as error:
            inside.append(str(error))

    inside.append(session(Law("curious", step, [], []), name="hold"))
    inside[0].advance(1)
    assert "one thread at a time" in inside[1]


def test_a_closed_session_is_refused():
    with session() as closed:
        taken = closed.snapshot()
    for call in (
        lambda: closed.advance(1),
        lambda: closed.set("disturbance.load", 1.0),
        closed.snapshot,
        lambda: closed.restore(taken),
    ):
        with pytest.raises(SpheretwinError, match="closed"):
            call()
    closed.close()  # a second time is nothing


# --- changes on the way

KINDS = [
    ("controller.surface_slope", 70.0),
    ("controller.law", "pd"),
    ("controller.law", "adaptive_fuzzy"),
    ("controller.level", "torque"),
    ("disturbance.load", 1.5),
    ("disturbance.random_bound_Nm", 0.2),
    ("trajectory.amplitude_rad", [0.1, 0.2, 0.1]),
    ("trajectory", {"shape": "hold", "angle_rad": [0.1, 0.0, 0.0]}),
    ("nominal.torque_scale", 0.5),
    ("nominal.inertia_kg_m2", [3e-3, 3e-3, 3e-3]),
    ("nominal.current_limit_A", 0.5),
    ("drive.current_limit_A", 0.5),
    ("drive.time_constant_s", 0.0),
    ("plant.payload_kg", 0.05),
    ("plant.modelling_error", 0.3),
    ("plant.modelling_torque_Nm", [0.01, 0.0, 0.0]),
    ("plant.group_gain", [0.0] + 17 * [1.0]),
    ("plant.coulomb_Nm", [0.004, 0.004, 0.004]),
    ("sensors.angle_offset_rad", [0.0, 0.01, 0.0]),
]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("name", "value"), KINDS, ids=[f"{name}-{i}" for i, (name, _) in enumerate(KINDS)])
def test_a_change_acts_from_its_tick_on_and_not_before(engine, name, value):
    at, changes = 340, {"plant.engine": engine, "disturbance.load": 1.0}
    kept, changed = session(**changes), session(**changes)
    before = changed.advance(at)
    changed.set(name, value)
    after, expected = changed.advance(60), kept.advance(at + 60)
    assert rows(before) == rows(expected.rows(0, at))
    assert after["t_s"][0] == expected["t_s"][at]
    # Where the rotor is is what was before; what acts on it from this tick on, or the next, is not.
    np.testing.assert_array_equal(after["q_rad"][0], expected["q_rad"][at])
    np.testing.assert_array_equal(after["qdot_rad_s"][0], expected["qdot_rad_s"][at])
    columns = [signal.name for signal in SIGNALS]
    differ = [c for c in columns if not np.array_equal(after[c][:2], expected[c][at : at + 2])]
    assert differ, name
    assert changed.journal == (Change(at, name, value),)


@pytest.mark.parametrize("engine", ENGINES)
def test_another_allocation_acts_from_its_tick_on(engine):
    changes = {"plant.engine": engine, "nominal.current_limit_A": 0.4}  # where the limit acts, they differ
    kept, changed = session(**changes), session(**changes)
    before = changed.advance(40)
    changed.set("allocation", "bounded")
    after, expected = changed.advance(20), kept.advance(60)
    assert expected["allocation_scale"][40] < 1
    assert rows(before) == rows(expected.rows(0, 40))
    np.testing.assert_array_equal(after["torque_command_Nm"][0], expected["torque_command_Nm"][40])
    assert after["allocation_scale"][0] > expected["allocation_scale"][40]


def test_gravity_acts_from_its_tick_on():
    changes = {"plant.payload_kg": 0.05, "plant.engine": "lagrangian"}
    kept, changed = session(**changes), session(**changes)
    changed.advance(100)
    changed.set("plant.gravity_m_s2", 0.0)
    after, expected = changed.advance(50), kept.advance(150).rows(100, 150)
    np.testing.assert_array_equal(after["q_rad"][0], expected["q_rad"][0])
    assert not np.array_equal(after["q_rad"][1], expected["q_rad"][1])


@pytest.mark.parametrize("kind", OWN)
def test_a_law_object_may_replace_a_shipped_one_and_back(kind):
    changed = session(name="hold")
    changed.advance(100)
    changed.set("controller.law", OWN[kind]())
    table = changed.advance(50)
    np.testing.assert_array_equal(table["calls"], np.arange(1, 51))
    assert changed.scenario.controller.law == "mine"
    assert changed.begun_as.controller.law == "afsm"
    assert changed.journal == (Change(100, "controller.law", "mine"),)
    with pytest.raises(InputError, match="shipped law"):
        changed.set("controller.reaching_gain", 5.0)
    changed.set("controller.law", "pd")
    assert "calls" not in [signal.name for signal in changed.advance(5).signals]
    assert changed.scenario.controller.law == "pd"


def test_a_change_beside_the_law_keeps_what_the_law_remembers():
    # What the law itself made of its parameters belongs to it as its memory does.
    kept, changed = session(compiled_law(), name="hold"), session(compiled_law(), name="hold")
    changed.advance(300)
    changed.set("drive.current_limit_A", 7.0)  # never reached: the future is the same
    expected = kept.advance(600)
    assert np.abs(expected["current_command_A"]).max() < 7.0
    assert rows(changed.advance(300)) == rows(expected.rows(300, 600))


@pytest.mark.parametrize("engine", ENGINES)
def test_a_limit_that_is_never_met_may_move_without_a_trace(engine):
    kept, changed = session(**{"plant.engine": engine} | WORN), session(**{"plant.engine": engine} | WORN)
    for _ in range(4):
        changed.advance(150)
        changed.set("drive.current_limit_A", 7.0 + changed.tick / 1e3)
    expected = kept.advance(1000)
    assert np.abs(expected["current_command_A"]).max() < 7.0
    assert rows(changed.advance(400)) == rows(expected.rows(600, 1000))


def test_a_change_of_the_plant_keeps_the_solver_s_warm_start(sticky):
    kept, changed = session(**{"plant.mjcf": sticky}), session(**{"plant.mjcf": sticky})
    changed.advance(150)
    changed.set("plant.group_gain", [1.0] * 18)  # what it is when not given
    assert rows(changed.advance(200)) == rows(kept.advance(350).rows(150, 350))


SAME = [
    ("controller.law", "afsm"), ("controller.surface_slope", 50.0), ("disturbance.load", 1.0),
    ("disturbance.load", 1), ("disturbance.random_bound_Nm", 0.05), ("trajectory.frequency_Hz", 0.5),
    ("allocation", "least_norm"), ("nominal.torque_scale", 1.0), ("nominal.torque_curve", None),
    ("drive.current_limit_A", 8.0), ("plant.payload_kg", 0.0), ("plant.modelling_error", 0.2),
    ("plant.gravity_m_s2", 9.81), ("plant.gravity_m_s2", None), ("nominal.current_limit_A", None),
    ("nominal.inertia_kg_m2", None), ("plant.coulomb_Nm", [0.004, 0.003, 0.002]),
    ("plant.coulomb_Nm", np.array([0.004, 0.003, 0.002])), ("sensors.angle_offset_rad", (0.01, -0.02, 0.005)),
]  # fmt: skip


@pytest.mark.parametrize("engine", ENGINES)
def test_a_change_to_what_is_changes_no_bit(engine, sticky):
    model = {"plant.mjcf": sticky} if engine == "mujoco" else {}
    changes = {"plant.engine": engine, "disturbance.load": 1.0} | model | WORN | ASKEW
    kept, changed = session(**changes), session(**changes)
    table = [changed.advance(130)]
    for name, value in SAME:
        changed.set(name, value)
        table.append(changed.advance(47))
    assert b"".join(map(rows, table)) == rows(kept.advance(130 + 47 * len(SAME)))
    assert [change.name for change in changed.journal] == [name for name, _ in SAME]
    assert changed.scenario == kept.scenario


def test_the_same_law_object_once_more_changes_no_bit():
    law = compiled_law()
    kept, changed = session(law, name="hold"), session(law, name="hold")
    changed.advance(100)
    changed.set("controller.law", law)
    assert rows(changed.advance(100)) == rows(kept.advance(200).rows(100, 200))


@pytest.mark.parametrize("at", [1, 500, BLOCK_TICKS, BLOCK_TICKS + 1])
def test_a_change_of_the_disturbance_does_not_touch_the_random_stream(at):
    kept, changed = session(), session()
    changed.advance(at)
    changed.set("disturbance.load", 2.0)
    ticks = 2 * BLOCK_TICKS
    after, expected = (
        changed.advance(ticks)["disturbance_Nm"],
        kept.advance(at + ticks)["disturbance_Nm"][at:],
    )
    # 0.05 N·m more, and the same draws: three sums up to 0.15 N·m, each of which rounds by 1.4e-17.
    np.testing.assert_allclose(after - 0.05, expected, rtol=0, atol=4.2e-17)
    changed.set("disturbance.load", 1.0)
    np.testing.assert_array_equal(
        changed.advance(ticks)["disturbance_Nm"], kept.advance(ticks)["disturbance_Nm"]
    )


def not_compilable(t, reference, measurement, parameters, state, torque):
    torque[:] = {}.fromkeys("abc").popitem()


REFUSED = [
    ("disturbance.loud", 1.0, "did you mean load"),
    ("disturbance.load", 1e9, "1000"),
    ("disturbance.load", "much", "valid number"),
    ("disturbance.load", float("nan"), "finite number"),
    ("controller.law", "pdd", "did you mean pd"),
    ("controller.law", 3, "expected one of pd, adaptive_fuzzy, afsm"),
    ("disturbance.load", plain_law(), "a law for controller.law"),
    ("controller.law", Law("broken", numba.njit(not_compilable), [], []), "that compiles"),
    ("nominal.torque_scale", 0.0, "0.001 in magnitude"),
    ("nominal.torque_curve", "/nowhere/curve.csv", "torque curve"),
    ("plant.torque_curve", "/nowhere/curve.csv", "torque curve"),
    ("plant.group_gain", [1.0, 1.0], "18 groups, received 2"),
    ("plant.integrator", "Verlet", "'RK4'"),
    ("", 1.0, "expected a field"),
    ("disturbance", {"load": 1.0, "noise": 2.0}, "expected one of"),
    (None, 1.0, "expected a field"),
    *[(name, 1.0, "may change during a run") for name in ("name", "seed", "duration")],
    *[
        (name, value, "may change during a run")
        for name, value in [
            ("controller.period_s", 1e-3), ("plant.step_s", 1e-3), ("plant.engine", "mujoco"),
            ("plant.mjcf", None), ("plant.initial_rad", None), ("plant.initial_rad_s", [0.0, 0.0, 0.0]),
            # A section would bring its fixed fields with it.
            ("plant", {"engine": "mujoco"}), ("plant", {}), ("controller", {"period_s": 2e-3}),
        ]
    ],
]  # fmt: skip


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("name", "value", "part"), REFUSED, ids=[f"{i}" for i in range(len(REFUSED))])
def test_a_change_that_is_none_is_refused_and_nothing_changes(engine, name, value, part):
    changed, kept = session(**{"plant.engine": engine}), session(**{"plant.engine": engine})
    for each in (changed, kept):
        each.advance(120)
        each.set("disturbance.load", 1.0)
    with pytest.raises(InputError) as caught:
        changed.set(name, value)
    assert part in str(caught.value)
    assert "\n" not in str(caught.value)
    assert same_future(changed, kept)
    assert changed.law.name == "afsm"


@pytest.mark.parametrize("name", ["plant.integrator"])
def test_what_only_the_engine_refuses_changes_nothing_either(name):
    changed, kept = session(**{"plant.engine": "lagrangian"}), session(**{"plant.engine": "lagrangian"})
    changed.advance(100), kept.advance(100)
    with pytest.raises(InputError, match="integrator RK4, received Euler"):
        changed.set(name, "Euler")
    assert same_future(changed, kept)


def test_the_journal_keeps_the_value_that_was_given_then():
    gains = [1.0] * 18
    changed = session()
    changed.set("plant.group_gain", gains)
    gains[0] = 0.0
    changed.set("trajectory", shape := {"shape": "hold", "angle_rad": np.array([0.1, 0.0, 0.0])})
    shape["shape"] = "tilt"
    assert changed.journal[0].value == [1.0] * 18
    assert changed.journal[1].value == {"shape": "hold", "angle_rad": [0.1, 0.0, 0.0]}
    json.dumps(changed.journal)


def test_the_actuator_follows_a_change_of_its_torque_curve(actuator, tmp_path):
    curve = actuator.torque_curve
    lines = [
        f"{phi!r},{torque!r}"
        for phi, torque in zip(
            np.degrees(curve.phi_rad).tolist(), (0.5 * curve.torque_Nm_per_A).tolist(), strict=True
        )
    ]
    path = tmp_path / "weak.csv"
    path.write_text("\n".join(["phi_deg,torque_Nm_per_A", *lines]))
    changed = session()
    changed.advance(10)
    before = torque_matrix(changed.q_rad, changed.actuator)
    changed.set("plant.torque_curve", str(path))
    # Half of every sample, to the rounding of a spline's solution.
    np.testing.assert_allclose(torque_matrix(changed.q_rad, changed.actuator), 0.5 * before, atol=1e-14)


# --- replay


def recorded(path, changes=(), law=None, ticks=600, **overrides):
    """A run of a session with changes at their ticks, as its user would write it to a file."""
    live = session(law, **overrides)
    file = TelemetryFile(path, live.signals, record_of(live).metadata())
    parts = []
    for tick, name, value in [*changes, (ticks, None, None)]:
        parts.append(live.advance(tick - live.tick))
        file.write(parts[-1])
        if name:
            live.set(name, value)
    file.finish("completed" if live.status == "running" else live.status)
    file.close(record_of(live).metadata())
    return live, parts


CHANGES = [
    (0, "disturbance.load", 1.0),
    (100, "controller.surface_slope", 60.0),
    (250, "plant.payload_kg", 0.05),
    (250, "plant.group_gain", np.linspace(0.8, 1.2, 18)),
    (333, "trajectory.amplitude_rad", (0.1, 0.2, 0.1)),
    (400, "allocation", "bounded"),
    (600, "nominal.torque_scale", np.float64(0.9)),  # after the last tick: it acts on none, but was made
]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("changes", [[], CHANGES], ids=["none", "many"])
def test_a_file_replays_to_the_same_bytes(engine, changes, tmp_path):
    _, parts = recorded(first := tmp_path / "a.parquet", changes, **{"plant.engine": engine})
    plan = replay.read(first)
    again = Session(plan.scenario)
    file = TelemetryFile(second := tmp_path / "b.parquet", again.signals, record_of(again).metadata())
    assert follow(again, plan.ticks, [file], journal=plan.journal) == "completed"
    file.close(record_of(again).metadata())
    assert second.read_bytes() == first.read_bytes()
    assert read_parquet(second)[0].values.tobytes() == b"".join(map(rows, parts))
    assert again.journal == plan.journal


@pytest.mark.parametrize("part_rows", [telemetry_file.PART_ROWS, 128])
def test_the_command_replays_a_run_whose_columns_change(part_rows, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(telemetry_file, "PART_ROWS", part_rows)
    changes = [
        (200, "controller.law", "pd"), (300, "plant.coulomb_Nm", [0.001, 0.001, 0.001]),
        (450, "controller.law", "adaptive_fuzzy"),
    ]  # fmt: skip
    _, parts = recorded(first := tmp_path / "a.parquet", changes)
    second = tmp_path / "b.parquet"
    assert cli.main(["simulate", "--replay", str(first), "--telemetry", str(second), "--json"]) == 0
    assert second.read_bytes() == first.read_bytes()
    assert json.loads(capsys.readouterr().out)["status"] == "completed"
    table, _ = read_parquet(second)
    assert len(table) == 600
    present = {name: ~np.isnan(table[name].reshape(600, -1)).any(axis=1) for name in
               ("q_rad", "sliding_s", "switching_gain", "friction_Nm")}  # fmt: skip
    ticks = np.arange(600)
    np.testing.assert_array_equal(present["q_rad"], True)
    np.testing.assert_array_equal(present["sliding_s"], (ticks < 200) | (ticks >= 450))
    np.testing.assert_array_equal(present["switching_gain"], ticks < 200)
    np.testing.assert_array_equal(present["friction_Nm"], ticks >= 300)
    bounds = np.cumsum([0, *map(len, parts)])
    for part, start, end in zip(parts, bounds, bounds[1:], strict=False):
        for signal in part.signals:
            assert table[signal.name][start:end].tobytes() == part[signal.name].tobytes()


@pytest.mark.parametrize(
    "changes",
    [
        {"controller.law": "pd", "disturbance.load": 5.0},
        # A rotor of hardly any inertia is beyond every rate within a step.
        {"plant.modelling_error": -0.99999999},
    ],
    ids=["left_workspace", "diverged"],
)
def test_a_run_that_ended_by_itself_replays_to_its_end(changes, tmp_path, request, capsys):
    expected = request.node.callspec.id
    live, _ = recorded(first := tmp_path / "a.parquet", ticks=3000, **changes)
    assert live.status == expected
    assert live.tick < 3000
    second = tmp_path / "b.parquet"
    assert cli.main(["simulate", "--replay", str(first), "--telemetry", str(second), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["status"] == expected
    assert second.read_bytes() == first.read_bytes()


def refused(path, capsys):
    assert cli.main(["simulate", "--replay", str(path)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    (line,) = err.splitlines()
    assert line.startswith("spheretwin: ")
    return line


def test_what_holds_no_run_is_refused_on_one_line(tmp_path, capsys):
    import pyarrow as pa
    import pyarrow.parquet

    run = session().advance(10)
    run.write_parquet(bare := tmp_path / "bare.parquet", {})
    assert "expected scenario, journal and ticks" in refused(bare, capsys)
    known = record_of(Session(scenario())).metadata()
    run.write_parquet(path := tmp_path / "none.parquet", known)
    assert "at least one tick, received 0" in refused(path, capsys)
    for name, text in [
        ("journal", "[[1, 2]]"), ("journal", "null"), ("journal", "[[1e999, \"a\", 1]]"),
        ("scenario", "[]"), ("scenario", '"afsm"'), ("scenario", '{"controller": "afsm"}'), ("scenario", "{"),
        ("ticks", "many"), ("journal", "[" * 100_000),
    ]:  # fmt: skip
        run.write_parquet(path := tmp_path / "odd.parquet", {**known, "ticks": "10", name: text})
        assert "replay" in refused(path, capsys), (name, text)
    pyarrow.parquet.write_table(pa.table({"a": [1.0]}), foreign := tmp_path / "foreign.parquet")
    assert "expected a Parquet file of a run" in refused(foreign, capsys)
    (text := tmp_path / "text.parquet").write_text("no parquet")
    assert "expected a Parquet file of a run" in refused(text, capsys)
    assert "missing.parquet" in refused(tmp_path / "missing.parquet", capsys)


def test_a_law_that_a_file_does_not_hold_is_refused_on_one_line(tmp_path, capsys):
    recorded(path := tmp_path / "mine.parquet", law=plain_law(), ticks=20)
    assert "received one under mine" in refused(path, capsys)
    recorded(path := tmp_path / "later.parquet", [(10, "controller.law", plain_law())], ticks=20)
    assert "received one to mine at tick 10" in refused(path, capsys)
    # One of the user's that has the name of a shipped one is still the user's.
    for law in ("pd", "afsm"):
        recorded(path := tmp_path / "named.parquet", law=plain_law(law), ticks=20)
        refused(path, capsys)
        recorded(path, [(10, "controller.law", plain_law(law))], ticks=20)
        assert f"received one to {law} of the user's" in refused(path, capsys)


# --- how a session ends


def raising(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0
    if t > 0.0205:
        raise ValueError("lost")


def test_a_law_that_raises_ends_the_session_until_it_is_restored():
    broken = session(Law("raising", raising, [], []), name="hold")
    assert len(broken.advance(10)) == 10
    taken = broken.snapshot()
    with pytest.raises(ValueError, match="lost"):
        broken.advance(100)
    assert broken.status == "diverged"
    assert len(broken.advance(100)) == 0
    broken.restore(taken)
    assert (broken.status, broken.tick) == ("running", 10)
    assert len(broken.advance(11)) == 11


def test_nothing_is_run_where_no_tick_is_asked_for():
    idle, kept = session(), session()
    for _ in range(3):
        table = idle.advance(0)
        assert (len(table), table.signals) == (0, idle.signals)
    assert (idle.tick, idle.t_s, idle.status) == (0, 0.0, "running")
    assert rows(idle.advance(20)) == rows(kept.advance(20))


@pytest.mark.parametrize("ticks", [-1, 1.5, "3", None, np.float64(2.0)])
def test_a_number_of_ticks_that_is_none_is_refused(ticks):
    with pytest.raises(InputError, match="number of ticks from 0 on"):
        session().advance(ticks)


def test_rows_of_another_width_are_refused():
    # Compiled code would write beside them.
    asked = session()
    columns = asked.advance(0).values.shape[1]
    for log in (
        np.empty((5, columns - 1)), np.empty((5, columns + 1)), np.empty(columns), np.empty((5, columns, 1)),
        np.empty((5, columns), dtype=np.float32), np.empty((columns, 5)).T,
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"rows of {columns} float64"):
            asked.advance_into(log)
    assert asked.tick == 0
    log = np.empty((5, columns))
    assert asked.advance_into(log) == 5
    assert log.tobytes() == rows(session().advance(5))


def test_beyond_the_workspace_there_are_no_more_rows():
    left = session(**{"controller.law": "pd", "disturbance.load": 5.0})
    table = left.advance(5000)
    assert left.status == "left_workspace"
    assert 0 < len(table) == left.tick < 5000
    again = left.advance(100)
    assert (len(again), again.signals, left.tick) == (0, left.signals, len(table))
    assert left.t_s == pytest.approx(1e-3 * len(table))
    other = session()
    other.restore(left.snapshot())
    assert (other.status, len(other.advance(10))) == ("left_workspace", 0)


def test_what_a_law_makes_of_its_parameters_does_not_reach_the_next_run():
    law = compiled_law()
    first = simulate(scenario("hold", duration=0.2), law)
    again = simulate(scenario("hold", duration=0.2), law)
    assert rows(first.telemetry) == rows(again.telemetry)
    np.testing.assert_array_equal(law.parameters, [0.5, 0.05])


def test_a_run_says_whose_law_it_was(tmp_path):
    finished = simulate(scenario("hold", duration=0.05), compiled_law("cautious"))
    assert finished.scenario.controller.law == "cautious"
    assert finished.scenario.controller.parameters == (0.5, 0.05)
    assert "sliding_s" not in [signal.name for signal in finished.telemetry.signals]
    live, _ = recorded(path := tmp_path / "run.parquet", law=compiled_law("cautious"), ticks=20)
    assert live.scenario.controller.law == "cautious"
    assert json.loads(read_parquet(path)[1]["scenario"])["controller"]["law"] == "cautious"


NAME = "RecordingInfo:name"


def test_a_recording_is_named_by_the_law_that_ran(tmp_path):
    from rerun.chunk import RrdReader  # slow to import

    from spheretwin.viz.recording.recorder import Recorder

    live = session(compiled_law("cautious"), name="hold")
    path = tmp_path / "run.rrd"
    with Recorder(live.actuator, live.signals, facts_of(live.begun_as), path=path) as sink:
        follow(live, 20, [sink])
    batches = [chunk.to_record_batch() for chunk in RrdReader(path).stream()]
    names = [batch.column(NAME).to_pylist() for batch in batches if NAME in batch.schema.names]
    assert names == [[["hold, cautious"]]]


@pytest.mark.parametrize("law", SHIPPED)
def test_only_a_law_that_slides_logs_a_sliding_variable(law):
    names = [signal.name for signal in session(**{"controller.law": law}).signals]
    assert ("sliding_s" in names) == (law != "pd")


def constant(value):
    return lambda t, reference, measurement, parameters, state, torque: torque.fill(value)


@pytest.mark.parametrize("allocation", ["least_norm", "bounded"])
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("value", "status"),
    [(1e300, "diverged"), (np.inf, "diverged"), (1e100, "diverged"), (1e99, None), (-1e99, None),
     (1e-320, "running"), (5e-324, "running"), (0.0, "running")],
)  # fmt: skip
def test_torques_of_any_size_leave_telemetry_of_numbers(allocation, engine, value, status):
    law = Law("constant", constant(value), [], [])
    changes = {"allocation": allocation, "plant.engine": engine, "disturbance.load": 0.0}
    asked = session(law, name="hold", **changes, **{"disturbance.random_bound_Nm": 0.0})
    table = asked.advance(300)
    assert np.all(np.isfinite(table.values))
    if status:
        assert asked.status == status
        assert len(table) == (300 if status == "running" else 0)
    else:  # the whole limit in one direction: the rotor goes where the joint ends
        assert asked.status == "left_workspace"
        assert np.abs(table["current_command_A"]).max() == 8.0


@pytest.mark.parametrize("logged", [True, False])
def test_a_memory_without_end_ends_a_run_only_where_it_is_logged(logged):
    def step(t, reference, measurement, parameters, state, torque):
        torque[:] = 0.0
        state[0] = np.inf if t > 0.0095 else 1.0

    law = Law("endless", step, [], np.zeros(1), (Signal("memory", "1", 1, ""),) if logged else ())
    asked = session(law, name="hold")
    table = asked.advance(30)
    assert (asked.status, len(table)) == (("diverged", 10) if logged else ("running", 30))
    assert np.all(np.isfinite(table.values))


def test_a_shipped_law_handed_over_is_the_same_law():
    section = scenario().controller
    handed = session(section.build(Known(1e-3, 0.0, np.array(session().scenario.nominal.inertia_kg_m2))))
    assert rows(handed.advance(200)) == rows(session().advance(200))


def test_tables_of_a_session_are_its_own():
    live = session()
    first = live.advance(10)
    kept = rows(first)
    live.advance(10)
    assert rows(first) == kept
    assert isinstance(first, Table)
