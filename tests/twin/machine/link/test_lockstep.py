"""Lockstep: our controller on the twin as a machine gives the bytes of a simulation."""

import threading
import time

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.loop.external import Measurement
from spheretwin.machine.link import frame_format
from spheretwin.machine.link.controller_scenario import controller_scenario, left_out
from spheretwin.machine.link.limits import LinkSettings
from spheretwin.machine.link.machine_link import Link
from spheretwin.machine.link.machine_server import MachineServer
from spheretwin.session import Session
from tests.twin.machine.link import lines
from tests.twin.machine.link.lines import GROUPS, LIMITS, Line, PERIOD_s
from tests.waiting import UNLIMITED_S

TICKS = 60


class Run:
    """The same scenario simulated, and driven over a line."""

    def __init__(self, frame="spheretwin", changes=None, damage=None, ticks=TICKS, line=None, now=None):
        scenario = scenarios.load("nutation", changes)
        with Session(scenario) as session:
            self.simulated = session.advance(ticks)
        line, frames = line or Line(), frame_format.load(frame)
        end = line.other_end()
        channel = lines.machine_channel(damage(end) if damage else end, frames)
        server = MachineServer(channel, "a test", GROUPS, PERIOD_s, idle_s=1e6)
        thread = threading.Thread(target=self.serve, args=(scenario, server, ticks), daemon=True)
        thread.start()
        unlimited = {"timeout_s": UNLIMITED_S, "connect_s": UNLIMITED_S}
        settings = LinkSettings(armed=True, ramp_s=0.0, lockstep=True, **unlimited)
        channel, coils = lines.controller_channel(line, frames), lines.heat()
        self.link = Link(channel, "a test", settings, LIMITS, coils, PERIOD_s, now=now or time.monotonic)
        with self.link.session(scenario) as session:
            self.controller = session.advance(ticks)
            self.status = session.status
        self.link.release()
        thread.join()

    def serve(self, scenario, server, ticks):
        with Session(scenario, external=server) as session:
            self.machine = session.advance(ticks)
            server.finish(session.t_s, session.q_rad)


LAW = ("sliding_s", "fuzzy_torque_Nm", "switching_torque_Nm", "switching_gain", "bound_gain")
CONTROLLER = ("t_s", "q_ref_rad", "qdot_ref_rad_s", "torque_command_Nm", "current_command_A",
              "allocation_scale")  # fmt: skip
PLANT = ("t_s", "q_rad", "qdot_rad_s", "error_rad", "torque_Nm", "disturbance_Nm", "current_command_A",
         "current_A", "mean_current_A")  # fmt: skip
ELECTRONICS = {"hardware": "electronics", "estimator.kind": "kalman"}


def check_bytes(run, measured, extra=()):
    assert run.status == "running"
    assert len(run.machine) == len(run.controller) == len(run.simulated)
    for table, columns in (
        (run.machine, (*PLANT, *measured, *extra)),
        (run.controller, (*CONTROLLER, *LAW, *measured)),
    ):
        for column in columns:
            assert table[column].tobytes() == run.simulated[column].tobytes(), column


@pytest.mark.uncompiled
@pytest.mark.parametrize("frame", ["spheretwin", "spheretwin_json"])
def test_the_bytes_of_true_rates(frame):
    run = Run(frame)
    check_bytes(run, ())
    # Together both sides have every column.
    assert {signal.name for signal in run.simulated.signals} == {*PLANT, *CONTROLLER, *LAW}


def check_electronics(ticks):
    run = Run(changes=ELECTRONICS, ticks=ticks)
    measured = ("q_measured_rad", "qdot_estimated_rad_s")
    check_bytes(run, measured, ("coil_temperature_degC", "copper_loss_W", "friction_Nm"))
    np.testing.assert_array_equal(run.controller["q_rad"], run.simulated["q_measured_rad"])


@pytest.mark.uncompiled
def test_the_bytes_of_electronics_and_an_estimator():
    check_electronics(TICKS)


@pytest.mark.release("compiles two loops for 20 s; the same test in plain Python has the content")
def test_compiled_loops_of_both_sides_have_the_bytes_of_one():
    check_electronics(400)


@pytest.mark.uncompiled
def test_a_line_that_loses_and_repeats_frames_changes_no_byte():
    class Damaged(Line):
        """Three of four answers are lost, repeated, or follow noise; a lost one is empty."""

        sent = 0

        def send(self, content):
            self.sent += 1
            noise = b"\xa5\x5a" + bytes(range(200))
            for datagram in ([b""], [content], [content, content], [noise, content])[self.sent % 4]:
                super().send(datagram)

    class Ear(Line):
        """End with a clock that only silence moves: then the command is sent again."""

        t_s = 0.0

        def receive(self, timeout_s):
            content = super().receive(timeout_s)
            self.t_s += 0.0 if content else timeout_s
            return content

    ear = Ear()
    run = Run(damage=lambda line: Damaged(line.sink, line.source), ticks=50, line=ear, now=lambda: ear.t_s)
    check_bytes(run, ())
    counts = run.link.figures()["frames"]
    assert counts["duplicated"] > 10
    assert counts["corrupt"] > 10


def test_the_controller_has_nothing_of_the_plant():
    changes = {
        "hardware": "prototype",
        "plant.modelling_error": 0.2,
        "disturbance.load": 1.0,
        "fault": [{"target": "coil.03", "mode": "open", "start_s": 0.1, "detection": True}],
        "event": [
            {"t_s": 0.1, "set": "disturbance.load", "value": 2.0},
            {"t_s": 0.2, "set": "controller.law", "value": "pd"},
        ],
    }
    resolved = Session(scenarios.load("sinusoid", changes)).initial_scenario
    first = Measurement(np.array([0.1, 0.2, 0.3]), None, np.zeros(18))
    scenario = controller_scenario(resolved, first, 2.0)
    assert left_out(resolved) == [
        "the fault coil.03 open does not occur: the machine is real",
        "the event that sets disturbance.load does not occur: the machine is real",
    ]
    assert scenario.plant.modelling_error == 0.0
    assert not scenario.fault
    assert scenario.detector.detect
    assert scenario.watchdog.on
    assert [event.set for event in scenario.event] == ["controller.law"]
    assert scenario.plant.initial_rad == (0.1, 0.2, 0.3)
    assert scenario.nominal.current_limit_A == 2.0
    assert scenario.nominal.inertia_kg_m2 == resolved.nominal.inertia_kg_m2
    assert scenario.nominal.angle_noise_rad == resolved.nominal.angle_noise_rad
