"""What is set on the way acts from its tick on, or is refused and changes nothing."""

import json

import numpy as np
import pytest

from spheretwin.loop.inputs import BLOCK_TICKS
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.run_record import Change
from spheretwin.models.telemetry.signals import common_signals
from tests.twin import session_cases as cases

SIGNALS = [signal.name for signal in common_signals(18)]

LIMITED = {"nominal.current_limit_A": 0.4}
KINDS = [
    ("controller.surface_slope", 70.0, {}),
    ("controller.law", "pd", {}),
    ("controller.law", "adaptive_fuzzy", {}),
    ("controller.level", "torque", {}),
    ("disturbance.load", 1.5, {}),
    ("disturbance.random_bound_Nm", 0.2, {}),
    ("trajectory.amplitude_rad", [0.1, 0.2, 0.1], {}),
    ("trajectory", {"shape": "hold", "angle_rad": [0.1, 0.0, 0.0]}, {}),
    ("nominal.torque_scale", 0.5, {}),
    ("nominal.inertia_kg_m2", [3e-3, 3e-3, 3e-3], {}),
    ("nominal.current_limit_A", 0.5, {}),
    ("allocation", "bounded", LIMITED),
    ("drive.current_limit_A", 0.5, {}),
    ("drive.time_constant_s", 0.0, {}),
    ("plant.payload_kg", 0.05, {}),
    ("plant.gravity_m_s2", 0.0, {"plant.payload_kg": 0.05}),
    ("plant.modelling_error", 0.3, {}),
    ("plant.modelling_torque_Nm", [0.01, 0.0, 0.0], {}),
    ("plant.group_gain", [0.0] + 17 * [1.0], {}),
    ("plant.coulomb_Nm", [0.004, 0.004, 0.004], {}),
]
OF_KINDS = [
    *((engine, *row) for engine in cases.ENGINES for row in KINDS),
    ("mujoco", "sensors.angle_offset_rad", [0.0, 0.01, 0.0], cases.SENSED),
]


@pytest.mark.parametrize(("engine", "name", "value", "base"), OF_KINDS, ids=map(str, range(len(OF_KINDS))))
def test_a_change_acts_from_its_tick_on_and_not_before(engine, name, value, base):
    at, changes = 40 if base is LIMITED else 340, {"plant.engine": engine, "disturbance.load": 1.0} | base
    unchanged, changed = cases.session(**changes), cases.session(**changes)
    before = changed.advance(at)
    changed.set(name, value)
    after, expected = changed.advance(60), unchanged.advance(at + 60)
    assert cases.rows(before) == cases.rows(expected.rows(0, at))
    assert after["t_s"][0] == expected["t_s"][at]
    # Where the rotor is is what was before; what acts on it from this tick on, or the next, is not.
    np.testing.assert_array_equal(after["q_rad"][0], expected["q_rad"][at])
    np.testing.assert_array_equal(after["qdot_rad_s"][0], expected["qdot_rad_s"][at])
    assert [c for c in SIGNALS if not np.array_equal(after[c][:2], expected[c][at : at + 2])]
    assert changed.journal == (Change(at, name, value),)


@pytest.mark.parametrize("kind", cases.OWN)
def test_a_law_object_may_replace_a_shipped_one_and_back(kind):
    changed = cases.session(name="hold")
    changed.advance(100)
    changed.set("controller.law", cases.OWN[kind]())
    table = changed.advance(50)
    np.testing.assert_array_equal(table["calls"], np.arange(1, 51))
    assert changed.scenario.controller.law == "mine"
    assert changed.initial_scenario.controller.law == "afsm"
    assert changed.journal == (Change(100, "controller.law", "mine"),)
    with pytest.raises(InputError, match="shipped law"):
        changed.set("controller.reaching_gain", 5.0)
    changed.set("controller.law", "pd")
    assert "calls" not in [signal.name for signal in changed.advance(5).signals]
    assert changed.scenario.controller.law == "pd"


@pytest.mark.parametrize(
    ("law", "changes"),
    [
        (cases.compiled_law(), {"name": "hold"}),
        *((None, {"plant.engine": engine} | cases.WORN) for engine in cases.ENGINES),
    ],
    ids=["law with a memory", *cases.ENGINES],
)
def test_a_limit_that_is_never_met_may_move_without_a_trace(law, changes):
    """What a law has made of its parameters belongs to it as its memory does; so if it is set once more."""
    unchanged, changed = cases.session(law, **changes), cases.session(law, **changes)
    for _ in range(4):
        changed.advance(150)
        changed.set("drive.current_limit_A", 7.0 + changed.tick / 1e3)
        changed.set("controller.law", law or "afsm")
    expected = unchanged.advance(1000)
    assert np.abs(expected["current_command_A"]).max() < 7.0
    assert cases.rows(changed.advance(400)) == cases.rows(expected.rows(600, 1000))


def test_a_change_of_the_plant_keeps_the_solver_s_warm_start(sticky):
    unchanged, changed = cases.session(**{"plant.mjcf": sticky}), cases.session(**{"plant.mjcf": sticky})
    changed.advance(150)
    changed.set("plant.group_gain", [1.0] * 18)  # what it is when not given
    assert cases.rows(changed.advance(200)) == cases.rows(unchanged.advance(350).rows(150, 350))


SAME = [
    ("controller.law", "afsm"), ("controller.surface_slope", 50.0), ("disturbance.load", 1.0),
    ("disturbance.load", 1), ("disturbance.random_bound_Nm", 0.05), ("trajectory.frequency_Hz", 0.5),
    ("allocation", "least_norm"), ("nominal.torque_scale", 1.0), ("nominal.torque_curve", None),
    ("drive.current_limit_A", 8.0), ("plant.payload_kg", 0.0), ("plant.modelling_error", 0.2),
    ("plant.gravity_m_s2", 9.81), ("plant.gravity_m_s2", None), ("nominal.current_limit_A", None),
    ("nominal.inertia_kg_m2", None), ("plant.coulomb_Nm", [0.004, 0.003, 0.002]),
    ("plant.coulomb_Nm", np.array([0.004, 0.003, 0.002])),
]  # fmt: skip


@pytest.mark.parametrize("engine", cases.ENGINES)
def test_a_change_to_what_is_changes_no_bit(engine, sticky):
    offset = (0.01, -0.02, 0.005) if engine == "mujoco" else (0.0, 0.0, 0.0)
    model = {"plant.mjcf": sticky, **cases.SENSED} if engine == "mujoco" else {}
    changes = {"plant.engine": engine, "disturbance.load": 1.0, "sensors.angle_offset_rad": offset}
    changes |= model | cases.WORN
    same = [*SAME, ("sensors.angle_offset_rad", offset)]
    unchanged, changed = cases.session(**changes), cases.session(**changes)
    table = [changed.advance(130)]
    for name, value in same:
        changed.set(name, value)
        table.append(changed.advance(47))
    assert b"".join(map(cases.rows, table)) == cases.rows(unchanged.advance(130 + 47 * len(same)))
    assert [change.name for change in changed.journal] == [name for name, _ in same]
    assert changed.scenario == unchanged.scenario


@pytest.mark.parametrize("at", [1, 500, BLOCK_TICKS, BLOCK_TICKS + 1])
def test_a_change_of_the_disturbance_does_not_touch_the_random_stream(at):
    unchanged, changed = cases.session(), cases.session()
    changed.advance(at)
    changed.set("disturbance.load", 2.0)
    after = changed.advance(2 * BLOCK_TICKS)["disturbance_Nm"]
    expected = unchanged.advance(at + 2 * BLOCK_TICKS)["disturbance_Nm"][at:]
    # 0.05 N·m more, and the same draws: three sums up to 0.15 N·m, each of which rounds by 1.4e-17.
    np.testing.assert_allclose(after - 0.05, expected, rtol=0, atol=4.2e-17)
    changed.set("disturbance.load", 1.0)
    after, expected = (each.advance(2 * BLOCK_TICKS)["disturbance_Nm"] for each in (changed, unchanged))
    np.testing.assert_array_equal(after, expected)


@pytest.mark.parametrize("engine", cases.ENGINES)
def test_a_change_that_is_none_is_refused_and_nothing_changes(engine):
    changed, unchanged = cases.session(**{"plant.engine": engine}), cases.session(**{"plant.engine": engine})
    for each in (changed, unchanged):
        each.advance(120)
        each.set("disturbance.load", 1.0)
    for name, value in cases.REFUSED:
        if (engine, value) != ("mujoco", "Euler"):
            with pytest.raises(InputError):
                changed.set(name, value)
    assert cases.same_future(changed, unchanged)
    assert changed.law.name == "afsm"


def test_the_journal_keeps_the_value_that_was_given_then():
    gains = [1.0] * 18
    changed = cases.session()
    changed.set("plant.group_gain", gains)
    gains[0] = 0.0
    changed.set("trajectory", shape := {"shape": "hold", "angle_rad": np.array([0.1, 0.0, 0.0])})
    shape["shape"] = "tilt"
    assert changed.journal[0].value == [1.0] * 18
    assert changed.journal[1].value == {"shape": "hold", "angle_rad": [0.1, 0.0, 0.0]}
    json.dumps(changed.journal)
