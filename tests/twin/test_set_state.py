"""State that a user sets between chunks: the motion goes on from it, and is replayed."""

import json

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.session import Session
from spheretwin.simulation import simulate

POSE, RATES, CURRENTS = [0.3, -0.2, 1.0], [1.0, -2.0, 3.0], np.linspace(-1, 1, 18)


FIELDS = {"controller.law": "pd", "duration": 0.1, "trajectory.angle_rad": [0.1, 0.1, 0.1]}


@pytest.fixture(params=["mujoco", "lagrangian"])
def fields(request):
    return FIELDS | {"plant.engine": request.param}


def test_the_motion_goes_on_from_it_and_it_is_an_entry_of_the_journal(fields):
    with Session(scenarios.load("hold", fields)) as session:
        session.advance(20)
        session.set_state(POSE, RATES, CURRENTS)
        (change,) = session.journal
        rows = session.advance(30)
        q_rad = session.q_rad
        session.set_state(qdot_rad_s=RATES)
        np.testing.assert_array_equal(session.q_rad, q_rad)  # what is not given stays
        np.testing.assert_array_equal(session.qdot_rad_s, RATES)
    np.testing.assert_array_equal(rows["q_rad"][0], POSE)
    np.testing.assert_array_equal(rows["qdot_rad_s"][0], RATES)
    # The lag of the coils starts from these currents: their mean over half a period is nearer to them than
    # to the command.
    apart = np.abs(rows["current_A"][0] - CURRENTS)
    assert np.all(apart < np.abs(rows["current_command_A"][0] - CURRENTS))
    assert (change.tick, change.name) == (20, "state")
    expected = {"q_rad": POSE, "qdot_rad_s": RATES, "current_A": CURRENTS.tolist()}
    assert json.loads(json.dumps(change.value)) == expected
    with Session(scenarios.load("hold", fields)) as session:
        session.advance(20)
        session.set(change.name, change.value)
        assert session.advance(30).values.tobytes() == rows.values.tobytes()


def test_a_state_set_at_the_start_is_the_start_of_a_scenario(fields):
    start = {"plant.initial_rad": POSE, "plant.initial_rad_s": RATES}
    expected = simulate("hold", fields | start).telemetry
    with Session(scenarios.load("hold", fields)) as session:
        session.set_state(POSE, RATES)
        np.testing.assert_array_equal(session.advance(100).values, expected.values)
