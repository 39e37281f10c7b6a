"""Live view of a run: Rerun's web viewer and the growing recording, served to this machine only."""

from __future__ import annotations

import urllib.parse
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Condition, Thread
from uuid import uuid4

import rerun as rr
import rerun.blueprint as rrb

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.telemetry.run_record import RunFacts
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.layout.layout import opening_layout
from spheretwin.viz.layout.view import LIVE_WINDOW_S, OVERVIEW, application
from spheretwin.viz.recording.part import RecordingPart, RecordingSubject
from spheretwin.viz.recording.stream import Stream, parts_of_run
from spheretwin.viz.rerun_internals import HEADER_BYTES, HOST, INDEX, messages, read_assets

# Kept for viewers that connect late; the oldest pieces are dropped first.
KEPT_BYTES = 200 << 20

# A reader that is farther behind continues with the newest piece: a live view shows the present.
BEHIND_BYTES = 8 << 20


class Broadcast:
    """Pieces of a recording, each of complete messages, in bounded memory.

    Parameters
    ----------
    kept_bytes : int
        Bytes of pieces, besides those that every reader needs; at least the newest is kept.
    behind_bytes : int
        Bytes that a reader may be behind.
    """

    def __init__(self, kept_bytes: int = KEPT_BYTES, behind_bytes: int = BEHIND_BYTES) -> None:
        self._kept_bytes, self._behind_bytes = kept_bytes, behind_bytes
        self._first: bytes | None = None
        self._pieces: deque[tuple[int, bytes]] = deque()  # each with the bytes that were sent before it
        self._dropped, self._sent_bytes = 0, 0
        self._ended = False
        self._changed = Condition()

    def begin(self, first: bytes) -> None:
        """Give what every reader needs."""
        with self._changed:
            self._first = first
            self._changed.notify_all()

    def send(self, piece: bytes) -> None:
        """Send the next piece."""
        with self._changed:
            self._pieces.append((self._sent_bytes, piece))
            self._sent_bytes += len(piece)
            while self._sent_bytes - self._pieces[0][0] > self._kept_bytes and len(self._pieces) > 1:
                self._pieces.popleft()
                self._dropped += 1
            self._changed.notify_all()

    def end(self) -> None:
        """End the broadcast."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def read(self) -> Iterator[bytes]:
        """Yield the first bytes, the pieces that are kept, and then new pieces, to the end.

        A reader that falls behind after it has read the kept pieces misses those between.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._first is not None or self._ended)
            first, place, late = self._first, self._dropped, self._count
        if first is not None:
            yield first
        while (result := self._next(place, late)) is not None:
            place, piece = result
            yield piece

    @property
    def _count(self) -> int:
        """Pieces that were ever sent."""
        return self._dropped + len(self._pieces)

    def _next(self, place: int, late: int) -> tuple[int, bytes] | None:
        """Return the piece at a place, or a newer one, and the next place; None after the end."""
        with self._changed:
            self._changed.wait_for(lambda: place < self._count or self._ended)
            if place == self._count:
                return None
            place = max(place, self._dropped)
            before, piece = self._pieces[place - self._dropped]
            if place >= late and self._sent_bytes - before > self._behind_bytes:
                place, (_, piece) = self._count - 1, self._pieces[-1]
            return place + 1, piece


RECORDING = "/live.rrd"

# The browser refuses any request of a page of this server to another host.
POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'unsafe-inline';"
    " connect-src 'self' data: blob:; img-src 'self' data: blob:; worker-src 'self' blob:"
)


class ViewerServer:
    """Serves the viewer and one recording on 127.0.0.1, from threads that end with this process.

    It answers from the moment it is made.

    Parameters
    ----------
    recording : Broadcast
        Recording for the viewer.

    Raises
    ------
    SpheretwinError
        The viewer's files are not there.
    """

    def __init__(self, recording: Broadcast) -> None:
        assets = read_assets()

        class Handler(_Handler):
            def answer(self, path: str) -> None:
                if path == RECORDING:
                    self.stream(recording)
                elif asset := assets.get(path):
                    self.whole(asset.kind, asset.content)
                else:
                    self.send_error(404)

        self._server = _Server((HOST, 0), Handler)
        self._thread = Thread(target=self._server.serve_forever, name="viewer server", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """Page to open in a browser."""
        return f"http://{HOST}:{self._server.server_port}/"

    def close(self) -> None:
        """Stop the server."""
        self._server.shutdown()
        self._server.server_close()


class _Server(ThreadingHTTPServer):
    """Answers each request in a separate thread, not waited for: a viewer may never read its answer."""

    daemon_threads = True
    block_on_close = False

    def handle_error(self, *_: object) -> None:
        """Leave the terminal to the run: a viewer was closed amid its request."""


class _Handler(ABC, BaseHTTPRequestHandler):
    """Handler of one request; a subclass defines the content."""

    @abstractmethod
    def answer(self, path: str) -> None:
        """Answer a request for a path."""

    def do_GET(self) -> None:
        """Answer, unless a page of another host sent the request under another name of this host."""
        here = f"{HOST}:{self.connection.getsockname()[1]}"
        path, _, query = self.path.partition("?")
        with suppress(OSError):  # the viewer was closed
            if self.headers["Host"] != here:
                self.send_error(403)
            elif path == "/" and not query:
                recording = urllib.parse.quote(f"http://{here}{RECORDING}", safe="")
                self.send_response(302)
                self.send_header("Location", f"/?url={recording}")
                self.end_headers()
            else:
                self.answer(INDEX if path == "/" else path)

    def whole(self, kind: str, content: bytes) -> None:
        """Send a file."""
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Content-Security-Policy", POLICY)
        self.end_headers()
        self.wfile.write(content)

    def stream(self, recording: Broadcast) -> None:
        """Send a recording as it grows, until it ends."""
        self.send_response(200)
        self.send_header("Content-Type", "application/octet-stream")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        for piece in recording.read():
            self.wfile.write(piece)

    def log_message(self, *_: object) -> None:
        """Leave the terminal to the run."""


TOGETHER_S = 1.0
"""Time that is recorded together.

A viewer that draws in software on busy cores takes no more than some twenty entities a second. With four
times as many it was 22 s late after half a minute, with these 2 s.
"""


class LiveStream(Stream):
    """Stream to a page at 127.0.0.1 that shows a recording as it grows to any number of viewers.

    Nobody waits for a viewer: viewers read a bounded buffer in memory, and one that is too far behind
    continues with the newest data. The page answers as soon as the object exists.

    Parameters
    ----------
    subject, parts, application
        As for `Stream`.
    layout : Blueprint

    Raises
    ------
    InputError
        A mesh of the model cannot be read.
    SpheretwinError
        Rerun's viewer is not there.
    """

    def __init__(
        self,
        subject: RecordingSubject,
        parts: Sequence[RecordingPart],
        application: str,
        layout: rrb.Blueprint,
    ) -> None:
        super().__init__(subject, parts, application)
        self._layout = layout
        self._bytes = rr.binary_stream(self.recording)
        self._broadcast = Broadcast()
        self._begun = False
        self._server = ViewerServer(self._broadcast)
        self.begin()

    @property
    def address(self) -> str:
        """Page to open in a browser."""
        return self._server.address

    def connect(self) -> None:
        """Send the layout before all else."""
        self.recording.send_blueprint(self._layout)

    def is_due(self, waiting: Sequence[Table]) -> bool:
        """Return True if the waiting rows are recorded now: those of one second together."""
        return bool(waiting[-1]["t_s"][-1] - waiting[0]["t_s"][0] >= TOGETHER_S)

    def send(self) -> None:
        """Send viewers the data recorded since the last call; the first call sends what each needs."""
        encoded = self._bytes.read() or b""
        if not self._begun:
            self._begun = True
            self._broadcast.begin(encoded[:HEADER_BYTES] + messages(encoded))
        elif piece := messages(encoded):
            self._broadcast.send(piece)

    def complete(self) -> None:
        """Stop the server.

        Raises
        ------
        SpheretwinError
            Some of the view could not be made.
        """
        self._broadcast.end()
        self._server.close()
        self.recording.disconnect()
        if self.fault:
            raise SpheretwinError(f"live view: {self.fault}")


class LiveView(LiveStream):
    """Takes a run's telemetry chunk by chunk and shows it to any number of viewers.

    Parameters
    ----------
    actuator, signals, facts, shown, window_s
        As for `RecordingSubject`.

    Raises
    ------
    InputError
        A mesh of the model cannot be read.
    SpheretwinError
        Rerun's viewer is not there.
    """

    def __init__(
        self,
        actuator: Actuator,
        signals: tuple[Signal, ...],
        facts: RunFacts,
        *,
        shown: str = OVERVIEW,
        window_s: float = LIVE_WINDOW_S,
    ) -> None:
        subject = RecordingSubject(actuator, signals, facts, True, shown, uuid4().hex, window_s)
        view = subject.view
        super().__init__(subject, parts_of_run(subject), application(view), opening_layout(view))
