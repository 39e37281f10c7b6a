"""The plan of faults: which act at a tick, as a function of plan, seed, part and tick alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import spheretwin as tw
from spheretwin.electronics.random_streams import stream_key
from spheretwin.faults.fault import MODES, Fault
from spheretwin.faults.schedule import NEVER, FaultSchedule, part_names, part_of
from spheretwin.faults.targets import TARGETS

GROUPS, PERIOD_S = 18, 1e-3


def plan(*faults, seed=0, period_s=PERIOD_S):
    return FaultSchedule(tuple(Fault(**each) for each in faults), GROUPS, period_s, seed)


def coil(group=0, **more):
    return {"target": f"coil.{group:02d}", "mode": "open", **more}


@pytest.mark.parametrize("period_s", [1e-3, 1e-4, 3e-4, 1 / 3e3])
@pytest.mark.parametrize("tick", [0, 1, 7, 300, 12_345, 10_000_000])
def test_start_and_end_are_exact_ticks(tick, period_s):
    """Times that are ticks are those ticks, though they are products of decimal fractions; others wait."""
    for first, start_s in [
        (tick, tick * period_s),
        (tick, float(f"{tick * period_s:.10g}")),
        (tick + 1, (tick + 0.01) * period_s),
        (tick + 1, (tick + 0.99) * period_s),
    ]:
        acts = plan(coil(start_s=start_s), period_s=period_s)
        assert acts.active(first) == (0,)
        assert acts.active(first - 1) == ()
        ends = plan(coil(end_s=start_s + 1e-12 if start_s == 0 else start_s), period_s=period_s)
        if start_s:
            assert ends.active(first - 1) == (0,)
        assert ends.active(first) == ()


def test_a_fault_within_a_period_never_acts():
    assert not any(plan(coil(start_s=5.2e-3, end_s=5.8e-3)).active(tick) for tick in range(20))


def timed(kind, group, first, length):
    end = {"end_s": (first + length) * PERIOD_S} if length else {}
    return {**kind, "target": f"{kind['target']}.{group:02d}", "start_s": first * PERIOD_S, **end}


KINDS = st.just({"target": "dac", "mode": "dropout"}) | st.builds(
    lambda value: {"target": "coil", "mode": "intermittent", "value": value}, st.floats(1e-6, 0.02)
)
FAULTS = st.lists(
    st.builds(timed, KINDS, st.integers(0, 2), st.integers(0, 60), st.integers(0, 60)), max_size=5
)


@given(FAULTS, st.integers(0, 2**70))
def test_the_next_change_skips_none(faults, seed):
    """Against asking at every tick: between a tick and the next at which others may act, none do."""
    made = plan(*faults, seed=seed)
    began = [made.fault_start_s(tick).tobytes() for tick in range(120)]
    active = [made.active(tick) for tick in range(120)]
    tick = 0
    while tick < 120:
        until = made.next_change(tick)
        assert until > tick
        for between in range(tick, min(until, 120)):
            assert (active[between], began[between]) == (active[tick], began[tick])
        tick = until
    assert plan().next_change(0) == NEVER


@given(FAULTS, st.integers(0, 1000))
def test_what_acts_is_a_function_of_tick_and_part_alone(faults, seed):
    """In any order of asking, and whatever else is planned."""
    made = plan(*faults, seed=seed)
    forwards = [made.active(tick) for tick in range(80)]
    again = plan(*faults, seed=seed)
    assert [again.active(tick) for tick in range(79, -1, -1)][::-1] == forwards
    for place, each in enumerate(faults):
        alone = plan(each, seed=seed)
        assert [place in acting for acting in forwards] == [bool(alone.active(tick)) for tick in range(80)]


@pytest.mark.parametrize(("group", "seed"), [(0, 1), (0, 2), (5, 1)])
def test_a_stretch_is_whole_ticks_counted_from_the_start_of_the_run(group, seed):
    """A fair coin of the part's own for each stretch."""
    acts = plan(coil(group, mode="intermittent", value=4e-3, start_s=0.002), seed=seed)
    heads = [bool(acts.active(tick)) for tick in range(400)]
    stream = stream_key(f"coil.{group:02d} intermittent")
    coins = [np.random.default_rng([seed, stream, k]).random() < 0.5 for k in range(100)]
    assert heads[2:] == [coin for coin in coins for _ in range(4)][2:]
    assert not any(heads[:2])


def test_no_stretch_is_shorter_than_a_period():
    shortest = plan(coil(mode="intermittent", value=1e-6))
    assert {shortest.next_change(tick) - tick for tick in range(50)} == {1}


def test_marks_are_numbers_of_modes_at_the_parts_places():
    parts = part_names(GROUPS)
    assert len(set(parts)) == len(parts)
    for place, name in enumerate(parts):
        target = TARGETS[name.partition(".")[0]]
        mode = next(mode for mode, what in target.modes.items() if not what.intermittent)
        value = target.modes[mode].value
        given = {"value": 0.5} if value and value.default is None else {}
        fault = Fault(target=name, mode=mode, **given)
        assert part_of(fault, GROUPS) == place
        marks = FaultSchedule((fault,), GROUPS, PERIOD_S, 0).mode_numbers((0,))
        assert marks.nonzero()[0].tolist() == [place]
        assert MODES[int(marks[place]) - 1] == mode


def test_the_last_of_several_on_one_part_is_marked_and_all_act():
    made = plan(coil(), coil(mode="short", start_s=0.01))
    assert made.active(10) == (0, 1)
    assert made.mode_numbers((0, 1))[0] == 1 + MODES.index("short")
    assert plan(coil(reported_to_controller=True), coil(3)).reported_groups((0, 1)).nonzero()[0].tolist() == [
        0
    ]


def test_a_group_s_fault_began_when_the_last_one_did():
    faults = coil(2, start_s=0.01), {"target": "amplifier.02", "mode": "open", "start_s": 0.03}
    made = plan(*faults)
    assert plan(*faults[::-1]).fault_start_s(31)[2] == 0.03
    assert [made.fault_start_s(tick)[2] for tick in (9, 10, 29, 30, 31)] == [-1.0, 0.01, 0.01, 0.03, 0.03]
    assert np.all(np.delete(made.fault_start_s(31), 2) == -1.0)


@pytest.mark.parametrize("values", [(0.1, 0.2), (0.2, 0.1)])
def test_of_two_faults_that_set_one_signal_the_last_in_the_scenario_acts(values):
    faults = [{"target": "pot.alpha", "mode": "stuck", "value": value} for value in values]
    with tw.Session(tw.load("hold", {"fault": faults})) as session:
        assert np.all(session.advance(5)["q_measured_rad"][:, 0] == values[1])
