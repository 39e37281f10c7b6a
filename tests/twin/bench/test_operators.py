"""One client operates, others watch; when it is gone, the twin holds."""

import pytest

from spheretwin import scenario as scenarios
from spheretwin.bench import Bench
from spheretwin.bench.operators import GONE_s, Operators
from tests.twin.bench.cases import FREE, Clock, done


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def shared(clock):
    with Bench(scenarios.load("sinusoid", FREE), Operators(clock=clock)) as made:
        done(made, "start")
        yield made


def say(bench, command, client, **arguments):
    ticket = bench.command(command, client=client, **arguments)
    bench.advance(1)
    return ticket.refused


def test_one_client_operates_until_it_grants_or_leaves_and_anyone_may_stop(shared):
    for client in ("a", "b"):
        assert say(shared, "hello", client) is None
    refused = "bench: expected a command of a, received one of 'b'"
    assert say(shared, "jog", "b", rates_rad_s=[0, 0, 1]) == refused
    assert say(shared, "jog", "a", rates_rad_s=[0, 0, 1]) is None
    assert say(shared, "off", None) is None  # of whoever has the bench in hand
    say(shared, "ask", "b")
    assert say(shared, "grant", "a", to="b") is None
    state = shared.state()
    assert (state.mode, state.operator, state.watching, state.asking) == ("off", "b", ("a",), ())
    say(shared, "leave", "b")
    refused = "bench: expected a command of a client that operates, received one of 'a'"
    assert say(shared, "hold", "a") == refused
    assert say(shared, "stop", "c") is None
    assert shared.state().stopped


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
