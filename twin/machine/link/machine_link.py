"""Link to a machine: sends the currents of our controller, and receives measurements."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np

from spheretwin.control.supervision.watchdog import Reason
from spheretwin.loop.external import ExternalPlant, Measurement
from spheretwin.machine.link.admission import ControllerAdmission
from spheretwin.machine.link.channel import FrameChannel
from spheretwin.machine.link.codec import Values
from spheretwin.machine.link.controller_scenario import (
    check_measurement,
    controller_scenario,
    is_finite,
    measurement_of,
)
from spheretwin.machine.link.frame_format import DEFAULT_FRAME, Flags
from spheretwin.machine.link.limits import CoilHeat, LinkSettings, MachineLimits, Plausibility
from spheretwin.machine.link.real_time import Distribution
from spheretwin.machine.link.rehearsal import rehearse, still_machine
from spheretwin.machine.link.stream import RunningShadow
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, SpheretwinError, distinct_texts
from spheretwin.scenario.sections import ResolvedScenario, Scenario
from spheretwin.session import Session

HELLO_s = 0.1
"""Time between two requests for a first measurement."""

RETRIES = 4
"""Times that a command is sent within the timeout, in lockstep."""

RELEASES = 3
"""Frames without currents at the end: one of them may be lost."""

SENT_TIMES = 256
"""Commands whose time is stored for the latency."""


def _rehearsed(session: Session) -> None:
    rehearse(session, ())


class Link(ExternalPlant):
    """Machine behind a channel, in place of the plant of a session.

    The currents are removed when a measurement, or the answer to a command, is missing for
    `LinkSettings.timeout_s`, when a limit is exceeded, and when the machine reports that it has switched off.

    Parameters
    ----------
    channel : FrameChannel
        Sends commands, receives measurements.
    name : str
        Entry of the journal.
    settings : LinkSettings
    limits : MachineLimits
    heat : CoilHeat
    period_s : float
        Control period.
    shadow : RunningShadow, optional
    plausibility : Plausibility, optional
        Checks of the motion while it is armed; default: none.
    stop_requested : callable
        True ends the run.
    now : callable
        Clock, s.

    Attributes
    ----------
    authority : float
        Share of the commands that is sent at the next tick.
    ending : str
        Reason for which the run ended early; empty otherwise.
    real_time : bool
        Ticks follow the clock.
    late_ticks : set of int
        Ticks that had no new measurement.
    latency, jitter : Distribution
        Time from a command to the measurement that answers it; delay of the ticks.
    """

    def __init__(
        self,
        channel: FrameChannel,
        name: str,
        settings: LinkSettings,
        limits: MachineLimits,
        heat: CoilHeat,
        period_s: float,
        *,
        shadow: RunningShadow | None = None,
        plausibility: Plausibility | None = None,
        stop_requested: Callable[[], bool] = lambda: False,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.channel, self.name, self.ending = channel, name, ""
        self.authority = 1.0 if settings.armed and settings.ramp_s == 0 else 0.0
        self.latency, self.jitter = Distribution(), Distribution()
        self.late_ticks: set[int] = set()
        self.real_time = not settings.lockstep
        self._settings, self._limits, self._heat, self._period_s = settings, limits, heat, period_s
        self._shadow, self._plausibility = shadow, plausibility
        self._stop_requested, self._now = stop_requested, now
        self._sequence = secrets.randbelow(channel.modulus)  # an old answer is not that to a request
        self._admission = ControllerAdmission()
        channel.admit_by(self._admission)
        self._sent_s: dict[int, float] = {}
        self._newest: Values | None = None
        self._arrival_s = self._answered_s = 0.0
        self._is_new = True
        self._start_s: float | None = None
        self._reason = Reason.NONE
        self._is_released = self._is_after_pause = False

    @classmethod
    def open(
        cls,
        address: str,
        scenario: Scenario,
        settings: LinkSettings | None = None,
        limits: MachineLimits | None = None,
        *,
        frame: str = DEFAULT_FRAME,
        report: Callable[[str], None] | None = None,
        key: bytes = b"",
        **options: Any,
    ) -> Link:
        """Open a link to the machine at an address.

        Parameters
        ----------
        address : str
            ``udp://HOST:PORT``, ``serial:DEVICE@BAUD``, or ``-`` for standard input and output.
        scenario : Scenario
            Controller, and the data sheet of the coils.
        settings : LinkSettings, optional
            Default: a dry run.
        limits : MachineLimits, optional
            Default: the nominal current limit of the scenario. A lower temperature limit of the model file
            holds.
        frame : str
            Shipped name or TOML file of the frames.
        report : callable, optional
            Receives a line for each of the first frames.
        key : bytes
            Authenticates the frames; no bytes for none.
        **options
            `shadow`, `stop_requested` and `now`.

        Raises
        ------
        InputError
            The address or the frames cannot be used, the frames have no command, or the link is armed with a
            current limit above that of the model file.
        """
        complete = Session(scenario)
        resolved, groups = complete.initial_scenario, len(complete.actuator.groups)
        limits = limits or MachineLimits(current_A=resolved.nominal.current_limit_A)
        settings = settings or LinkSettings()
        limit_A = min(limits.current_A, resolved.nominal.current_limit_A)
        most_A = complete.actuator.group.current_limit_A
        if settings.armed and limit_A > most_A:
            used, stated = distinct_texts(limit_A, most_A)
            raise InputError(
                f"link: expected a current limit of at most {stated} A, that of the model file, to arm,"
                f" received {used} A"
            )
        if (stated_degC := complete.actuator.group.temperature_limit_degC) is not None:
            highest_degC = min(limits.temperature_degC, float(np.min(stated_degC)))
            limits = limits.model_copy(update={"temperature_degC": highest_degC})
        period_s = resolved.controller.period_s
        channel = FrameChannel.open(address, frame, groups, report=report, key=key)
        heat = CoilHeat(resolved.drive, limits, period_s)
        options["plausibility"] = Plausibility.of(scenario, resolved, limits)
        return cls(channel, f"a machine at {address}", settings, limits, heat, period_s, **options)

    def session(self, scenario: Scenario, rehearsed: Callable[[Session], object] = _rehearsed) -> Session:
        """Return a session of the controller of a scenario whose plant is the machine, ready to run.

        Parameters
        ----------
        scenario : Scenario
        rehearsed : callable
            Runs a session whose plant is a stand-in; default: without sinks.

        Raises
        ------
        InputError
            The machine does not report what the controller needs.
        SpheretwinError
            No first measurement arrives.
        """
        with Session(scenario) as complete:
            resolved = complete.initial_scenario
        stand_in = self._to_stand_in(resolved)  # the machine does not wait for what is done first
        with stand_in._session_from(resolved, stand_in.connect()) as rehearsal:
            rehearsed(rehearsal)
        first = self.connect()
        check_measurement(resolved, first)
        return self._session_from(resolved, first)

    def _session_from(self, resolved: ResolvedScenario, first: Measurement) -> Session:
        return Session(controller_scenario(resolved, first, self._limits.current_A), external=self)

    def _to_stand_in(self, resolved: ResolvedScenario) -> Link:
        """Return the same link to a stand-in of the machine, which stays at the initial pose."""
        channel, peer = still_machine(self.channel, resolved)
        settings, limits, heat = self._settings, self._limits, deepcopy(self._heat)
        link = Link(channel, self.name, settings, limits, heat, self._period_s, now=peer.now)
        link._shadow = self._shadow and self._shadow.new()
        link._plausibility = self._plausibility and self._plausibility.unlimited()
        return link

    def __enter__(self) -> Link:
        return self

    def __exit__(self, *error: object) -> None:
        self.release()
        self.channel.transport.close()

    def connect(self) -> Measurement:
        """Request and return the first measurement; the machine does not advance.

        Raises
        ------
        SpheretwinError
            None arrives in time, or it is not finite.
        """
        start_s = hello_s = self._now()
        while self._newest is None:
            now_s = self._now()
            if now_s - start_s > self._settings.connect_s or self.channel.transport.is_closed:
                raise SpheretwinError(
                    f"link {self.name}: expected a measurement within {self._settings.connect_s:g} s,"
                    f" received {self.channel.counts.corrupt} texts that are no frame"
                )
            if self._stop_requested():
                raise SpheretwinError(f"link {self.name}: expected a measurement, received a stop")
            if now_s >= hello_s:  # not at each answer that is no frame
                self._send(Flags.HELLO, 0.0, None)
                hello_s = now_s + HELLO_s
            self._receive(hello_s - now_s)
        self._sent_s.clear()  # the machine may have been starting
        self.latency = Distribution()
        measurement = measurement_of(self._newest)
        if not is_finite(measurement):
            raise SpheretwinError(f"link {self.name}: expected finite numbers, received others")
        return measurement

    def advance(self, t_s: float, current_A: Array) -> tuple[Measurement, Reason] | None:
        """Send the currents of a tick; return the next measurement and a reason to remove the currents."""
        if self._newest is None or self._stop_requested():
            self.ending = "a stop was requested"
            return None
        if self._newest.get("flags", 0) & Flags.END:
            self.ending = "the machine ended the run"
            return None
        before = self._newest
        angle = before["angle"] if self._is_new else np.full(3, np.nan)
        if self._shadow:
            self._shadow.advance(t_s, current_A, angle)
        if self._plausibility and self._settings.armed and not self._reason:
            self._reason = self._plausibility.advance(t_s, current_A, angle, after_pause=self._is_after_pause)
        self._is_after_pause = False
        is_armed = self._settings.armed and self._reason == Reason.NONE
        flags = Flags.ARMED if is_armed else Flags(0)
        temperature_degC = self._heat.advance(current_A)
        if self._settings.lockstep:
            self._wait_for_reply(flags, t_s, current_A)
        else:
            self._wait_for_clock(flags, t_s, current_A)
        self._is_new = self._newest is not before
        if not self._is_new:
            self.channel.counts.late += 1
            self.late_ticks.add(round(t_s / self._period_s) + 1)
        if self._settings.armed:
            ramp_s, next_s = self._settings.ramp_s, t_s + self._period_s
            self.authority = 1.0 if next_s >= ramp_s else next_s / ramp_s
        measurement = measurement_of(self._newest)
        if not self._reason:
            reported = measurement.temperature_degC
            self._reason = self._check(measurement, temperature_degC if reported is None else reported)
        if not is_finite(measurement):
            self._newest = before
            measurement = measurement_of(before)
        return measurement, self._reason

    def release(self) -> None:
        """Tell the machine once that the run has ended, without currents."""
        if self._is_released:
            return
        self._is_released = True
        for _ in range(RELEASES):
            self._send(Flags.END, 0.0, None)

    def figures(self) -> dict[str, Any]:
        """Return counts of frames and distributions of times."""
        return {
            "armed": self._settings.armed,
            "largest_chi2": self._plausibility.largest_chi2 if self._plausibility else None,
            "frames": self.channel.figures(),
            "latency": self.latency.figures(),
            "jitter": self.jitter.figures(),
        }

    def _check(self, measurement: Measurement, temperature_degC: float) -> Reason:
        """Return the reason to remove the currents, if there is one."""
        now_s, timeout_s = self._now(), self._settings.timeout_s
        if not self._is_new and now_s - self._arrival_s >= timeout_s:
            return Reason.STALE
        # The command of this tick was sent a period ago. Measurements that answer older commands are late, or
        # the machine does not receive the commands.
        if self.channel.has_echo and now_s - self._answered_s - self._period_s >= timeout_s:
            return Reason.STALE
        if self._newest and self._newest.get("flags", 0) & Flags.FAILSAFE:
            return Reason.MACHINE
        if not is_finite(measurement):
            return Reason.MEASUREMENT
        return self._limits.exceeded(measurement, temperature_degC)

    def _send(self, flags: Flags, t_s: float, current_A: Array | None) -> None:
        self._sequence = (self._sequence + 1) % self.channel.modulus
        self._sent_s[self._sequence] = self._now()
        self._sent_s.pop((self._sequence - SENT_TIMES) % self.channel.modulus, None)
        session = self._admission.session
        if flags & Flags.HELLO:
            self._admission.request(self._sequence)
            session = self._admission.key
        self._values = self.channel.send_command(self._sequence, session, flags, t_s, current_A)

    def _receive(self, timeout_s: float) -> bool:
        """Store the newest measurement that arrives; return True if it answers the last command."""
        is_reply = False
        for frame in self.channel.receive(timeout_s):
            self._newest, self._arrival_s = frame, self._now()
            echo = frame.get("echo", self._sequence)
            sent_s = self._sent_s.pop(echo, None)
            if sent_s is not None:
                self.latency.add(self._arrival_s - sent_s)
                self._answered_s = sent_s
            is_reply = echo == self._sequence
        return is_reply

    def _wait_for_reply(self, flags: Flags, t_s: float, current_A: Array) -> None:
        """Send a command, again while no reply arrives, and wait for the reply."""
        start_s, before = self._now(), self._newest
        self._send(flags, t_s, current_A)
        timeout_s = 0.0 if self._reason == Reason.STALE else self._settings.timeout_s
        for attempt in range(1, RETRIES + 1):
            end_s = start_s + attempt * timeout_s / RETRIES
            while True:
                if self._receive(max(end_s - self._now(), 0.0)):
                    return
                if self._now() >= end_s:
                    break
            if attempt < RETRIES and timeout_s:
                self.channel.send(self._values)  # the machine applies it once
        self._newest = before  # an answer to an earlier command is no reply

    def _wait_for_clock(self, flags: Flags, t_s: float, current_A: Array) -> None:
        """Send a command, and receive until the next tick is due."""
        if self._start_s is None:
            for frame in self.channel.drain():  # sent while files were opened
                self._newest = frame
            self._start_s = self._arrival_s = self._answered_s = self._now()
        self._send(flags, t_s, current_A)
        self._start_s += self._period_s
        while (left_s := self._start_s - self._now()) > 0:
            self._receive(left_s)
        self._receive(0.0)
        delay_s = self._now() - self._start_s
        self.jitter.add(delay_s)
        if delay_s > self._period_s:  # do not hurry after a pause of the system
            self._start_s += delay_s
            self._is_after_pause = True
