"""State that a user sets between chunks: the motion goes on from it, and is replayed."""

import json

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.session import Session
from spheretwin.simulation import simulate

POSE, RATES, CURRENTS = [0.3, -0.2, 1.0], [1.0, -2.0, 3.0], np.linspace(-1, 1, 18)


@pytest.fixture(params=["mujoco", "lagrangian"])
def scenario(request):
    return scenarios.load("hold", {"plant.engine": request.param, "controller.law": "pd", "duration": 0.1})


def test_the_motion_goes_on_from_it(scenario):
    with Session(scenario) as session:
        session.advance(20)
        session.set_state(POSE, RATES, CURRENTS)
        row = session.advance(1)
    np.testing.assert_array_equal(row["q_rad"][0], POSE)
    np.testing.assert_array_equal(row["qdot_rad_s"][0], RATES)
    # The lag of the coils starts from these currents: their mean over half a period is nearer to them than
    # to the command.
    apart = np.abs(row["current_A"][0] - CURRENTS)
    assert np.all(apart < np.abs(row["current_command_A"][0] - CURRENTS))


def test_what_is_not_given_stays(scenario):
    with Session(scenario) as session:
        session.advance(20)
        q_rad = session.q_rad
        session.set_state(qdot_rad_s=RATES)
        np.testing.assert_array_equal(session.q_rad, q_rad)
        np.testing.assert_array_equal(session.qdot_rad_s, RATES)


def test_a_state_set_at_the_start_is_the_start_of_a_scenario(scenario):
    changes = {
        "plant.initial_rad": POSE,
        "plant.initial_rad_s": RATES,
        "trajectory.angle_rad": [0.1, 0.1, 0.1],
    }
    fields = {"plant.engine": scenario.plant.engine, "controller.law": "pd", "duration": 0.1}
    expected = simulate("hold", fields | changes).telemetry
    with Session(scenarios.load("hold", fields | {"trajectory.angle_rad": [0.1, 0.1, 0.1]})) as session:
        session.set_state(POSE, RATES)
        np.testing.assert_array_equal(session.advance(100).values, expected.values)


def test_it_is_an_entry_of_the_journal(scenario):
    with Session(scenario) as session:
        session.advance(20)
        session.set_state(q_rad=POSE, current_A=CURRENTS)
        (change,) = session.journal
        after = session.advance(30).values
    assert (change.tick, change.name) == (20, "state")
    assert json.loads(json.dumps(change.value)) == {"q_rad": POSE, "current_A": CURRENTS.tolist()}
    with Session(scenario) as session:
        session.advance(20)
        session.set(change.name, change.value)
        assert session.advance(30).values.tobytes() == after.tobytes()
