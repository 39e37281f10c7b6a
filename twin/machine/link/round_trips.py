"""Test of a link: round trip, jitter and loss at some rates, by requests that move nothing."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from spheretwin.machine.link.admission import Admission, new_session
from spheretwin.machine.link.channel import FrameChannel
from spheretwin.machine.link.frame_format import Flags
from spheretwin.machine.link.real_time import Distribution
from spheretwin.models.base.errors import InputError, SpheretwinError

RATES_Hz = (1000, 2000, 5000)

EDGES_ms = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, float("inf"))
"""Edges of the histogram of the round trip."""

MOST_LOSS = 1e-3
"""Largest share of requests without an answer."""

REST_s = 0.2
"""Time after the last request in which its answer counts."""


class RateResult(NamedTuple):
    """Result of a link test at one rate."""

    rate_Hz: float
    sent: int
    loss: float
    """Share of the requests that were not answered."""
    round_trip: dict[str, float | None]
    jitter: dict[str, float | None]
    """Delay of the requests."""
    histogram: list[int]
    """Answers by round trip, between `EDGES_ms`."""
    reasons: tuple[str, ...]
    """Why the link does not suffice; empty if it does."""

    @property
    def suffices(self) -> bool:
        """True if the link suffices for control at this rate."""
        return not self.reasons

    def row(self) -> dict[str, Any]:
        """Return the result in JSON types."""
        return {**self._asdict(), "reasons": list(self.reasons), "suffices": self.suffices}


def measure_link(
    channel: FrameChannel,
    rates_Hz: Sequence[float] = RATES_Hz,
    seconds: float = 5.0,
    *,
    stop_requested: Callable[[], bool] = lambda: False,
    now: Callable[[], float] = time.monotonic,
) -> list[RateResult]:
    """Return the results of requests at some rates, each for some seconds.

    A request is a command with `Flags.HELLO` and without currents: a machine answers it with its present
    measurement, and does not advance.

    Raises
    ------
    InputError
        The frames have no echo, or no flags.
    SpheretwinError
        The machine answers no request of the first rate.
    """
    if not channel.has_echo or not channel.has_flags:
        raise InputError("link: expected frames with the fields flags and echo, received others")
    channel.admit_by(lambda _: Admission.REQUEST)  # answers to requests may have one sequence number
    test, results = _Test(channel, now), []
    for rate_Hz in rates_Hz:
        if stop_requested():
            break
        results.append(test.run(rate_Hz, round(rate_Hz * seconds), stop_requested))
        if not sum(results[0].histogram):
            raise SpheretwinError(
                f"link: expected answers of a machine, received none to {results[0].sent} requests,"
                f" and {channel.counts.corrupt} texts that are no frame"
            )
    return results


class _Test:
    """Requests over a channel, numbered on from rate to rate."""

    def __init__(self, channel: FrameChannel, now: Callable[[], float]) -> None:
        self._channel, self._now = channel, now
        self._session, self._sequence = new_session(), 0
        self._sent_s: dict[int, float] = {}

    def run(self, rate_Hz: float, requests: int, stop_requested: Callable[[], bool]) -> RateResult:
        """Send requests at a rate."""
        jitter, times_s, sent = Distribution(), array("d"), 0
        self._sent_s.clear()
        due_s = self._now()
        for _ in range(requests):
            if stop_requested():
                break
            delay_s = self._now() - due_s
            jitter.add(delay_s)
            self._request()
            sent += 1
            due_s += 1 / rate_Hz if delay_s < 1 / rate_Hz else delay_s  # do not hurry after a pause
            self._receive_until(due_s, times_s)
        self._receive_until(self._now() + REST_s, times_s)
        return _result(rate_Hz, sent, times_s, jitter)

    def _request(self) -> None:
        self._sequence = (self._sequence + 1) % self._channel.modulus
        self._sent_s[self._sequence] = self._now()
        self._channel.send_command(self._sequence, self._session, Flags.HELLO)

    def _receive_until(self, end_s: float, times_s: array[float]) -> None:
        while True:
            frames = self._channel.receive(max(end_s - self._now(), 0.0))
            arrival_s = self._now()
            for frame in frames:
                if (sent_s := self._sent_s.pop(frame["echo"], None)) is not None:
                    times_s.append(arrival_s - sent_s)
            if arrival_s >= end_s:
                return


def _result(rate_Hz: float, sent: int, times_s: array[float], jitter: Distribution) -> RateResult:
    round_trip, period_ms = Distribution(), 1e3 / rate_Hz
    for time_s in times_s:
        round_trip.add(time_s)
    loss = 1 - len(times_s) / max(sent, 1)
    trip, delay = round_trip.figures(), jitter.figures()
    reasons = []
    if loss > MOST_LOSS:
        reasons.append(f"{100 * loss:.2g} % are lost")
    for name, figure, most_ms in (
        ("99.9 % of the round trips", trip["p999_ms"], period_ms),
        ("99 % of the delays of this computer", delay["p99_ms"], period_ms / 2),
    ):
        if figure is not None and figure > most_ms:
            reasons.append(f"{name} are below {figure:.3g} ms, expected {most_ms:g} ms")
    histogram = np.histogram(1e3 * np.array(times_s), EDGES_ms)[0].tolist()
    return RateResult(rate_Hz, sent, loss, trip, delay, histogram, tuple(reasons))
