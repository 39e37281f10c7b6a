"""Faults in sessions: the same bytes at any chunks, restored, in threads, by hand, by event and replayed."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.faults.targets import TARGETS
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.session import Session
from spheretwin.simulation import simulate
from tests.twin.session_cases import recorded

TICKS = 1500
PLAN = [
    {"target": "amplifier.02", "mode": "noise", "value": 0.2},
    {"target": "pot.alpha", "mode": "noise", "value": 1e-3, "start_s": 0.1},
    {"target": "pot.beta", "mode": "stuck", "start_s": 0.35, "end_s": 0.352},
    {"target": "coil.04", "mode": "intermittent", "value": 0.011, "reported_to_controller": True},
    {"target": "coil.06", "mode": "open", "start_s": 0.2},
    {"target": "coil.11", "mode": "short", "start_s": 0.4, "end_s": 0.9},
    {"target": "coil.12", "mode": "gain", "value": 0.5, "start_s": 0.6},
    {"target": "encoder.gamma", "mode": "intermittent", "value": 2e-3, "start_s": 0.7, "end_s": 0.8},
    {"target": "adc", "mode": "noise", "value": 1e-3, "start_s": 0.3},
    {"target": "adc", "mode": "delay", "value": 1e-3, "start_s": 1.0},
    {"target": "dac.09", "mode": "stuck", "start_s": 0.5, "end_s": 1.2},
    {"target": "supply", "mode": "noise", "value": 2.0, "end_s": 1.1},
    {"target": "controller", "mode": "intermittent", "value": 1e-3, "start_s": 1.1, "end_s": 1.2},
]


def scenario(hardware="electronics", **changes):
    return scenarios.load(
        "nutation",
        {
            "hardware": hardware, "seed": 6, "fault": PLAN,
            "detector.detect": True, "watchdog.stale_ticks": 50, "duration": TICKS * 1e-3,
            **changes,
        },
    )  # fmt: skip


@pytest.fixture(scope="module")
def whole():
    """Rows of a run in one piece."""
    with Session(scenario()) as session:
        values = session.advance(TICKS).values
        assert session.status == "running"
    return values


@pytest.mark.parametrize("length", [1, 7, 333, 1000])
def test_chunks_move_no_bit(whole, length):
    with Session(scenario()) as session:
        pieces = [session.advance(min(length, TICKS - tick)).values for tick in range(0, TICKS, length)]
    assert np.concatenate(pieces).tobytes() == whole.tobytes()


def test_another_seed_is_another_run(whole):
    assert simulate(scenario(seed=7)).telemetry.values.tobytes() != whole.tobytes()


@settings(max_examples=25)
@given(st.integers(0, TICKS - 1), st.integers(0, 300))
def test_a_snapshot_goes_on_with_all_that_is_wrong(whole, tick, further):
    """Pickled, into a session that was elsewhere meanwhile."""
    with Session(scenario()) as session, Session(scenario(hardware="ideal", fault=[])) as other:
        session.advance(tick)
        snapshot = pickle.dumps(session.snapshot())
        session.advance(further)
        other.advance(10)
        for restored in (session, other):
            restored.restore(pickle.loads(snapshot))
            after = restored.advance(min(TICKS - tick, 200)).values
            assert after.tobytes() == whole[tick : tick + 200].tobytes()


EVERY = [(target.name, mode) for target in TARGETS.values() for mode in target.modes]
START = 120


def fault(kind, mode):
    value = TARGETS[kind].modes[mode].value
    needed = {"value": 0.02 if kind != "pot" else 1e-3} if value and value.default is None else {}
    return {"target": TARGETS[kind].names(18)[-1], "mode": mode, **needed}


def same_columns(one, other, ticks=slice(None)):
    """Names of the columns of one that are not the same in the other, which has them all."""
    return [
        signal.name for signal in one.signals
        if one[signal.name][ticks].tobytes() != other[signal.name][ticks].tobytes()
    ]  # fmt: skip


@pytest.mark.parametrize("hardware", ["electronics", "ideal"])
@pytest.mark.parametrize(("kind", "mode"), EVERY)
def test_by_hand_or_by_event_is_as_planned(kind, mode, hardware):
    """And before its start, a planned one leaves every bit of a healthy run's columns as it is.

    By hand also after a restore. Then columns of faults come with the first fault. Of a delay, only a
    planned one has kept what was on its way: by hand the first rows are those of the value that repeats.
    """
    if TARGETS[kind].needs_supply and hardware == "ideal":
        return
    none = {"hardware": hardware, "fault": [], "detector.detect": False, "duration": 0.2}
    start_s = START * 1e-3
    event = {"t_s": start_s, "set": "fault", "value": fault(kind, mode)}
    with (
        Session(scenario(**{**none, "fault": [{**fault(kind, mode), "start_s": start_s}]})) as planned,
        Session(scenario(**none)) as by_hand,
        Session(scenario(**{**none, "event": [event]})) as by_event,
        Session(scenario(**none)) as restored,
    ):
        expected = planned.advance(START), planned.advance(80)
        for session in (by_hand, by_event):
            before = session.advance(START)
            assert len(before) == START
            assert same_columns(before, expected[0]) == []
        restored.restore(pickle.loads(pickle.dumps(by_hand.snapshot())))
        for session in (by_hand, restored, by_event):
            if session is not by_event:
                session.set("fault", fault(kind, mode))
            after = session.advance(80)
            assert after.signals == expected[1].signals
            if mode == "delay":
                assert after["fault"].tobytes() == expected[1]["fault"].tobytes()
                assert np.isfinite(after.values).all()
            else:
                assert same_columns(after, expected[1]) == []


@pytest.mark.parametrize("hardware", ["electronics", "ideal"])
def test_an_end_by_hand_is_a_planned_end(hardware):
    given = [
        {"target": "coil.03", "mode": "open", "reported_to_controller": True},
        {"target": "amplifier.08", "mode": "offset", "value": 0.4},
    ]
    fields = {"hardware": hardware, "detector.detect": False, "duration": 0.2}
    ended = [{**each, "end_s": 0.1} for each in given]
    with (
        Session(scenario(**fields, fault=ended)) as planned,
        Session(scenario(**fields, fault=given)) as by_hand,
        Session(scenario(**fields, fault=given)) as removed,
        Session(scenario(**fields, fault=[])) as healthy,
    ):
        first, then = planned.advance(100), planned.advance(60)
        for session in (by_hand, removed):
            assert session.advance(100).values.tobytes() == first.values.tobytes()
        for place in (0, 1):
            by_hand.set(f"fault.{place}.end_s", by_hand.t_s)
        assert by_hand.advance(60).values.tobytes() == then.values.tobytes()
        removed.set("fault", [])
        after = removed.advance(60)
        assert after.signals == healthy.signals
        assert same_columns(after, then) == []


def test_a_run_of_faults_set_on_the_way_is_replayed(tmp_path):
    path, again = tmp_path / "a.parquet", tmp_path / "b.parquet"
    changes = [
        (100, "fault", {"target": "amplifier.03", "mode": "stuck"}),
        (200, "fault", {"target": "adc", "mode": "noise", "value": 1e-3, "end_s": 0.28}),
        (250, "fault.0.end_s", 0.25),
        (300, "fault", []),
    ]
    recorded(path, changes, ticks=350, name="nutation", hardware="electronics")
    assert cli.main(["simulate", "--replay", str(path), "--telemetry", str(again)]) == 0
    assert again.read_bytes() == path.read_bytes()
    marks = read_parquet(path)[0]["fault"]
    assert np.isnan(marks).any() or not marks[0].any()
    assert np.count_nonzero(np.nansum(marks, axis=1)) == 180
