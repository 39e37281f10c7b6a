"""Currents by hand: those that were asked for, the law asked for nothing, and everything else as it was."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.manual_currents import Manual, command_manual_currents
from spheretwin.models.base.errors import InputError
from spheretwin.session import Session
from spheretwin.simulation import simulate

CURRENTS = [0.1 * (-1) ** group * group for group in range(18)]
FAST = {"plant.engine": "lagrangian", "disturbance.random_bound_Nm": 0.0, "disturbance.load": 0.0}


def by_hand(**changes):
    return simulate(
        scenarios.load("sinusoid", FAST | {"duration": 0.05, "manual.currents_A": CURRENTS} | changes)
    )


def test_each_group_is_commanded_its_current_and_the_law_is_not_called():
    rows = by_hand().telemetry
    np.testing.assert_array_equal(rows["current_command_A"], np.tile(CURRENTS, (50, 1)))
    np.testing.assert_array_equal(rows["torque_command_Nm"], 0.0)
    np.testing.assert_array_equal(rows["allocation_scale"], 1.0)
    assert np.abs(rows["torque_Nm"]).max() > 0.0


def test_no_group_is_commanded_more_than_the_limit():
    command = np.empty(3)
    share = command_manual_currents(Manual(True, np.array([0.5, -4.0, 10.0])), 2.0, command)
    np.testing.assert_array_equal(command, [0.5, -2.0, 2.0])
    assert share == 0.2
    rows = by_hand(**{"nominal.current_limit_A": 0.4}).telemetry
    np.testing.assert_array_equal(rows["current_command_A"][0], np.clip(CURRENTS, -0.4, 0.4))
    np.testing.assert_array_equal(rows["allocation_scale"], 0.4 / max(map(abs, CURRENTS)))


def test_the_drive_stands_between_command_and_current_as_ever():
    rows = by_hand(**{"drive.current_limit_A": 0.5, "nominal.current_limit_A": 8.0}).telemetry
    assert np.abs(rows["current_A"]).max() <= 0.5
    assert rows["current_command_A"][0, 17] == CURRENTS[17]


@pytest.mark.parametrize("law", ["pd", "pid", "afsm", "adrc"])
def test_a_law_that_takes_over_again_begins_anew(law):
    """After a while by hand, it asks for what it would at the start of a run from that pose."""
    with Session(scenarios.load("hold", FAST | {"controller.law": law})) as session:
        session.advance(200)
        session.set("manual.currents_A", [0.0] * 18)
        session.advance(30)
        pose, rates = session.q_rad, session.qdot_rad_s
        session.set("manual.currents_A", None)
        rows = session.advance(20)
    started = FAST | {
        "controller.law": law,
        "plant.initial_rad": pose.tolist(),
        "plant.initial_rad_s": rates.tolist(),
    }
    with Session(scenarios.load("hold", started)) as fresh:
        again = fresh.advance(20)
    # The currents of both are 0 to 1e-19 A after 30 ms, and the laws know no absolute time.
    np.testing.assert_allclose(rows["torque_command_Nm"], again["torque_command_Nm"], rtol=1e-9, atol=1e-12)


def test_other_currents_by_hand_leave_the_law_where_it_was():
    with Session(scenarios.load("hold", FAST | {"controller.law": "pid"})) as session:
        session.set("manual.currents_A", [0.0] * 18)
        first = session.advance(3)
        session.set("manual.currents_A", CURRENTS)
        second = session.advance(3)
    logged = first.signals[12:]
    assert second.signals == first.signals
    for signal in logged:
        np.testing.assert_array_equal(second[signal.name], first[signal.name])


def test_a_list_that_does_not_fit_is_refused():
    with pytest.raises(InputError, match=r"expected manual\.currents_A for 18 groups, received 2"):
        Session(scenarios.load("hold", {"manual.currents_A": [0.0, 1.0]}))
    with pytest.raises(InputError, match="currents_A"):
        scenarios.load("hold", {"manual.currents_A": [np.nan] * 18})


def test_a_snapshot_by_hand_goes_on_as_it_did():
    with Session(scenarios.load("hold", FAST)) as session:
        session.advance(20)
        session.set("manual.currents_A", CURRENTS)
        session.advance(7)
        before = session.snapshot()
        first = session.advance(30)
        session.set("manual.currents_A", None)
        session.restore(before)
        assert session.advance(30).values.tobytes() == first.values.tobytes()
