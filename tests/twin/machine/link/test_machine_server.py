"""The twin as a machine: lockstep and real time, with a clock of the test."""

import numpy as np
import pytest

from spheretwin.loop.external import Measurement
from spheretwin.machine.link.frame_format import Flags
from spheretwin.machine.link.machine_server import MachineServer
from tests.twin.machine.link.lines import GROUPS, MEASUREMENT, PERIOD_s, Script, command, machine_channel

AT_REST = Measurement(np.zeros(3), None, np.zeros(GROUPS))


def serve(script, **options):
    return MachineServer(machine_channel(script), "test", GROUPS, PERIOD_s, now=script.now, **options)


@pytest.fixture
def script():
    return Script()


@pytest.fixture
def server(script):
    return serve(script)


def replies(script):
    return [MEASUREMENT.decode(content) for content in script.sent]


def test_each_command_is_one_tick_and_its_echo_is_in_the_reply(script, server):
    for sequence in (7, 8, 9):
        script.plan(command(sequence, current=sequence))
        applied = server.command(0.0, Measurement(np.full(3, sequence / 10), None, np.zeros(GROUPS), 30.0))
        assert np.all(applied == sequence)
    server.finish(1.0, np.ones(3))
    # The first command has no measurement before it, unless it is requested.
    assert [reply["echo"] for reply in replies(script)] == [7, 8, 9]
    assert [reply["angle"][0] for reply in replies(script)] == [0.8, 0.9, 1.0]
    assert replies(script)[0]["temperature"] == 30.0
    assert np.all(np.isnan(replies(script)[0]["rate"]))
    assert replies(script)[-1]["flags"] & Flags.END


def test_a_hello_is_answered_and_does_not_advance(script, server):
    script.plan(command(1, flags=Flags.HELLO))
    script.plan(command(2, current=3.0), delay_s=1.0)
    assert np.all(server.command(0.0, AT_REST) == 3.0)
    assert [(reply["echo"], reply["time"]) for reply in replies(script)] == [(1, 0.0)]


def test_a_command_that_arrives_twice_is_answered_twice_and_applied_once(script, server):
    script.plan(command(1))
    server.command(0.0, AT_REST)
    for content in (command(1), command(1), command(2, current=2.0)):
        script.plan(content)
    assert np.all(server.command(PERIOD_s, AT_REST) == 2.0)
    assert [reply["echo"] for reply in replies(script)] == [1, 1, 1]
    assert server.figures()["frames"]["duplicated"] == 2


def test_no_current_flows_unless_it_is_armed(script):
    script.plan(command(1, current=5.0, flags=0))
    assert not np.any(serve(script).command(0.0, AT_REST))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_current_that_is_no_number_is_no_command(bad, script, server):
    script.plan(command(1, current=bad))
    script.plan(command(2, current=1.0))
    assert np.all(server.command(0.0, AT_REST) == 1.0)
    assert server.figures()["frames"]["corrupt"] == 1


@pytest.mark.parametrize("real_time", [False, True])
def test_the_end_of_the_controller_ends_the_run(real_time, script):
    server = serve(script, real_time=real_time)
    script.plan(command(1))
    assert server.command(0.0, AT_REST) is not None
    script.plan(command(2, flags=Flags.END))
    assert server.command(PERIOD_s, AT_REST) is None
    assert server.ending == "the controller ended the run"


@pytest.mark.parametrize(
    ("stops", "ending", "at_s"), [(False, "no command in 2 s", 2.0), (True, "a stop was requested", 0.0)]
)
def test_silence_and_a_stop_end_the_run(script, stops, ending, at_s):
    server = serve(script, idle_s=2.0, stop_requested=lambda: stops)
    assert (server.command(0.0, AT_REST), server.ending) == (None, ending)
    assert at_s <= script.t_s < at_s + 0.2  # a stop is checked ten times a second


def test_a_closed_connection_ends_the_run_after_the_pending_commands(script, server):
    script.plan(command(1) + command(2, current=2.0))
    server.command(0.0, AT_REST)
    script.is_closed = True
    assert np.all(server.command(PERIOD_s, AT_REST) == 2.0)
    assert server.command(2 * PERIOD_s, AT_REST) is None
    assert server.ending == "the controller closed the connection"


def real_time(script, ticks, **options):
    """The currents of some ticks in real time, the first of which starts the clock."""
    server = serve(script, real_time=True, **options)
    currents = [server.command(PERIOD_s * tick, AT_REST)[0] for tick in range(ticks)]
    return server, currents


def test_in_real_time_the_newest_command_applies_until_the_next(script):
    for delay_ms, sequence in ((0, 1), (0.5, 2), (2.2, 3), (2.4, 4)):
        script.plan(command(sequence, current=sequence), delay_s=1e-3 * delay_ms)
    server, currents = real_time(script, 5)
    assert currents == [1, 2, 2, 4, 4]
    assert len(script.sent) == 5  # a measurement in each period
    assert script.t_s == pytest.approx(4 * PERIOD_s, abs=1e-12)
    assert server.figures()["frames"]["late"] == 2  # ticks 2 and 4
    assert server.figures()["jitter"]["max_ms"] == pytest.approx(0.0, abs=1e-9)


def test_in_real_time_the_currents_are_removed_when_commands_are_missing(script):
    script.plan(command(1, current=2.0))
    script.plan(command(2, current=3.0), delay_s=9.5e-3)
    _, currents = real_time(script, 12, timeout_s=4.5e-3)
    assert currents == [2.0] * 5 + [0.0] * 5 + [3.0] * 2
    flags = [reply["flags"] for reply in replies(script)]
    assert [bool(flag & Flags.FAILSAFE) for flag in flags] == [False] * 6 + [True] * 5 + [False]


def test_in_real_time_a_pause_of_the_system_is_not_made_up_for(script):
    script.plan(command(1))
    server, _ = real_time(script, 2)
    script.t_s += 0.1
    server.command(2 * PERIOD_s, AT_REST)
    before_s = script.t_s
    server.command(3 * PERIOD_s, AT_REST)
    assert script.t_s - before_s == pytest.approx(PERIOD_s)
    assert server.figures()["jitter"]["max_ms"] == pytest.approx(99.0)  # 100 ms, of which 1 was planned
