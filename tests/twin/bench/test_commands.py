"""Commands of a bench: their effects, their refusals, and that no command ends the bench."""

import re
import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin import scenario as scenarios
from spheretwin.bench import Bench
from spheretwin.bench.command_queue import MOST_WAITING, Queue, QueuedCommand
from spheretwin.bench.commands import COMMANDS, documentation
from spheretwin.models.base.errors import SpheretwinError
from tests.twin.bench.cases import MODES, begun, done, paused, said


@pytest.fixture(scope="module")
def common():
    with begun() as made:
        yield made


def test_the_documentation_lists_every_command():
    assert documentation() in Bench.__doc__
    assert all(f"``{name}``" in documentation() and command.text for name, command in COMMANDS.items())


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
NAMES = st.sampled_from([*COMMANDS, "nonsense"]).filter(lambda name: name not in ("record", "save"))
ARGUMENTS = sorted({field for kind in COMMANDS.values() for field in kind.arguments.model_fields} - {"name"})


@settings(max_examples=150)
@given(NAMES, st.dictionaries(st.sampled_from(ARGUMENTS), ANYTHING, max_size=2), ANYTHING)
def test_the_bench_survives_any_command(common, name, arguments, field):
    common.command(name, **arguments)
    if isinstance(field, str):
        common.command("set", name=field, value=1.0)
    common.advance(1)
    assert isinstance(common.state().tick, int)


def test_a_flood_of_moves_is_the_last_of_them(made):
    tickets = [made.command("set", name="disturbance.load", value=i * 1e-3) for i in range(1000)]
    others = [made.command("jog", rates_rad_s=[0, 0, i * 1e-3]) for i in range(1000)]
    assert len({id(ticket) for ticket in tickets}) == 1000
    made.advance(1)
    assert all(ticket.done and ticket.refused is None for ticket in tickets + others)
    assert made.state().journal == 2
    fields = {name: value for name, value, _ in made.fields()}
    assert fields["disturbance.load"] == 0.999
    assert fields["trajectory.shape"] == "sinusoid"
    made.advance(2000)
    assert made.state().qdot_ref_rad_s == (0.0, 0.0, 0.999)


def test_the_queue_is_bounded(made):
    tickets = [made.command("step") for _ in range(MOST_WAITING + 5)]
    assert [bool(ticket.refused) for ticket in tickets[-6:]] == [False] + 5 * [True]
    assert made.state().waiting <= MOST_WAITING
    made.advance(0)
    assert all(ticket.done for ticket in tickets)


def test_the_last_command_is_executed_last(made):
    for name in ("hold", "off", "hold"):
        made.command(name)
    made.advance(1)
    assert made.state().mode == "hold"


def test_a_fixed_field_waits_for_the_reset():
    with begun(plant__engine="mujoco") as made:
        made.advance(5)
        done(made, "set", name="controller.period_s", value=2e-3)
        done(made, "set", name="hardware", value="electronics")
        assert made.state().pending == (("controller.period_s", "0.002"), ("hardware", '"electronics"'))
        assert made.state().period_s == 1e-3
        done(made, "reset")
        assert (made.state().pending, made.state().period_s, made.state().tick) == ((), 2e-3, 0)
        named = scenarios.load("sinusoid", {"hardware": "electronics"})
        fields = {name: value for name, value, _ in made.fields()}
        assert fields["estimator.kind"] == named.estimator.kind
        assert fields["drive.supply_V"] == named.drive.supply_V


def test_faults_are_cleared_by_their_place_and_all_at_once():
    with begun(plant__engine="mujoco") as made:
        for group, start_s in ((7, 0.0), (3, 9.0), (4, 9.0)):
            done(made, "add_fault", fault={"target": f"coil.{group:02d}", "mode": "open", "start_s": start_s})
        done(made, "clear_faults", place=0)
        assert made.state().faults == ("coil.03 open from 9 s", "coil.04 open from 9 s")
        done(made, "clear_faults")
        assert made.state().faults == ()


def test_a_run_that_ends_leaves_a_bench_that_a_reset_brings_back(made):
    done(made, "set", name="disturbance.load", value=3.0)
    done(made, "off")
    made.advance(4000)
    state = made.state()
    assert (state.mode, state.status, state.running) == ("fault", "left_workspace", False)
    assert "end of its range" in state.reason
    for name, arguments in [*MODES.items(), ("start", {}), ("step", {"ticks": 1})]:
        assert "expected reset, as the run has ended" in said(made, name, **arguments)
    assert not made.state().running
    done(made, "set", name="disturbance.load", value=0.0)
    assert made.state().pending == (("disturbance.load", "0.0"),)
    done(made, "reset")
    done(made, "start")
    assert made.advance(100) == 100
    assert (made.state().mode, made.state().reason) == ("trajectory", None)


@pytest.mark.parametrize("reset", [False, True])
def test_a_snapshot_brings_back_a_run_that_has_ended_and_one_before_a_reset(made, reset):
    made.advance(50)
    done(made, "point", **MODES["point"])
    made.advance(50)
    done(made, "snapshot")
    made.advance(100)
    there = made.state()
    done(made, "set", name="disturbance.load", value=5.0)
    done(made, "off")
    made.advance(4000)
    assert made.state().mode == "fault"
    if reset:
        done(made, "set", name="controller.law", value="pd")
        done(made, "reset")
    done(made, "restore")
    done(made, "start")
    assert made.advance(100) == 100
    state = made.state()
    assert (state.mode, state.law, state.pending) == ("point", "afsm", ())
    assert (state.tick, state.q_rad, state.current_A) == (there.tick, there.q_rad, there.current_A)
    done(made, "stop")
    assert "after STOP" in said(made, "restore")


BROKEN = """
def broken(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0 if t <= 0.005 else [][3]
"""


@pytest.mark.uncompiled
def test_a_law_that_raises_is_a_fault_that_says_why(made, tmp_path):
    (tmp_path / "law.py").write_text(BROKEN)
    assert "law.py" in said(made, "set", name="controller.law", value=f"{tmp_path / 'law.py'}:Nobody")
    done(made, "set", name="controller.law", value=f"{tmp_path / 'law.py'}:broken")
    assert made.advance(5) == 5
    assert made.state().law.endswith("law.py:broken")
    assert made.state().torque_command_Nm == (0.0, 0.0, 0.0)
    made.advance(200)
    assert made.state().mode == "fault"
    reason = r"law broken: expected a torque at .* s, received IndexError: list index out of range"
    assert re.fullmatch(reason, made.state().reason)
    assert made.state().status == "diverged"
    done(made, "set", name="controller.law", value="pd")
    done(made, "reset")
    done(made, "start")
    assert made.advance(100) == 100


def test_advance_is_refused_while_the_thread_runs():
    with paused() as made:
        made.begin()
        with pytest.raises(SpheretwinError, match="received one at work"):
            made.advance(1)
    with pytest.raises(SpheretwinError):
        made.advance(1)


def test_a_snapshot_can_be_restored_again_with_the_fields_that_waited(made):
    done(made, "set", name="controller.period_s", value=2e-3)
    done(made, "snapshot")
    waited = made.state().pending
    for _ in range(2):
        done(made, "restore")
        assert made.state().pending == waited == (("controller.period_s", "0.002"),)
        done(made, "set", name="plant.engine", value="mujoco")
        assert len(made.state().pending) == 2


def test_the_number_of_snapshots_is_bounded_and_a_name_can_be_used_again():
    with paused() as made:
        for place in range(16):
            done(made, "snapshot", name=f"{place}")
        message = "bench: expected at most 16 snapshots, received one more"
        assert said(made, "snapshot", name="16") == message
        done(made, "snapshot", name="15")
        assert made.state().snapshots == tuple(f"{place}" for place in range(16))


@pytest.mark.parametrize("current_A", [0.5, -1.5])
def test_the_torque_margin_counts_currents_of_both_signs(made, current_A):
    limit_A = made.state().current_limit_A
    done(made, "manual", group=5, current_A=current_A)
    made.advance(1)
    assert made.state().torque_margin == 1 - abs(current_A) / limit_A


def test_a_command_waits_while_another_thread_adds_one():
    queue, waited = Queue(), []

    class Slow(QueuedCommand):
        """Command that another thread's command overtakes, if it can, while it is added."""

        def __hash__(self):
            if not waited:
                waited.append(None)
                other.start()
                other.join(0.5)  # with a lock in the way it ends only after this one
                waited[0] = other.is_alive()
            return id(self)

    first, second = (kind(COMMANDS["step"], {"ticks": 1}) for kind in (Slow, QueuedCommand))
    other = threading.Thread(target=queue.put, args=(second,))
    queue.put(first)
    other.join()
    assert waited == [True]
    assert [queue.next(), queue.next(), queue.next()] == [first, second, None]
