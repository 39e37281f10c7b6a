"""A snapshot goes on bit for bit: here, in another process, under laws of a user's."""

import dataclasses
import pickle
import subprocess
import sys

import numpy as np
import pytest

from spheretwin.loop.inputs import BLOCK_TICKS
from spheretwin.models.base.errors import InputError
from tests.twin import session_cases as cases


@pytest.mark.parametrize("engine", cases.ENGINES)
@pytest.mark.parametrize("law", cases.SHIPPED)
@pytest.mark.parametrize("at", [0, 1, 437, BLOCK_TICKS, BLOCK_TICKS + 1])
def test_a_restored_session_goes_on_bit_for_bit(law, engine, at):
    changes = {"controller.law": law, "plant.engine": engine} | cases.WORN | cases.COMPLETE[engine]
    original = cases.session(**changes)
    original.advance(at)
    taken = original.snapshot()
    expected = cases.rows(original.advance(BLOCK_TICKS + 100))
    original.restore(taken)  # in place
    assert original.tick == at
    assert cases.rows(original.advance(BLOCK_TICKS + 100)) == expected
    other = cases.session(name="hold", **{"controller.law": "pd"})  # nothing of it may remain
    other.advance(77)
    other.restore(pickle.loads(pickle.dumps(taken)))
    assert cases.rows(other.advance(BLOCK_TICKS + 100)) == expected
    assert other.initial_scenario == original.initial_scenario


EVERY_PART = {
    "hardware": "electronics", "drive.delay_s": 2e-3, "detector.detect": True, "seed": 5,
    "plant.backlash_rad": [1e-3] * 3, "plant.stiction.on": True, "plant.thermal.on": True,
    "sensors.potentiometer.hysteresis_rad": 3e-4, "sensors.potentiometer.repeatability_rad": 5e-5,
    "sensors.encoder.start_error_rad": 0.05, "sensors.encoder.index_rad": 0.1,
    "controller.governor.acceleration_rad_s2": 5.0, "controller.prediction.on": True,
    "controller.feed_forward.friction": 0.8, "controller.feed_forward.inertia": 1.0,
}  # fmt: skip


@pytest.mark.parametrize(("law", "estimator"), [("pid", "kalman"), ("afsm", "differentiator")])
def test_every_part_goes_on_bit_for_bit_from_a_snapshot_and_past_a_change(law, estimator):
    changes = {"controller.law": law, "estimator.kind": estimator} | cases.WORN | EVERY_PART
    original, changed, other = cases.session(**changes), cases.session(**changes), cases.session(name="hold")
    original.advance(150)
    changed.advance(100)
    changed.set("plant.group_gain", [1.0] * 18)  # builds plant and controller anew
    changed.set("disturbance.load", original.scenario.disturbance.load)
    changed.advance(50)
    other.advance(11)
    restored(original, other)
    expected = cases.rows(original.advance(150))
    assert cases.rows(other.advance(150)) == expected
    assert cases.rows(changed.advance(150)) == expected


def test_a_snapshot_is_not_moved_by_what_the_session_does_next():
    original = cases.session(**cases.WORN)
    original.advance(50)
    taken = original.snapshot()
    before = pickle.dumps(taken)
    original.set("disturbance.load", 2.0)
    original.advance(1200)
    assert pickle.dumps(taken) == before
    original.restore(taken)
    original.advance(10)
    assert pickle.dumps(taken) == before


def restored(original, other):
    """Restore a session to the pickled snapshot of another one."""
    other.restore(pickle.loads(pickle.dumps(original.snapshot())))
    return other


@pytest.mark.parametrize("kind", cases.OWN)
def test_a_user_s_law_is_restored_with_its_memory_and_its_parameters(kind):
    original, other = (cases.session(cases.OWN[kind](), name="hold") for _ in range(2))
    original.advance(120)
    assert cases.same_future(original, restored(original, other), 300)
    assert other.advance(1)["calls"][0] == 421


def test_the_solver_s_warm_start_is_restored(sticky):
    original, other = (cases.session(**{"plant.mjcf": sticky}) for _ in range(2))
    original.advance(237)
    restored(original, other)
    # Equal rows alone do not show it: on some processors the solver reaches the same bits from any start.
    one, another = (each._runtime._rotor.data.qacc_warmstart for each in (original, other))
    assert np.any(one)
    assert np.array_equal(one, another)
    assert cases.same_future(original, other)


def test_a_session_that_was_changed_is_restored():
    original = cases.session(**cases.SENSED)
    original.advance(200)
    for name, value in [
        ("disturbance.load", 1.5), ("plant.payload_kg", 0.05), ("controller.law", "adaptive_fuzzy"),
        ("sensors.angle_offset_rad", [0.0, 0.01, 0.0]), ("plant.coulomb_Nm", [0.001, 0.001, 0.001]),
        ("trajectory.amplitude_rad", [0.1, 0.2, 0.1]), ("allocation", "bounded"),
    ]:  # fmt: skip
        original.set(name, value)
        original.advance(30)
    assert cases.same_future(original, restored(original, cases.session()), 1000)


CONTINUED = """
import pickle, sys
from spheretwin import scenario
from spheretwin.session import Session
other = Session(scenario.load("hold"))
other.restore(pickle.load(sys.stdin.buffer))
sys.stdout.buffer.write(other.advance(1100).values.tobytes())
"""


@pytest.mark.parametrize(
    "model",
    ["sticky", pytest.param("lagrangian", marks=pytest.mark.release("1 s; MuJoCo is in the first suite"))],
)
def test_another_process_goes_on_bit_for_bit(model, sticky):
    changes = {"plant.mjcf": sticky} if model == "sticky" else {"plant.engine": model}
    original = cases.session(**changes | cases.WORN)
    original.advance(613)
    original.set("disturbance.load", 1.0)
    taken = pickle.dumps(original.snapshot())
    done = subprocess.run([sys.executable, "-c", CONTINUED], input=taken, stdout=subprocess.PIPE, check=True)
    assert done.stdout == cases.rows(original.advance(1100))


def test_a_snapshot_under_a_law_that_is_missing_is_refused_and_nothing_changes():
    mine = cases.session(cases.plain_law(), name="hold")
    mine.advance(10)
    taken = mine.snapshot()
    for law in (None, cases.plain_law("yours")):
        other, untouched = cases.session(law, name="hold"), cases.session(law, name="hold")
        other.advance(5)
        untouched.advance(5)
        with pytest.raises(InputError, match="received one under mine"):
            other.restore(taken)
        assert cases.same_future(other, untouched)


def test_every_part_s_numbers_are_counted_before_anything_is_restored():
    """One number more or fewer anywhere: refused by name, and the session goes on as before."""
    changes = {
        "hardware": "electronics", "detector.detect": True,
        "fault": [{"target": "adc", "mode": "delay", "value": 2e-3, "start_s": 1.0}],
    }  # fmt: skip
    mine = cases.session(**changes)
    mine.advance(20)
    taken = mine.snapshot()
    expected = cases.rows(mine.advance(20))
    mine.restore(taken)
    machine = taken.runtime
    wrong = [
        (name.replace("_", " "), machine._replace(**{name: numbers}))
        for name, saved in machine._asdict().items()
        for numbers in ((saved[1:], np.append(saved, 0.0)) if name != "last" else ())
        if numbers.size != saved.size
    ]
    parts = {"run", "engine", "law parameters", "law memory", "estimator memory"}
    assert {name for name, _ in wrong} == parts
    for part, state in (
        *wrong,
        ("last command", machine._replace(last=machine.last._replace(command=np.zeros(3)))),
        ("last pose", machine._replace(last=machine.last._replace(q=np.zeros(2)))),
    ):
        with pytest.raises(InputError, match=f"snapshot with .* numbers of the {part}, received"):
            mine.restore(dataclasses.replace(taken, runtime=state))
    assert cases.rows(mine.advance(20)) == expected
