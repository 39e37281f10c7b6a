"""Transports: addresses, UDP with strangers, serial lines on a pseudo-terminal, pipes."""

import contextlib
import math
import os
import socket
import subprocess
import sys

import pytest

from spheretwin.machine.link.transports import MOST_LOOKS, MOST_NAMES, ByteStream, Udp, open_transport
from spheretwin.models.base.errors import SpheretwinError
from tests.requirements import needs_pseudo_terminal
from tests.waiting import UNLIMITED_S


@pytest.fixture
def listener():
    with contextlib.closing(open_transport("udp://:0", listening=True)) as end:
        yield end


@pytest.fixture
def sender(listener):
    with contextlib.closing(open_transport(f"udp://127.0.0.1:{listener.port}")) as end:
        yield end


def test_it_listens_at_the_loopback_unless_an_address_is_given(listener):
    assert listener._socket.getsockname()[0] == "127.0.0.1"


@pytest.mark.skipif(
    not hasattr(socket, "SO_REUSEPORT"), reason="without SO_REUSEPORT a peer cannot have a socket of its own"
)
def test_a_stranger_is_not_heard_after_the_peer(listener, sender):
    lines = []
    listener.announce = lines.append
    with contextlib.closing(open_transport(f"udp://:{listener.port}")) as stranger:
        stranger.send(b"a stranger whose frame was not valid")
        assert listener.receive(UNLIMITED_S)
        sender.send(b"the peer")
        assert listener.receive(UNLIMITED_S) == b"the peer"
        listener.send(b"to nobody")
        listener.accept()
        listener._look_s = math.inf
        for _ in range(1000):  # a flood fills no queue of the peer, and costs no call
            stranger.send(b"currents")
        sender.send(b"the next one")
        assert listener.receive(UNLIMITED_S) == b"the next one"
        listener._look_s = 0.0
        assert listener.receive(0.0) == b""
        assert listener.refused == {f"127.0.0.1:{stranger.port}": MOST_LOOKS}
        assert lines == [f"the peer is 127.0.0.1:{sender.port}", f"refused: 127.0.0.1:{stranger.port}"]
        listener.send(b"answer")
        assert sender.receive(UNLIMITED_S) == b"answer"
        assert sender.receive(0.0) == b""
        assert stranger.receive(0.0) == b""


def test_what_the_peer_sends_before_it_has_its_socket_is_not_lost(listener, sender):
    for content in (b"first", b"second", b"third"):
        sender.send(content)
    assert listener.receive(UNLIMITED_S) == b"first"
    listener.accept()
    assert [listener.receive(UNLIMITED_S) for _ in range(2)] == [b"second", b"third"]


def test_the_port_of_a_peer_is_not_shared(listener, sender):
    sender.send(b"the peer")
    assert listener.receive(UNLIMITED_S)
    listener.accept()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        if hasattr(socket, "SO_REUSEPORT"):
            other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        with pytest.raises(OSError, match="in use"):
            other.bind(("127.0.0.1", listener.port))


def test_a_request_is_answered_and_makes_no_peer(listener, sender):
    sender.send(b"request")
    assert listener.receive(UNLIMITED_S)
    listener.accept(is_peer=False)
    listener.send(b"answer")
    assert sender.receive(UNLIMITED_S) == b"answer"
    with contextlib.closing(open_transport(f"udp://127.0.0.1:{listener.port}")) as other:
        other.send(b"command")
        assert listener.receive(UNLIMITED_S) == b"command"
        listener.accept()
        listener.send(b"answer")
        assert other.receive(UNLIMITED_S) == b"answer"


def test_many_refused_senders_are_counted_together(listener):
    for port in range(MOST_NAMES + 5):
        listener._sender = ("192.0.2.1", port)
        listener.refuse()
    assert len(listener.refused) == MOST_NAMES + 1
    assert listener.refused["others"] == 5


def test_nobody_at_the_address_is_silence():
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with contextlib.closing(Udp("127.0.0.1", port, listening=False)) as end:
        for _ in range(3):  # the system reports the refusal of a datagram at the next call
            end.send(b"anyone")
            assert end.receive(0.01) == b""


@needs_pseudo_terminal
def test_a_serial_line_carries_bytes_of_any_value():
    ours, theirs = os.openpty()
    everything = bytes(range(256))
    with contextlib.closing(open_transport(f"serial:{os.ttyname(theirs)}@230400")) as line:
        assert not line.datagrams
        os.write(ours, everything)
        received = b""
        while len(received) < 256:
            part = line.receive(UNLIMITED_S)
            assert part
            received += part
        assert received == everything
        line.send(everything)
        sent = b""
        while len(sent) < 256:
            sent += os.read(ours, 256)
        assert sent == everything
    os.close(ours)
    os.close(theirs)


def test_the_end_of_a_pipe_is_noticed():
    source, sink = os.pipe()
    ours, theirs = os.pipe()
    stream = ByteStream(source, theirs)
    os.write(sink, b"last words")
    os.close(sink)
    assert (stream.receive(UNLIMITED_S), stream.is_closed) == (b"last words", False)
    assert (stream.receive(UNLIMITED_S), stream.is_closed) == (b"", True)
    for descriptor in (source, ours, theirs):
        os.close(descriptor)


def test_a_peer_that_does_not_read_is_an_error(monkeypatch):
    monkeypatch.setattr("spheretwin.machine.link.transports.WRITE_s", 0.01)
    source, sink = os.pipe()
    os.set_blocking(sink, False)
    with pytest.raises(SpheretwinError, match="expected a peer that reads"):
        ByteStream(source, sink).send(bytes(2**22))  # more than any pipe holds
    os.close(source)
    os.close(sink)


def test_standard_output_is_for_frames_alone():
    code = (
        "from spheretwin.machine.link.transports import open_transport\n"
        "line = open_transport('-')\n"
        "print('for people')\n"
        f"line.send(line.receive({UNLIMITED_S})[::-1])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], input=b"emarf", capture_output=True, check=True)
    assert (done.stdout, done.stderr.strip()) == (b"frame", b"for people")
