"""The twin as a machine: receives currents from a controller of any kind, and replies with measurements."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from spheretwin.loop.external import ExternalController, Measurement
from spheretwin.machine.link.admission import MachineAdmission
from spheretwin.machine.link.channel import FrameChannel
from spheretwin.machine.link.codec import Values
from spheretwin.machine.link.frame_format import Flags
from spheretwin.machine.link.real_time import Distribution
from spheretwin.models.base.arrays import Array

POLL_s = 0.1
"""Time between two checks for a stop."""


class MachineServer(ExternalController):
    """External controller of a session that plays a machine.

    *Lockstep* (default): each command advances the twin by one control period and is answered by the
    measurement after it, whose `echo` is the sequence number of the command. A command with `Flags.HELLO` is
    answered by the present measurement. A command that arrives twice is answered twice and applied once.

    *Real time*: the twin advances by the clock and sends a measurement in each period. The currents are those
    of the newest command that has arrived; they are 0 if it is older than `timeout_s`.

    Parameters
    ----------
    channel : FrameChannel
        Sends measurements, receives commands.
    name : str
        Entry of the journal.
    groups : int
        Coil groups.
    period_s : float
        Control period.
    real_time : bool
    timeout_s : float
        Age of a command at which the currents are removed, in real time.
    idle_s : float
        Time without commands after which the run ends.
    authenticated : bool
        Commands without a session are refused.
    stop_requested : callable
        True ends the run.
    now : callable
        Clock, s.

    Attributes
    ----------
    real_time : bool
    ending : str
        Reason for which the controller ended the run; empty otherwise.
    jitter, turnaround : Distribution
        Delay of the ticks in real time; time from a measurement to the command that answers it.
    """

    def __init__(
        self,
        channel: FrameChannel,
        name: str,
        groups: int,
        period_s: float,
        *,
        real_time: bool = False,
        timeout_s: float = 0.02,
        idle_s: float = 60.0,
        authenticated: bool = False,
        stop_requested: Callable[[], bool] = lambda: False,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.channel, self.name, self.ending = channel, name, ""
        self.jitter, self.turnaround = Distribution(), Distribution()
        self._groups, self._period_s, self.real_time = groups, period_s, real_time
        self._timeout_s, self._idle_s = timeout_s, idle_s
        self._stop_requested, self._now = stop_requested, now
        self._admission = MachineAdmission(now, authenticated=authenticated)
        channel.admit_by(self._admission)
        self._pending: deque[Values] = deque()
        self._sequence = 0
        self._echo: int | None = None
        self._applied = np.zeros(groups)
        self._flags = Flags(0)
        self._reply: dict[str, Any] = {}
        self._start_s: float | None = None
        self._sent_s: float | None = None
        self._arrival_s = 0.0

    def to_stand_in(self) -> MachineServer:
        """Return the same server for a stand-in of the controller, whose currents are 0."""

        def command(measurement: Values) -> Values:
            number = (measurement.get("sequence", 0) + 1) % self.channel.modulus
            return {"sequence": number, "flags": Flags.ARMED, "time": 0.0, "current": np.zeros(self._groups)}

        channel, peer = self.channel.stand_in(command)
        return MachineServer(
            channel, self.name, self._groups, self._period_s, real_time=self.real_time, now=peer.now
        )

    def command(self, t_s: float, measurement: Measurement) -> Array | None:
        """Return the currents for a measurement; None at the end of the run."""
        self._reply = {
            **self._head(t_s),
            "angle": measurement.angle_rad,
            "rate": measurement.rate_rad_s,
            "current": measurement.current_A,
            "temperature": measurement.temperature_degC,
        }
        if self._echo is not None or self.real_time:
            self._send_reply()
        return self._newest_command() if self.real_time else self._next_command()

    def finish(self, t_s: float, angle_rad: Array) -> None:
        """Send the last measurement, with `Flags.END`."""
        self._reply = {**self._reply, **self._head(t_s), "angle": angle_rad}
        self._reply["flags"] |= Flags.END
        self._send_reply()

    def figures(self) -> dict[str, Any]:
        """Return counts of frames and distributions of times."""
        return {
            "frames": self.channel.figures(),
            "refused_senders": dict(self.channel.transport.refused),
            "turnaround": self.turnaround.figures(),
            **({"jitter": self.jitter.figures()} if self.real_time else {}),
        }

    def _head(self, t_s: float) -> dict[str, Any]:
        """Return the numbers and flags of the next measurement, and its time."""
        self._sequence += 1
        session, flags = self._admission.session, self._flags
        return {
            "sequence": self._sequence,
            "echo": self._echo,
            "session": session,
            "flags": flags,
            "time": t_s,
        }

    def _send_reply(self) -> None:
        self.channel.send(self._reply)
        self._sent_s = self._now()

    def _next_command(self) -> Array | None:
        """Wait for a command that advances the twin."""
        last_s = self._now()
        while True:
            if not self._pending:
                if self._is_over(last_s):
                    return None
                self._receive(POLL_s)
                continue
            last_s = self._now()
            frame = self._pending.popleft()
            if self._ends(frame):
                return None
            self._echo = frame.get("sequence")
            if frame.get("flags", 0) & Flags.HELLO:
                self._reply = {**self._reply, "echo": self._echo, "session": self._admission.answer_to(frame)}
                self._send_reply()
                self._sent_s = None  # the controller may be starting
                continue
            self._add_turnaround(last_s)
            return self._currents(frame)

    def _receive(self, timeout_s: float) -> None:
        """Queue the new commands; answer one that arrived again."""
        duplicated = self.channel.counts.duplicated
        for frame in self.channel.receive(timeout_s):
            if np.all(np.isfinite(frame["current"])):
                self._pending.append(frame)
            else:
                self.channel.counts.corrupt += 1
        if self.channel.counts.duplicated > duplicated and not self._pending and not self.real_time:
            self._send_reply()

    def _newest_command(self) -> Array | None:
        """Wait for the end of the period; return the currents of the newest command."""
        if self._start_s is None:
            return self._first_command()
        self._start_s += self._period_s
        before_s = self._arrival_s
        while (left_s := self._start_s - self._now()) > 0:
            self._receive(min(left_s, POLL_s))
            if not self._take_newest():
                return None
            if self._is_over(self._arrival_s):
                return None
        self._receive(0.0)
        if not self._take_newest():
            return None
        now_s = self._now()
        self.jitter.add(now_s - self._start_s)
        if now_s > self._start_s + self._period_s:  # do not hurry after a pause of the system
            self._start_s = now_s
        self.channel.counts.late += self._arrival_s == before_s
        if now_s - self._arrival_s > self._timeout_s:
            self._applied = np.zeros(self._groups)
            self._flags = Flags.FAILSAFE
        return self._applied

    def _first_command(self) -> Array | None:
        """Wait for a controller; the clock starts with its first command."""
        currents = self._next_command()
        self._start_s = self._arrival_s = self._now()
        return currents

    def _take_newest(self) -> bool:
        """Apply the queued commands; return False if one ends the run."""
        while self._pending:
            frame = self._pending.popleft()
            if self._ends(frame):
                return False
            self._echo, self._arrival_s = frame.get("sequence"), self._now()
            self._add_turnaround(self._arrival_s)
            self._currents(frame)
        return True

    def _currents(self, frame: Values) -> Array:
        """Return the currents of a command: 0 unless it is armed."""
        armed = frame.get("flags", Flags.ARMED) & Flags.ARMED
        self._flags = Flags.ARMED if armed else Flags(0)
        self._applied = frame["current"] if armed else np.zeros(self._groups)
        return self._applied

    def _add_turnaround(self, arrival_s: float) -> None:
        if self._sent_s is not None:
            self.turnaround.add(arrival_s - self._sent_s)

    def _ends(self, frame: Values) -> bool:
        if frame.get("flags", 0) & Flags.END:
            self.ending = "the controller ended the run"
        return bool(self.ending)

    def _is_over(self, last_s: float) -> bool:
        if self._stop_requested():
            self.ending = "a stop was requested"
        elif self.channel.transport.is_closed:
            self.ending = "the controller closed the connection"
        elif self._now() - last_s > self._idle_s:
            self.ending = f"no command in {self._idle_s:g} s"
        return bool(self.ending)
