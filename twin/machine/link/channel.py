"""Channel: frames of two directions over one transport."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

from spheretwin.machine.link.admission import Admission
from spheretwin.machine.link.codec import Codec, Values
from spheretwin.machine.link.decoder import Counts, Decoder
from spheretwin.machine.link.frame_format import Flags, FrameFormat
from spheretwin.machine.link.transports import StandIn, Transport

SHOWN_FRAMES = 3
"""Frames of each direction that a channel reports."""

LONGEST_BACKLOG = 10_000
"""Texts that may have arrived before a run: some seconds of frames."""


class FrameChannel:
    """Frames of two directions over one transport.

    Parameters
    ----------
    transport : Transport
    sends, receives : FrameFormat
    groups : int
        Coil groups of the machine.
    report : callable, optional
        Receives a line for each of the first frames.
    key : bytes
        Authenticates the frames; no bytes for none.

    Attributes
    ----------
    counts : Counts
        Of the received frames.
    groups : int
    has_echo : bool
        True if received frames name the command that they answer.
    has_flags : bool
        True if sent frames can be requests.
    modulus : int
        Sequence numbers of the sent frames run from 0 to the one below.
    """

    def __init__(
        self,
        transport: Transport,
        sends: FrameFormat,
        receives: FrameFormat,
        groups: int,
        report: Callable[[str], None] | None = None,
        key: bytes = b"",
    ) -> None:
        self.transport, self.groups = transport, groups
        self._formats, self._key = (sends, receives), key
        self._encoder = Codec(sends, groups, key)
        self._decoder = Decoder(Codec(receives, groups, key), datagrams=transport.datagrams)
        self._report = report
        self.has_echo, self.has_flags = receives.has("echo"), sends.has("flags")
        self.modulus = min(sends.modulus("sequence"), receives.modulus("echo"))
        self._shown = {"sent": 0, "received": 0}

    def stand_in(self, values: Callable[[Values], Mapping[str, Any]]) -> tuple[FrameChannel, StandIn]:
        """Return a channel to a stand-in of the peer, and the stand-in.

        Parameters
        ----------
        values : callable
            Returns the values of the reply to those of a frame, and of the peer's first frame to none.
        """
        sends, receives = self._formats
        sent, replies = (Codec(frame, self.groups, self._key) for frame in self._formats)

        def reply(content: bytes) -> bytes:
            return replies.encode(values(sent.decode(content) or {}))

        peer = StandIn(reply)
        return FrameChannel(peer, sends, receives, self.groups, key=self._key), peer

    def admit_by(self, admission: Callable[[Values], Admission]) -> None:
        """Use the frames that belong to a session alone."""
        self._decoder.admission = admission

    @property
    def counts(self) -> Counts:
        """Received frames by their fate."""
        return self._decoder.counts

    def figures(self) -> dict[str, int]:
        """Return the counts by name, with the datagrams of other senders."""
        return {**asdict(self.counts), "foreign": sum(self.transport.refused.values())}

    def send(self, values: Mapping[str, Any]) -> bytes:
        """Send a frame; return its bytes."""
        content = self._encoder.encode(values)
        self.transport.send(content)
        self._show("sent", content, values)
        return content

    def receive(self, timeout_s: float) -> list[Values]:
        """Return the new frames of the bytes that arrive within a time; none if nothing arrives."""
        content = self.transport.receive(timeout_s)
        if not content:
            return []
        frames = self._decoder.feed(content)
        if not frames:
            self.transport.refuse()
        else:
            self.transport.accept(is_peer=not frames[-1].get("flags", 0) & Flags.HELLO)
            self._show("received", content, frames[-1])
        return frames

    def drain(self) -> list[Values]:
        """Return the new frames that have arrived so far, of at most `LONGEST_BACKLOG` texts."""
        frames: list[Values] = []
        for _ in range(LONGEST_BACKLOG):
            content = self.transport.receive(0.0)
            if not content:
                break
            frames += self._decoder.feed(content)
        return frames

    def _show(self, direction: str, content: bytes, values: Mapping[str, Any]) -> None:
        if self._report and self._shown[direction] < SHOWN_FRAMES:
            self._shown[direction] += 1
            texts = ", ".join(f"{name} {_text(value)}" for name, value in values.items() if value is not None)
            self._report(f"{direction} {len(content)} bytes {content[:16].hex(' ')} …: {texts}")


def _text(value: Any) -> str:
    if hasattr(value, "__len__"):
        return "[" + " ".join(f"{number:.4g}" for number in value) + "]"
    return f"{value:.6g}" if isinstance(value, float) else str(int(value))
