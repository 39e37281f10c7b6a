"""One client operates, others watch; when it is gone, the twin holds."""

import pytest

from spheretwin import scenario as scenarios
from spheretwin.bench import Bench
from spheretwin.bench.operators import MOST_CLIENTS, GONE_s, Operators, SILENCE_s
from spheretwin.models.base.errors import InputError
from tests.twin.bench.cases import QUIET, done


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def shared(clock):
    with Bench(scenarios.load("sinusoid", QUIET), Operators(clock=clock)) as made:
        done(made, "start")
        yield made


def say(bench, command, client, **arguments):
    ticket = bench.command(command, client=client, **arguments)
    bench.advance(1)
    return ticket.refused


def test_the_first_client_operates_and_others_watch(shared):
    assert say(shared, "hello", "a") is None
    assert say(shared, "hello", "b") is None
    state = shared.state()
    assert (state.operator, state.watching, state.asking) == ("a", ("b",), ())
    assert (
        say(shared, "jog", "b", rates_rad_s=[0, 0, 1])
        == "bench: expected a command of a, received one of 'b'"
    )
    assert say(shared, "jog", "a", rates_rad_s=[0, 0, 1]) is None
    assert shared.state().mode == "jog"
    assert say(shared, "off", None) is None  # of whoever has the bench in hand


def test_anyone_may_stop(shared):
    say(shared, "hello", "a")
    assert say(shared, "stop", "b") is None
    assert shared.state().stopped


def test_an_operator_grants_control(shared):
    say(shared, "hello", "a")
    say(shared, "hello", "b")
    say(shared, "ask", "b")
    assert shared.state().asking == ("b",)
    assert "received 'c'" in say(shared, "grant", "a", to="c")
    assert "expected a command of a" in say(shared, "grant", "b", to="b")
    assert say(shared, "grant", "a", to="b") is None
    state = shared.state()
    assert (state.operator, state.watching, state.asking) == ("b", ("a",), ())
    assert say(shared, "leave", "b") is None
    assert shared.state().operator is None
    assert (
        say(shared, "hold", "a") == "bench: expected a command of a client that operates, received one of 'a'"
    )
    assert say(shared, "ask", "a") is None
    assert shared.state().operator == "a"


def test_the_twin_holds_when_its_operator_is_gone(shared, clock):
    say(shared, "hello", "a")
    say(shared, "hello", "b")
    say(shared, "jog", "a", rates_rad_s=[0, 0, 1])
    for _ in range(5):
        clock.now += 0.9 * GONE_s
        say(shared, "beat", "a")
        say(shared, "beat", "b")
    assert (shared.state().mode, shared.state().operator) == ("jog", "a")
    say(shared, "ask", "b")
    clock.now += 0.6 * GONE_s
    say(shared, "beat", "b")
    clock.now += 0.6 * GONE_s
    shared.advance(1)
    state = shared.state()
    assert (state.mode, state.operator, state.watching) == ("hold", "b", ())
    assert state.note == "the operator is gone: the twin holds"
    assert state.journal == 2  # the change is one of the run's: it replays


@pytest.mark.parametrize("mode", ["off", "stop"])
def test_a_free_rotor_stays_free_when_the_operator_is_gone(shared, clock, mode):
    say(shared, "hello", "a")
    say(shared, mode, "a")
    clock.now += 2 * GONE_s
    shared.advance(1)
    assert (shared.state().mode, shared.state().operator) == ("off", None)


def test_clients_say_who_they_are(shared):
    assert "expected hello of a client" in shared.command("hello").refused


def test_the_number_of_clients_is_bounded(clock):
    operators = Operators(clock=clock)
    for i in range(MOST_CLIENTS):
        operators.register(f"{i}")
    with pytest.raises(InputError, match="at most"):
        operators.register("one more")
    clock.now = 2 * GONE_s
    assert operators.check_silence()
    assert not operators.check_silence()
    operators.register("one more")
    assert operators.operator == "one more"


def test_a_silent_client_does_not_become_the_operator(clock):
    operators = Operators(clock=clock)
    for client in ("a", "b", "c"):
        operators.register(client)
    operators.ask("b")
    clock.now = 0.9 * SILENCE_s
    operators.register("c")
    assert not operators.check_silence()
    assert operators.operator == "a"
    clock.now = 1.1 * SILENCE_s
    assert operators.check_silence()
    assert (operators.operator, operators.watching, operators.asking) == (None, ("c",), ())


@pytest.mark.parametrize(("gone_s", "silence_s"), [(1.0, 5.0), (5.0, 1.0)])
def test_time_without_an_operator_and_silence_have_their_own_limits(clock, gone_s, silence_s):
    left, silent = (Operators(gone_s, silence_s, clock) for _ in range(2))
    for operators in (left, silent):
        operators.register("a")
    left.leave("a")
    for now_s in (0.9, 1.1, 4.9, 5.1):
        before_s, clock.now = clock.now, now_s
        assert left.check_silence() == (before_s < gone_s < now_s)
        assert silent.check_silence() == (
            before_s < silence_s < now_s or before_s < silence_s + gone_s < now_s
        )


def test_a_silent_client_that_watches_changes_nothing_for_the_operator(clock):
    operators = Operators(clock=clock)
    for client in ("a", "b"):
        operators.register(client)
    operators.ask("b")
    clock.now = 1.1 * SILENCE_s
    operators.register("a")
    assert not operators.check_silence()
    assert (operators.operator, operators.watching, operators.asking) == ("a", (), ())


def test_the_twin_holds_some_time_after_its_operator_has_left_unless_somebody_takes_over(shared, clock):
    say(shared, "hello", "a")
    say(shared, "hello", "b")
    say(shared, "jog", "a", rates_rad_s=[0, 0, 1])
    say(shared, "leave", "a")
    for still, mode in ((0.9 * GONE_s, "jog"), (0.2 * GONE_s, "hold")):
        clock.now += still
        say(shared, "beat", "b")
        assert shared.state().mode == mode
    say(shared, "ask", "b")
    say(shared, "jog", "b", rates_rad_s=[0, 0, 1])
    say(shared, "hello", "c")
    say(shared, "ask", "c")
    say(shared, "leave", "b")
    assert shared.state().operator == "c"
    for _ in range(4):
        clock.now += 0.5 * GONE_s
        say(shared, "beat", "c")
    assert shared.state().mode == "jog"
