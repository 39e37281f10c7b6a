"""Transports without a network or a clock, and the pieces of a link in tests."""

import queue

import numpy as np

from spheretwin.electronics.drive_section import ResolvedDrive
from spheretwin.machine.link import frame_format
from spheretwin.machine.link.channel import FrameChannel
from spheretwin.machine.link.codec import Codec
from spheretwin.machine.link.limits import CoilHeat, MachineLimits
from spheretwin.machine.link.transports import Transport

GROUPS, PERIOD_s = 18, 1e-3
OWN, LIMITS = frame_format.load("spheretwin"), MachineLimits(current_A=8.0)


class Line(Transport):
    """One end of a connection between two threads."""

    def __init__(self, sink=None, source=None):
        super().__init__()
        self.sink, self.source = sink or queue.Queue(), source or queue.Queue()

    def other_end(self):
        return Line(self.source, self.sink)

    def send(self, content):
        self.sink.put(content)

    def receive(self, timeout_s):
        try:
            # The tests do not depend on the timeout: it only bounds a hang.
            return self.source.get(timeout=None if timeout_s > 0 else 0.001)
        except queue.Empty:
            return b""


class Script(Transport):
    """Connection whose deliveries are planned, with the clock that they move."""

    def __init__(self, answer=None):
        super().__init__()
        self.t_s, self.sent, self.planned, self.answer = 0.0, [], [], answer

    def now(self):
        return self.t_s

    def plan(self, content, delay_s=0.0):
        self.planned.append((self.t_s + delay_s, content))
        self.planned.sort(key=lambda delivery: delivery[0])

    def send(self, content):
        self.sent.append(content)
        if self.answer:
            self.answer(content)

    def receive(self, timeout_s):
        end_s = self.t_s + timeout_s
        if self.planned and self.planned[0][0] <= end_s:
            at_s, content = self.planned.pop(0)
            self.t_s = max(self.t_s, at_s)
            return content
        self.t_s = max(end_s, np.nextafter(self.t_s, np.inf))  # a clock that is asked again has moved
        return b""


def machine_channel(transport, frames=OWN):
    """The channel of a machine."""
    return FrameChannel(transport, frames.measurement, frames.command, GROUPS)


def controller_channel(transport, frames=OWN, report=None):
    return FrameChannel(transport, frames.command, frames.measurement, GROUPS, report)


MEASUREMENT, COMMAND = Codec(OWN.measurement, GROUPS), Codec(OWN.command, GROUPS)


def measurement(sequence, echo=0, flags=0, angle=(0.0, 0.0, 0.0), **more):
    values = {"sequence": sequence, "echo": echo, "flags": flags, "angle": np.array(angle), **more}
    return MEASUREMENT.encode(values)


def command(sequence, current=1.0, flags=1):
    values = {"sequence": sequence, "flags": flags, "time": 0.0, "current": np.full(GROUPS, current)}
    return COMMAND.encode(values)


def heat(limits=LIMITS):
    drive = ResolvedDrive.model_construct(
        resistance_ohm=1.3,
        resistance_per_K=0.0,
        heat_capacity_J_K=60.0,
        thermal_resistance_K_W=4.0,
        ambient_degC=20.0,
    )
    return CoilHeat(drive, limits, PERIOD_s)
