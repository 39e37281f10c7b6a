"""Transports of frames: UDP, serial line, standard input and output."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import sys
import time
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import urlsplit

from spheretwin.models.base.errors import InputError, SpheretwinError, shown, without_breaks
from spheretwin.models.base.extras import missing

LOOPBACK = "127.0.0.1"
LARGEST_READ = 65536
BAUD = 115200
WRITE_s = 1.0

MOST_NAMES = 16
"""Senders whose datagrams are counted by name."""

LOOK_s, MOST_LOOKS = 0.1, 32
"""Time between two looks at the datagrams of others, and datagrams of a look."""

MOST_QUEUED = 1_000
"""Datagrams that a socket may hold."""

EXPECTED = "udp://HOST:PORT, serial:DEVICE@BAUD, or - for standard input and output"


class Transport(ABC):
    """Connection to one peer.

    Attributes
    ----------
    datagrams : bool
        True if each received text has complete frames.
    refused : Counter
        Datagrams of other senders than the peer, by sender; they are dropped.
    announce : callable
        Receives a line for the peer and for each refused sender.
    is_closed : bool
        True if the peer has closed the connection.
    """

    datagrams = True
    is_closed = False

    def __init__(self) -> None:
        self.refused: Counter[str] = Counter()
        self.announce: Callable[[str], None] = lambda _: None

    @abstractmethod
    def send(self, content: bytes) -> None:
        """Send bytes; they are dropped as long as there is no peer."""

    @abstractmethod
    def receive(self, timeout_s: float) -> bytes:
        """Return the received bytes, after at most a time; empty if there are none."""

    def accept(self, *, is_peer: bool = True) -> None:  # noqa: B027  a line has one sender alone
        """Answer the sender of the last received bytes; as the peer, it is the only one that is heard."""

    def refuse(self) -> None:  # noqa: B027  as above
        """Count the sender of the last received bytes as refused, unless it is the peer."""

    def close(self) -> None:  # noqa: B027  a stand-in holds nothing open
        """Close the connection."""


class Udp(Transport):
    """Datagrams; a listening end takes the sender of the first frame of a session as the peer.

    Parameters
    ----------
    host, port : str, int
    listening : bool
        True binds the address, False sends to it.
    """

    def __init__(self, host: str, port: int, *, listening: bool) -> None:
        super().__init__()
        self._peer: Any = None
        self._candidate: Any = None
        self._others: socket.socket | None = None
        self._early: deque[bytes] = deque()
        self._look_s = 0.0
        self._sender: Any = None
        self._listening = listening
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            if listening:
                self._socket.bind((host, port))
            else:
                self._socket.connect((host, port))  # the system drops datagrams of other senders
        except (OSError, OverflowError, UnicodeError) as error:
            self._socket.close()
            raise InputError(
                f"link: expected an address that can be used, received udp://{host}:{port},"
                f" {without_breaks(error)}"
            ) from None

    @property
    def port(self) -> int:
        """Own port."""
        return int(self._socket.getsockname()[1])

    def send(self, content: bytes) -> None:
        """Send a datagram; one that the system cannot send now is lost, as on a network."""
        with contextlib.suppress(OSError):
            if not self._listening:
                self._socket.send(content)
            elif self._peer or self._candidate:
                self._socket.sendto(content, self._peer or self._candidate)

    def receive(self, timeout_s: float) -> bytes:
        """Return a datagram of the peer, or of anyone before there is a peer."""
        if self._early:
            return self._early.popleft()
        if self._others and time.monotonic() >= self._look_s:
            self._look_at_others()
        if not _is_readable(self._socket, timeout_s):
            return b""
        try:
            content, self._sender = self._socket.recvfrom(LARGEST_READ)
        except OSError:  # the peer does not listen yet
            return b""
        if self._peer and self._sender != self._peer:
            self.refuse()
            return b""
        return content

    def accept(self, *, is_peer: bool = True) -> None:
        """Answer the last sender; take it as the peer unless it has only made a request."""
        if not self._listening or self._peer:
            return
        self._candidate = self._sender
        if is_peer:
            self._peer = self._sender
            self.announce(f"the peer is {_name(self._peer)}")
            self._separate_others()

    def refuse(self) -> None:
        """Count the last datagram as one of a refused sender, and report it if it is the first of it."""
        if self._listening and self._sender:
            self._refuse(self._sender)

    def _refuse(self, sender: Any) -> None:
        if sender == self._peer:
            return
        name = _name(sender)
        if name not in self.refused and len(self.refused) >= MOST_NAMES:
            name = "others"
        if not self.refused[name]:
            self.announce(f"refused: {name}")
        self.refused[name] += 1

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
        if self._others:
            self._others.close()

    def _separate_others(self) -> None:
        """Give the peer a socket of its own: the system sorts the datagrams, and others fill no queue of it.

        Without the option, as on Windows, one socket receives all, and datagrams of others take time.
        """
        if not hasattr(socket, "SO_REUSEPORT"):
            return
        own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            for end in (self._socket, own):
                end.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
            own.bind(self._socket.getsockname())
            own.connect(self._peer)
        except OSError:
            own.close()
            return
        finally:  # no other program shares the port
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 0)
        own.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 0)
        self._socket, self._others = own, self._socket
        for content, sender in self._datagrams_of_others(MOST_QUEUED):  # sent before the peer had its socket
            if sender == self._peer:
                self._early.append(content)

    def _look_at_others(self) -> None:
        """Count some datagrams of others; what their queue cannot hold is lost without a count."""
        self._look_s = time.monotonic() + LOOK_s
        for _, sender in self._datagrams_of_others(MOST_LOOKS):
            self._refuse(sender)

    def _datagrams_of_others(self, most: int) -> Iterator[tuple[bytes, Any]]:
        """Yield what waits in the socket of others, with its sender."""
        for _ in range(most):
            if not (self._others and _is_readable(self._others, 0.0)):
                return
            with contextlib.suppress(OSError):
                yield self._others.recvfrom(LARGEST_READ)


def _name(sender: Any) -> str:
    return f"{sender[0]}:{sender[1]}"


class ByteStream(Transport):
    """Bytes from and to files of the system: a pipe or a serial line.

    Parameters
    ----------
    source, sink : int
        File descriptors.
    close : callable
        Closes them.
    """

    datagrams = False

    def __init__(self, source: int, sink: int, close: Callable[[], object] = lambda: None) -> None:
        super().__init__()
        self._source, self._sink, self._close = source, sink, close

    def send(self, content: bytes) -> None:
        """Write all bytes.

        Raises
        ------
        SpheretwinError
            The peer does not read them.
        """
        rest = memoryview(content)
        try:
            while rest and not self.is_closed:
                if not select.select([], [self._sink], [], WRITE_s)[1]:
                    raise SpheretwinError(f"link: expected a peer that reads, received none in {WRITE_s:g} s")
                rest = rest[os.write(self._sink, rest) :]
        except OSError:
            self.is_closed = True

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes that have arrived."""
        if self.is_closed or not _is_readable(self._source, timeout_s):
            return b""
        try:
            content = os.read(self._source, LARGEST_READ)
        except OSError:
            content = b""
        self.is_closed = not content
        return content

    def close(self) -> None:
        """Close the files."""
        self._close()


class StandIn(Transport):
    """Transport to a peer that replies at once, with a clock that only waiting moves.

    Parameters
    ----------
    reply : callable
        Returns the reply to sent bytes, and the first frame of the peer to no bytes.
    """

    def __init__(self, reply: Callable[[bytes], bytes]) -> None:
        super().__init__()
        self._reply, self._waiting, self._now_s = reply, reply(b""), 0.0

    def now(self) -> float:
        """Return the time of its clock, s."""
        return self._now_s

    def send(self, content: bytes) -> None:
        """Take bytes; the reply waits."""
        self._waiting = self._reply(content)

    def receive(self, timeout_s: float) -> bytes:
        """Return the reply; without one the time passes."""
        content, self._waiting = self._waiting, b""
        if not content:
            self._now_s += timeout_s + 1e-9  # rounding must not leave a rest to wait for
        return content


def _is_readable(file: Any, timeout_s: float) -> bool:
    return bool(select.select([file], [], [], max(timeout_s, 0.0))[0])


def open_transport(address: str, *, listening: bool = False) -> Transport:
    """Open a transport by its address.

    Parameters
    ----------
    address : str
        ``udp://host:port`` (host 127.0.0.1 unless given), ``serial:/dev/ttyX@115200``, or ``-``.
    listening : bool
        True for the end that waits for the other one.

    Raises
    ------
    InputError
        The address is invalid or cannot be opened, or pyserial is not installed.
    """
    kind, _, rest = address.partition(":")
    if sys.platform == "win32" and (address == "-" or kind == "serial"):
        raise InputError(  # select waits for sockets alone there
            f"link: expected udp://HOST:PORT on Windows, received {shown(address)}"
        )
    if address == "-":
        return _standard_streams()
    if kind == "serial" and rest:
        return _serial_line(rest)
    try:
        parts = urlsplit(address)
        host, port = parts.hostname or LOOPBACK, parts.port
    except ValueError:  # a port that is no number
        port = None
    if kind != "udp" or port is None or (port == 0 and not listening) or parts.path.strip("/"):
        raise InputError(f"link: expected {EXPECTED}, received {shown(address)}")
    return Udp(host, port, listening=listening)


def _standard_streams() -> ByteStream:
    """Return standard input and output; what is printed from now on goes to standard error."""
    sys.stdout.flush()
    sink = os.dup(1)
    os.dup2(2, 1)
    return ByteStream(0, sink, lambda: os.close(sink))


def _serial_line(rest: str) -> ByteStream:
    device, _, baud = rest.partition("@")
    if baud and not (baud.isascii() and baud.isdecimal()):
        raise InputError(f"link: expected {EXPECTED}, received {shown(f'serial:{rest}')}")
    try:
        import serial
    except ModuleNotFoundError:
        raise missing("link", "pyserial", "machine") from None
    try:
        port = serial.Serial(device, int(baud or BAUD), timeout=0)
    except (OSError, ValueError) as error:
        raise InputError(
            f"link: expected a serial line that can be opened, received {device}, {without_breaks(error)}"
        ) from None
    port.reset_input_buffer()  # frames from before the start are late
    return ByteStream(port.fileno(), port.fileno(), port.close)
