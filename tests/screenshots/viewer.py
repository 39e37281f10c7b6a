"""Rerun's viewer without a screen: it opens recordings, goes to a time, and returns a picture of its window.

It needs a Vulkan driver, which may be one in software (Debian: mesa-vulkan-drivers).
"""

from __future__ import annotations

import io
import json
import socket
import subprocess
import time
from pathlib import Path
from types import TracebackType

import rerun.experimental
import rerun_cli
from PIL import Image

HOST = "127.0.0.1"
READY_S, LOADED_S, SETTLED_S = 60.0, 60.0, 20.0

# Above it are the viewer's own menu and what it says of the machine, which no page needs to show.
TOP_BAR_PIXELS = 36


THEMES = DARK, LIGHT = "dark", "light"

PROGRAM = Path(rerun_cli.__file__).with_name("rerun")


class HeadlessViewer:
    """A viewer with a window of a size that nobody sees.

    Parameters
    ----------
    width, height : int
        Size of the pictures, pixels.
    theme : str
        One of `THEMES`.

    Raises
    ------
    RuntimeError
        There is no driver, or the viewer does not answer.
    """

    def __init__(self, width: int, height: int, theme: str = DARK) -> None:
        with socket.socket() as probe:
            probe.bind((HOST, 0))
            port = probe.getsockname()[1]
        size = f"{width}x{height + TOP_BAR_PIXELS}"
        options = ["--headless", "--window-size", size, "--port", f"{port}", "--bind", HOST]
        self._process = subprocess.Popen(
            [PROGRAM, *options, "--hide-welcome-screen"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        self._address = f"rerun+http://{HOST}:{port}/proxy"
        self._client: rerun.experimental.ViewerClient
        try:
            _until(READY_S, self._answers, "the viewer to answer")
            if theme == LIGHT:
                self._choose_light()
        except BaseException:
            self._process.kill()
            raise

    def __enter__(self) -> HeadlessViewer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        self._process.wait()

    def open(self, path: Path) -> None:
        """Open a recording and wait until all of it is there."""
        self._client.open(str(path.resolve()))
        _until(LOADED_S, self._has_loaded, f"{path} to be loaded")

    def at(self, t_s: float) -> Image.Image:
        """What is drawn at a simulated time."""
        self._client.set_time("sim_time", duration=t_s, play_state="paused")
        before, deadline = b"", time.monotonic() + SETTLED_S
        while time.monotonic() < deadline:  # views appear one by one
            time.sleep(0.7)
            now = self._client.take_screenshot()
            if now == before:
                break
            before = now
        picture = Image.open(io.BytesIO(before)).convert("RGB")
        return picture.crop((0, TOP_BAR_PIXELS, *picture.size))

    def faults(self) -> list[str]:
        """What its views say that they could not draw."""
        views = self._client.get_state().views
        return [f"{view.name}: {report.summary}" for view in views for report in view.reports]

    def _choose_light(self) -> None:
        """Press the button of the settings: a viewer without a screen has no option for its theme."""
        self._client.run_command("ui.open_settings")
        steps = [
            ("wait_for", {"content_contains": "Light", "timeout_secs": int(READY_S)}),
            ("click", {"content_contains": "Light"}),
            ("hover", {"pos": {"x": 2, "y": 2}}),  # the pointer would be in the picture
            ("wait_for", {"min_steps": 3, "timeout_secs": int(READY_S)}),
        ]
        _control(self._client.url, [{"name": name, "args": arguments} for name, arguments in steps])

    def _answers(self) -> bool:
        if self._process.poll() is not None:
            raise RuntimeError("the viewer ended at its start; is a Vulkan driver installed?")
        try:
            self._client = rerun.experimental.ViewerClient.connect(self._address)
            self._client.get_state()
        except ConnectionError:  # it is not up yet
            return False
        return True

    def _has_loaded(self) -> bool:
        state = self._client.get_state()
        return not state.loading and any(recording.timelines for recording in state.recordings)


def _control(address: str, actions: list[dict]) -> None:
    """Let the viewer's own server of user actions perform some, one after another."""
    client = {
        "protocolVersion": "2024-11-05",
        "capabilities": {},
        "clientInfo": {"name": "test", "version": "1"},
    }
    requests = [
        {"id": 1, "method": "initialize", "params": client},
        {"method": "notifications/initialized"},
        {"id": 2, "method": "tools/call", "params": {"name": "batch", "arguments": {"actions": actions}}},
    ]
    with subprocess.Popen(
        [PROGRAM, "viewer-mcp", "--endpoint", address],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as process:
        for request in requests:
            process.stdin.write(json.dumps({"jsonrpc": "2.0", **request}) + "\n")
            process.stdin.flush()
        _, answer = process.stdout.readline(), json.loads(process.stdout.readline())
        process.terminate()
    if "error" in answer or answer["result"]["isError"]:
        raise RuntimeError(f"expected the viewer to perform {actions}, received {answer}")


def _until(seconds: float, done, what: str) -> None:
    deadline = time.monotonic() + seconds
    while not done():
        if time.monotonic() > deadline:
            raise RuntimeError(f"expected {what} within {seconds:g} s")
        time.sleep(0.3)
