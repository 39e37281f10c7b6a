"""What stands around a law, in a run: off until asked for, with any law, changed, kept and replayed."""

import dataclasses

import numba
import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.session import Session
from spheretwin.simulation import simulate

GOVERNED = ("q_governed_rad", "qdot_governed_rad_s", "qddot_governed_rad_s2")
ON = {
    "controller.governor.acceleration_rad_s2": 5.0,
    "controller.prediction.on": True,
    "controller.feed_forward.friction": 0.8,
    "controller.feed_forward.inertia": 1.0,
}
COLUMNS = (*GOVERNED, "q_predicted_rad", "qdot_predicted_rad_s", "feed_forward_Nm")

HANDED = tuple(Signal(name, "1", 3, name, ANGLES) for name in ("handed_rad", "handed_rad_s", "handed_rad_s2"))


def step(t, reference, measurement, parameters, state, torque):
    for row in range(3):
        for i in range(3):
            state[3 * row + i] = reference[row, i]
    for i in range(3):
        error, error_rate = measurement[0, i] - reference[0, i], measurement[1, i] - reference[1, i]
        torque[i] = -parameters[0] * error - parameters[1] * error_rate


MINE = Law("mine", step, [5.0, 0.2], np.zeros(9), HANDED)
LAWS = [
    pytest.param(dataclasses.replace(MINE, step=numba.njit(step)), id="compiled"),
    pytest.param(MINE, id="plain", marks=pytest.mark.uncompiled),
]


def tilt(**changes):
    fields = {"hardware": "electronics", "duration": 0.3, "trajectory.phase_s": 0.1, "controller.law": "pid"}
    return scenarios.load("tilt", fields | changes)


@pytest.mark.parametrize("mine", LAWS)
def test_every_part_works_around_it(mine):
    """What is fed forward is added, and what is governed is moved on by the delay, as what is measured is."""
    table = simulate(tilt(**ON, duration=0.05), law=mine).telemetry
    angle, rate, push = (table[name] for name in GOVERNED)
    # A fused product rounds once less.
    np.testing.assert_allclose(table["handed_rad"], angle + 1e-3 * rate + 5e-7 * push, rtol=0, atol=1e-15)
    assert np.abs(push).max() == 5.0
    error, error_rate = table["q_predicted_rad"] - table["handed_rad"], table["qdot_predicted_rad_s"]
    asked = -5.0 * error - 0.2 * (error_rate - table["handed_rad_s"])
    np.testing.assert_allclose(
        table["torque_command_Nm"], asked + table["feed_forward_Nm"], rtol=0, atol=1e-15
    )


@pytest.mark.parametrize("name", ["pd", "pid", "adaptive_fuzzy", "afsm"])
def test_the_error_of_a_run_stays_that_against_the_desired_motion(name):
    sharp = simulate(tilt(**{"controller.law": name})).telemetry
    governed = simulate(tilt(**{"controller.law": name}, **ON)).telemetry
    for column in ("q_ref_rad", "qdot_ref_rad_s"):
        np.testing.assert_array_equal(governed[column], sharp[column])
    np.testing.assert_array_equal(governed["error_rad"], governed["q_rad"] - governed["q_ref_rad"])
    assert (governed["q_rad"] != sharp["q_rad"]).any()
    assert not set(COLUMNS) & {signal.name for signal in sharp.signals}
    assert set(COLUMNS) <= {signal.name for signal in governed.signals}


def test_it_is_set_on_the_way_and_leaves_the_law_what_it_learnt():
    with Session(tilt()) as session:
        session.advance(50)
        law_before = session.law
        for name, value in ON.items():
            session.set(name, value)
            # Only with the prediction a law is told of another delay, and a PID remembers over that.
            assert (session.law is law_before) == (name != "controller.prediction.on")
            law_before = session.law
        table = session.advance(50)
        assert set(COLUMNS) <= {signal.name for signal in table.signals}
        session.set("controller.law", "afsm")
        assert set(COLUMNS) <= {signal.name for signal in session.advance(10).signals}


@pytest.mark.parametrize("mine", LAWS)
def test_it_is_set_around_a_law_of_a_user_s_too(mine):
    with Session(tilt(), mine) as session:
        for name, value in ON.items():
            session.set(name, value)
        assert session.law is mine
        assert session.scenario.controller.law == "mine"
        assert set(COLUMNS) <= {signal.name for signal in session.advance(5).signals}
        with pytest.raises(InputError, match="expected no field of a shipped law"):
            session.set("controller.stiffness", 3.0)
