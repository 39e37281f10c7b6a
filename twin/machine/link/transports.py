"""Transports of frames: UDP, serial line, standard input and output."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import sys
from collections.abc import Callable
from typing import Any, Protocol
from urllib.parse import urlsplit

from spheretwin.models.base.errors import InputError, SpheretwinError, shown, without_breaks
from spheretwin.models.base.extras import missing

LOOPBACK = "127.0.0.1"
LARGEST_READ = 65536
BAUD = 115200
WRITE_s = 1.0

EXPECTED = "udp://HOST:PORT, serial:DEVICE@BAUD, or - for standard input and output"


class Transport(Protocol):
    """Connection to one peer.

    Attributes
    ----------
    datagrams : bool
        True if each received text has complete frames.
    foreign : int
        Datagrams of other senders than the peer; they are dropped.
    is_closed : bool
        True if the peer has closed the connection.
    """

    datagrams: bool
    foreign: int
    is_closed: bool

    def send(self, content: bytes) -> None:
        """Send bytes; they are dropped as long as there is no peer."""

    def receive(self, timeout_s: float) -> bytes:
        """Return the received bytes, after at most a time; empty if there are none."""

    def accept(self) -> None:
        """Take the sender of the last received bytes as the peer: from now on no other one is heard."""

    def close(self) -> None:
        """Close the connection."""


class Udp:
    """Datagrams; a listening end takes the sender of its first valid frame as the peer.

    Parameters
    ----------
    host, port : str, int
    listening : bool
        True binds the address, False sends to it.
    """

    datagrams, is_closed = True, False

    def __init__(self, host: str, port: int, *, listening: bool) -> None:
        self.foreign = 0
        self._peer: Any = None
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
            elif self._peer:
                self._socket.sendto(content, self._peer)

    def receive(self, timeout_s: float) -> bytes:
        """Return a datagram of the peer, or of anyone before there is a peer."""
        if not _is_readable(self._socket, timeout_s):
            return b""
        try:
            content, sender = self._socket.recvfrom(LARGEST_READ)
        except OSError:  # the peer does not listen yet
            return b""
        if self._peer and sender != self._peer:
            self.foreign += 1
            return b""
        self._sender = sender
        return content

    def accept(self) -> None:
        """Take the last sender as the peer."""
        if self._listening and not self._peer:
            self._peer = self._sender

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class Stream:
    """Bytes from and to files of the system: a pipe or a serial line.

    Parameters
    ----------
    source, sink : int
        File descriptors.
    close : callable
        Closes them.
    """

    datagrams, foreign = False, 0

    def __init__(self, source: int, sink: int, close: Callable[[], object] = lambda: None) -> None:
        self._source, self._sink, self._close = source, sink, close
        self.is_closed = False

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

    def accept(self) -> None:
        """Do nothing: there is only one peer."""

    def close(self) -> None:
        """Close the files."""
        self._close()


class StandIn:
    """Transport to a peer that replies at once, with a clock that only waiting moves.

    Parameters
    ----------
    reply : callable
        Returns the reply to sent bytes, and the first frame of the peer to no bytes.
    """

    datagrams, foreign, is_closed = True, 0, False

    def __init__(self, reply: Callable[[bytes], bytes]) -> None:
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

    def accept(self) -> None:
        """Do nothing: there is only one peer."""

    def close(self) -> None:
        """Do nothing."""


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


def _standard_streams() -> Stream:
    """Return standard input and output; what is printed from now on goes to standard error."""
    sys.stdout.flush()
    sink = os.dup(1)
    os.dup2(2, 1)
    return Stream(0, sink, lambda: os.close(sink))


def _serial_line(rest: str) -> Stream:
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
    return Stream(port.fileno(), port.fileno(), port.close)
