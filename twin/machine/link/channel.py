"""Channel: frames of two directions over one transport, found among any bytes and counted."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from spheretwin.machine.link import frame_format
from spheretwin.machine.link.admission import Admission
from spheretwin.machine.link.codec import LARGEST_FRAME, Codec, Values
from spheretwin.machine.link.frame_format import Flags, FrameFormat
from spheretwin.machine.link.transports import StandIn, Transport, open_transport
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError

REMEMBERED = 1024
"""Missing frames that are recognised if they arrive later."""


@dataclass
class Counts:
    """Frames by their fate.

    Attributes
    ----------
    accepted : int
        New frames, in order.
    lost : int
        Sequence numbers that did not arrive.
    duplicated : int
        Frames that had arrived before; also older ones than the decoder remembers.
    reordered : int
        Frames that arrived after a newer one; they are not used.
    corrupt : int
        Runs of bytes that are no frame.
    refused : int
        Frames that do not belong to the session.
    late : int
        Control ticks without a new frame.
    """

    accepted: int = 0
    lost: int = 0
    duplicated: int = 0
    reordered: int = 0
    corrupt: int = 0
    refused: int = 0
    late: int = 0


class Decoder:
    """Decoder of the bytes of one sender.

    Bytes of any content raise nothing: those that are no frame are counted.

    Parameters
    ----------
    codec : Codec
    datagrams : bool
        True if each call of `feed` has complete frames; otherwise a frame may span several calls.

    Attributes
    ----------
    counts : Counts
    admission : callable
        Returns the place of a frame in the session; by default, each is in order.
    """

    def __init__(self, codec: Codec, *, datagrams: bool) -> None:
        self._codec, self._datagrams = codec, datagrams
        self.counts = Counts()
        self.admission: Callable[[Values], Admission] = lambda _: Admission.IN_ORDER
        self._sequence = SequenceCheck(self.counts, codec.frame.modulus("sequence"))
        self._rest = bytearray()
        self._skipping = False

    def feed(self, content: bytes) -> list[Values]:
        """Return the new frames of received bytes, in the order of arrival."""
        self._rest += content
        frames = self._lines() if self._codec.frame.encoding == "json" else self._binary()
        if self._datagrams:
            if self._rest:
                self._reject()
            self._rest.clear()
            self._skipping = False
        return [frame for frame in frames if self._is_new(frame)]

    def _is_new(self, frame: Values) -> bool:
        place = self.admission(frame)
        if place == Admission.REFUSED:
            self.counts.refused += 1
            return False
        if place == Admission.REQUEST:
            self.counts.accepted += 1
            return True
        if place == Admission.FIRST:
            self._sequence.restart()
        return self._sequence.is_new(frame.get("sequence"))

    def _reject(self) -> None:
        """Count a run of bytes that is no frame, once."""
        self.counts.corrupt += not self._skipping
        self._skipping = True

    def _binary(self) -> list[Values]:
        codec, rest, first, frames = self._codec, self._rest, 0, []
        while True:
            start = rest.find(codec.start, first)
            if start < 0:  # the last bytes may be the beginning of a marker
                start = max(first, len(rest) - len(codec.start) + 1)
            if start > first:
                self._reject()
                first = start
            if len(rest) - first < codec.size:
                break
            values = codec.decode(bytes(rest[first : first + codec.size]))
            if values is None:
                self._reject()
                first += 1
            else:
                self._skipping = False
                frames.append(values)
                first += codec.size
        del rest[:first]
        return frames

    def _lines(self) -> list[Values]:
        frames = []
        while (end := self._rest.find(b"\n")) >= 0:
            line = bytes(self._rest[:end])
            del self._rest[: end + 1]
            if not line.strip():
                continue
            values = self._codec.decode(line) if len(line) <= LARGEST_FRAME else None
            if values is None:
                self._reject()
                self._skipping = False  # each line counts
            else:
                frames.append(values)
        if len(self._rest) > LARGEST_FRAME:
            self._reject()
            self._rest.clear()
        return frames


class SequenceCheck:
    """Check of sequence numbers, which wrap around: counts frames that are lost, duplicated or reordered.

    Parameters
    ----------
    counts : Counts
        Changed at each frame.
    modulus : int
        Sequence numbers run from 0 to the one below.
    """

    def __init__(self, counts: Counts, modulus: int) -> None:
        self._counts, self._modulus = counts, modulus
        self._newest: int | None = None
        self._missing: OrderedDict[int, None] = OrderedDict()

    def restart(self) -> None:
        """Accept the next sequence number, whatever it is."""
        self._newest = None
        self._missing.clear()

    def is_new(self, sequence: int | None) -> bool:
        """Count a frame; return True if it is newer than every frame before. Frames without numbers are."""
        counts = self._counts
        ahead = 1 if self._newest is None or sequence is None else (sequence - self._newest) % self._modulus
        if ahead == 0:
            counts.duplicated += 1
            return False
        if ahead > self._modulus // 2:
            if sequence is not None and sequence in self._missing:
                del self._missing[sequence]
                counts.lost -= 1
                counts.reordered += 1
            else:
                counts.duplicated += 1
            return False
        if ahead > 1 and sequence is not None:
            counts.lost += ahead - 1
            for back in range(min(ahead, REMEMBERED) - 1, 0, -1):
                self._missing[(sequence - back) % self._modulus] = None
            while len(self._missing) > REMEMBERED:
                self._missing.popitem(last=False)
        self._newest = sequence
        counts.accepted += 1
        return True


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

    @classmethod
    def open(
        cls,
        address: str,
        frame: str,
        groups: int,
        *,
        listening: bool = False,
        report: Callable[[str], None] | None = None,
        key: bytes = b"",
    ) -> FrameChannel:
        """Open the channel of a controller to a machine; if it listens, that of a machine to a controller.

        Raises
        ------
        InputError
            The address or the frames cannot be used, or the machine receives no commands.
        """
        frames = frame_format.load(frame)
        if frames.command is None:
            raise InputError(f"frame {frame}: expected a description with a command, received none")
        sends, receives = frames.command, frames.measurement
        if listening:
            sends, receives = receives, sends
        transport = open_transport(address, listening=listening)
        try:
            return cls(transport, sends, receives, groups, report, key)
        except InputError:
            transport.close()
            raise

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

    def send_command(
        self,
        sequence: int,
        session: int | None,
        flags: Flags,
        t_s: float = 0.0,
        current_A: Array | None = None,
    ) -> Values:
        """Send a command, without currents unless they are given; return its values."""
        values: Values = {"sequence": sequence, "session": session, "flags": flags, "time": t_s}
        values["current"] = np.zeros(self.groups) if current_A is None else current_A
        self.send(values)
        return values

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
