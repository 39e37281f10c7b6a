"""Watching a run while it goes on: Rerun's web viewer, reachable from this machine alone."""

from __future__ import annotations

import os
import socket
import subprocess
import urllib.parse

import rerun as rr

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.viz.recording.program import PROGRAM

HOST = "127.0.0.1"

# Kept for viewers that join late; the oldest data make room first.
SERVER_MEMORY = "500MB"


class Viewer:
    """A server for the data and one for the viewer's page, both on 127.0.0.1.

    The viewer runs as a process of its own with an explicit address: Rerun's calls that start one from
    Python listen on every interface.
    """

    def __init__(self) -> None:
        self.sink = rr.GrpcServerSink(HOST, _free_port(), server_memory_limit=SERVER_MEMORY)
        self._web_port = _free_port()
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def address(self) -> str:
        """Page to open in a browser."""
        return f"http://{HOST}:{self._web_port}/?url={urllib.parse.quote(self.sink.uri, safe='')}"

    def start(self) -> None:
        """Serve the page."""
        options = ["--serve-web", "--bind", HOST, "--web-viewer-port", str(self._web_port), self.sink.uri]
        try:
            self._process = subprocess.Popen(
                [PROGRAM, *options],
                env={**os.environ, "RERUN_APP_ONLY": "true", "RUST_LOG": "error"},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        except OSError as error:
            raise SpheretwinError(f"viewer: expected Rerun's viewer at {PROGRAM}, {error}") from None

    def close(self) -> None:
        """End the page's server."""
        if self._process:
            self._process.terminate()
            self._process.wait()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
