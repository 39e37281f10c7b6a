"""What a browser on this machine asks for: the viewer's files, and the recording as it grows."""

from __future__ import annotations

import urllib.parse
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

from spheretwin.viz.recording.viewer.assets import HOST, INDEX, read_assets
from spheretwin.viz.recording.viewer.broadcast import Broadcast

RECORDING = "/live.rrd"

# The browser itself refuses whatever a page of this server asks of another host.
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
        What the viewer is to show.

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
        """Serve nobody any more."""
        self._server.shutdown()
        self._server.server_close()


class _Server(ThreadingHTTPServer):
    """Answers each request in a thread that nobody waits for: a viewer may take nothing for ever."""

    daemon_threads = True
    block_on_close = False

    def handle_error(self, *_: object) -> None:
        """Leave the terminal to the run: a viewer was closed amid its request."""


class _Handler(BaseHTTPRequestHandler):
    """One request; a subclass says what there is."""

    def answer(self, path: str) -> None:
        """Answer a request for a path."""
        raise NotImplementedError

    def do_GET(self) -> None:
        """Answer, unless a page of another host asks under a name of its own for this one."""
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
