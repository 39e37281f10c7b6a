"""How a session ends, and what it refuses."""

import numpy as np
import pytest

from spheretwin.control.law import Law, NominalModel
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import Signal
from spheretwin.simulation import simulate
from tests.twin.session_cases import ENGINES, compiled_law, rows, scenario, session


def raising(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0
    if t > 0.0205:
        raise ValueError("lost")


def test_a_law_that_raises_ends_the_session_until_it_is_restored():
    broken = session(Law("raising", raising, [], []), name="hold")
    assert len(broken.advance(10)) == 10
    taken = broken.snapshot()
    assert len(broken.advance(100)) == 11  # to the tick at 20 ms
    assert broken.status == "diverged"
    assert str(broken.law_error) == "law raising: expected a torque at 0.021 s, received ValueError: lost"
    assert len(broken.advance(100)) == 0
    broken.restore(taken)
    assert (broken.status, broken.tick) == ("running", 10)
    assert len(broken.advance(11)) == 11


def test_rows_of_another_shape_or_type_are_refused():
    """Compiled code would write outside them."""
    live = session()
    columns = live.advance(0).values.shape[1]
    for log in (
        np.empty((5, columns - 1)), np.empty((5, columns + 1)), np.empty(columns), np.empty((5, columns, 1)),
        np.empty((5, columns), dtype=np.float32), np.empty((columns, 5)).T, [[1.0]], None,
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"contiguous, writeable rows of {columns} float64"):
            live.advance_into(log)
    assert live.tick == 0
    log = np.empty((5, columns))
    assert live.advance_into(log) == 5
    assert log.tobytes() == rows(session().advance(5))


def test_beyond_the_workspace_there_are_no_more_rows():
    left = session(**{"controller.law": "pd", "disturbance.load": 5.0})
    table = left.advance(5000)
    assert left.status == "left_workspace"
    assert 0 < len(table) == left.tick < 5000
    assert np.abs(table["q_rad"][:, :2]).max() <= np.radians(80)
    again = left.advance(100)
    assert (len(again), again.signals, left.tick) == (0, left.signals, len(table))
    assert left.t_s == pytest.approx(1e-3 * len(table))
    other = session()
    other.restore(left.snapshot())
    assert (other.status, len(other.advance(10))) == ("left_workspace", 0)


def test_what_a_law_makes_of_its_numbers_does_not_reach_the_next_run():
    law = compiled_law("cautious")
    first, again = (simulate(scenario("hold", duration=0.2), law=law) for _ in range(2))
    assert rows(first.telemetry) == rows(again.telemetry)
    np.testing.assert_array_equal(law.parameters, [0.5, 0.05])
    np.testing.assert_array_equal(law.state, 0)
    recorded = first.scenario.controller
    assert (recorded.law, recorded.parameters) == ("cautious", (0.5, 0.05))


def constant(value):
    return lambda t, reference, measurement, parameters, state, torque: torque.fill(value)


@pytest.mark.parametrize("allocation", ["least_norm", "bounded"])
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("value", "status"),
    [
        (np.nan, "diverged"), (np.inf, "diverged"), (1e300, "diverged"), (1e100, "diverged"), (1e99, None),
        (-1e99, None), (1e-320, "running"), (5e-324, "running"), (0.0, "running"),
    ],
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
    known = NominalModel(1e-3, 0.0, np.array(session().scenario.nominal.inertia_kg_m2))
    handed = session(scenario().controller.build(known))
    assert rows(handed.advance(200)) == rows(session().advance(200))
