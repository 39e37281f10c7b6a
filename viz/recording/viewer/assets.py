"""The files of Rerun's web viewer, as its program serves them, made to ask nothing of another machine."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import NamedTuple

import rerun_cli

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.base.wording import without_breaks

HOST = "127.0.0.1"
INDEX = "/index.html"
FILES = (INDEX, "/re_viewer.js", "/re_viewer_bg.wasm", "/favicon.ico", "/apple-touch-icon.png")

# Its program is large, and where nothing of it is in the machine's cache it has to be read first.
_PATIENCE_S = 60.0

# Without this, it asks its makers' server for the number of its latest release, and tells it what is opened.
_GUARD = """<script>
      const ask = window.fetch;
      window.fetch = (what, options) =>
        new URL(what.url ?? what, location).host === location.host
          ? ask(what, options)
          : Promise.resolve(new Response(null, { status: 204 }));
    </script>
    """
_OUTSIDE = re.compile(r"<link\b[^>]*https://[^>]*>\s*")

# Ends the program as soon as whoever wanted its files is gone, even by SIGKILL: then its input ends.
_SUPERVISED = """
import os, subprocess, sys, threading
program = subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL)
threading.Thread(target=lambda: (os.read(0, 1), program.kill()), daemon=True).start()
os._exit(program.wait() != 0)
"""


class Asset(NamedTuple):
    """A file of the viewer."""

    kind: str
    """Its media type."""
    content: bytes


def read_assets() -> dict[str, Asset]:
    """Files of the viewer by their paths; the program that holds them runs as long as this takes.

    Raises
    ------
    SpheretwinError
        The program is missing or gives none.
    """
    program = Path(rerun_cli.__file__).with_name("rerun.exe" if sys.platform == "win32" else "rerun")
    if not program.is_file():
        raise SpheretwinError(f"viewer: expected Rerun's viewer at {program}, received none")
    port = _free_port()
    # Without an address of data it would serve some itself.
    options = ["--serve-web", "--bind", HOST, "--web-viewer-port", str(port), f"rerun+http://{HOST}:1/proxy"]
    try:
        with subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", _SUPERVISED, str(program), *options],
            env={**os.environ, "CI": "1", "RUST_LOG": "off"},  # in a CI it keeps no statistics of its use
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        ) as process:
            assets = {path: _read(port, path, process) for path in FILES}
            process.stdin.close()  # type: ignore[union-attr]
    except OSError as error:
        raise SpheretwinError(
            f"viewer: expected the files of Rerun's viewer, {without_breaks(error)}"
        ) from None
    return {**assets, INDEX: _kept_here(assets[INDEX])}


def _read(port: int, path: str, process: subprocess.Popen[bytes]) -> Asset:
    """A file, as soon as the program answers."""
    until = time.monotonic() + _PATIENCE_S
    while True:
        try:
            with urllib.request.urlopen(f"http://{HOST}:{port}{path}", timeout=_PATIENCE_S) as answer:
                return Asset(answer.headers["Content-Type"], answer.read())
        except urllib.error.HTTPError as error:
            raise OSError(f"{path}: {error}") from None
        except OSError:
            if process.poll() is not None or time.monotonic() > until:
                raise
            time.sleep(0.01)


def _kept_here(index: Asset) -> Asset:
    """The page without fonts of another host, and with its own requests kept on this one."""
    text = _OUTSIDE.sub("", index.content.decode())
    return index._replace(content=text.replace("<script>", f"{_GUARD}<script>", 1).encode())


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
