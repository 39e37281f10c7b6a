"""Changes that a scenario plans itself: the same as made by hand, in TOML, by flag, in replay."""

import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.models.actuator import TORQUE_CURVE_PATH
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.changes import scheduled_changes
from spheretwin.session import Session
from spheretwin.simulation import simulate
from tests.twin.session_cases import SENSED

CHANGES = [
    (50, "controller.law", "pd"),
    (100, "sensors.angle_offset_rad", [0.01, 0.0, 0.0]),
    (150, "disturbance.load", 2.0),
]
HOLD = {"duration": 0.3, "trajectory.angle_rad": [0.1, 0.0, 0.0], **SENSED}


@pytest.fixture
def planned():
    events = [{"t_s": 1e-3 * tick, "set": name, "value": value} for tick, name, value in CHANGES]
    return scenarios.load("hold", HOLD | {"event": events[::-1]})


@pytest.fixture
def by_hand():
    with Session(scenarios.load("hold", HOLD)) as session:
        tables = []
        for tick, name, value in CHANGES:
            tables.append(session.advance(tick - session.tick))
            session.set(name, value)
        return [*tables, session.advance(150)]


def chunks(session, length):
    tables = []
    while session.tick < 300:
        tables.append(session.advance(min(length, 300 - session.tick)))
    return tables


def common(tables):
    names = ("t_s", "q_rad", "qdot_rad_s", "torque_command_Nm", "current_A", "disturbance_Nm")
    return {name: np.concatenate([table[name] for table in tables]).tobytes() for name in names}


@pytest.mark.parametrize("length", [1, 7, 50, 300])
def test_an_event_is_a_change_made_by_hand_whatever_the_chunks(planned, by_hand, length):
    with Session(planned) as session:
        assert common(chunks(session, length)) == common(by_hand)
        assert session.journal == ()
        assert [change.tick for change in session.events] == [50, 100, 150]


def test_columns_are_right_before_the_rows_that_have_them(planned):
    with Session(planned) as session:
        assert len(session.advance(300)) == 50  # a law without a sliding surface ends the columns
        assert "sliding_s" not in [signal.name for signal in session.signals]
        assert len(session.advance(300)) == 50  # then there is a measurement beside the truth
        assert len(session.advance(200)) == 200  # a load changes no column


def test_an_event_at_the_start_is_in_force_at_the_first_tick():
    event = {"event": [{"t_s": 0, "set": "disturbance.load", "value": 1.0}]}
    early = simulate(scenarios.load("hold", {**event, "disturbance.load": 0.0, "duration": 0.05}))
    plain = simulate(scenarios.load("hold", {"disturbance.load": 1.0, "duration": 0.05}))
    np.testing.assert_array_equal(early.telemetry.values, plain.telemetry.values)


@pytest.mark.parametrize("at", [30, 50, 120, 160])
def test_a_snapshot_goes_on_with_the_events_to_come(planned, at):
    with Session(planned) as session, Session(planned) as other:
        while session.tick < at:
            session.advance(at - session.tick)
        other.restore(session.snapshot())
        assert common(chunks(other, 40)) == common(chunks(session, 300))


def test_replay_makes_them_again_and_nothing_twice(planned, tmp_path):
    again = tmp_path / "second.parquet"
    first = simulate(planned).save(tmp_path / "first.parquet")
    assert cli.main(["simulate", "--replay", str(first), "--telemetry", str(again)]) == 0
    assert first.read_bytes() == again.read_bytes()


def test_a_file_that_an_event_names_is_taken_from_where_it_is_written(tmp_path):
    (tmp_path / "s.toml").write_text(
        'duration = 0.15\n[trajectory]\nshape = "hold"\n'
        '[[event]]\nt_s = 0.1\nset = "plant.torque_curve"\nvalue = "weak.csv"\n'
    )
    (tmp_path / "weak.csv").write_bytes(TORQUE_CURVE_PATH.read_bytes())
    scenario = scenarios.load(str(tmp_path / "s.toml"))
    assert scenario.event[0].value == f"{tmp_path}/weak.csv"
    assert simulate(scenario).status == "completed"


@pytest.mark.parametrize("start_s", [0.0, 0.03])
def test_a_fault_that_an_event_adds_starts_when_it_says(start_s):
    fault = {"target": "coil.07", "mode": "open", "start_s": start_s}
    events = [{"t_s": 0.01, "set": "fault", "value": fault}]
    run = simulate(scenarios.load("nutation", {"duration": 0.05, "event": events}))
    conducts = run.telemetry["current_A"][:, 7] != 0
    assert conducts.tolist() == [tick < max(10, round(start_s / 1e-3)) for tick in range(50)]


def test_events_are_checked_in_the_order_of_their_times():
    slope = {"t_s": 0.2, "set": "controller.surface_slope", "value": [40.0, 40.0, 40.0]}
    law = {"t_s": 0.1, "set": "controller.law", "value": "afsm"}
    base = {"controller": {"law": "pd"}}
    assert len(scenarios.load("hold", {**base, "event": [slope, law]}).event) == 2
    with pytest.raises(InputError, match=r"surface_slope.* as event\.1 sets it"):
        scenarios.load("hold", {**base, "event": [law | {"t_s": 0.3}, slope]})


def test_an_event_between_two_ticks_acts_at_the_later_one_in_the_order_of_times():
    times_s = (3e5, 0.0108, 0.01, 0.0102)
    events = [{"t_s": t_s, "set": "disturbance.load", "value": 100 * (t_s % 1)} for t_s in times_s]
    scenario = scenarios.load("hold", {"event": events, "duration": 4e5})
    changes = scheduled_changes(scenario)
    assert [change.tick for change in changes] == [10, 11, 11, 300_000_000]
    with Session(scenario) as session:
        session.advance(20)
        assert session.scenario.disturbance.load == 100 * 0.0108
        assert [change.tick for change in session.events] == [10, 11, 11]
