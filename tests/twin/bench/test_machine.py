"""Bench on a machine behind a link: the same states as with a simulated plant, and what it refuses."""

import threading

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.bench import Bench
from spheretwin.bench.commands import COMMANDS
from spheretwin.machine.link.limits import LinkSettings, MachineLimits
from spheretwin.machine.link.machine_link import Link
from spheretwin.machine.link.machine_server import MachineServer
from spheretwin.models.base.errors import InputError
from spheretwin.session import Session
from tests.twin.machine.link.lines import GROUPS, Line, PERIOD_s, controller_channel, heat, machine_channel
from tests.waiting import UNLIMITED_S

TICKS, STOPPED = 60, 20


@pytest.mark.uncompiled
def test_the_page_s_commands_drive_a_machine():
    """In lockstep, with true rates: poses and commands have the bits of a bench with its own plant."""
    scenario = scenarios.load("nutation", {"plant.end_stops.on": False})
    line = Line()
    server = MachineServer(machine_channel(line.other_end()), "a test", GROUPS, PERIOD_s, idle_s=1e6)
    rows = []

    def serve():
        with Session(scenario, external=server) as session:
            rows.append(session.advance(TICKS + STOPPED))
            server.finish(session.t_s, session.q_rad)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    unlimited = {"timeout_s": UNLIMITED_S, "connect_s": UNLIMITED_S}
    settings = LinkSettings(armed=True, ramp_s=0.0, lockstep=True, **unlimited)
    link = Link(controller_channel(line), "a test", settings, MachineLimits(current_A=8.0), heat(), PERIOD_s)
    with Bench(scenario) as own, Bench(scenario, machine=link.session(scenario)) as bench:
        for one in (own, bench):
            one.do("start")
            assert one.advance(TICKS) == TICKS
        theirs, ours = own.state(), bench.state()
        assert ours.q_rad == theirs.q_rad
        assert ours.current_command_A == theirs.current_command_A
        for name in ("pause", "reset", "step"):
            assert COMMANDS[name].simulated_only
            with pytest.raises(InputError, match=f"expected a command for a real machine, received {name}"):
                bench.do(name)
        bench.do("stop")
        bench.advance(STOPPED)
        assert not any(bench.state().current_command_A)
    link.release()
    thread.join()
    (table,) = rows
    assert np.all(np.any(table["current_command_A"][:TICKS], axis=1))
    assert not np.any(table["current_command_A"][TICKS:])
