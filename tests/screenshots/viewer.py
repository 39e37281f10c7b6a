"""Rerun's viewer without a screen: it opens recordings, goes to a time, and says what it drew as a picture.

It needs a Vulkan driver, which may be one in software (Debian: mesa-vulkan-drivers).
"""

from __future__ import annotations

import io
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


class HeadlessViewer:
    """A viewer with a window of a size that nobody sees.

    Raises
    ------
    RuntimeError
        There is no driver, or the viewer does not answer.
    """

    def __init__(self, width: int, height: int) -> None:
        with socket.socket() as probe:
            probe.bind((HOST, 0))
            port = probe.getsockname()[1]
        program = Path(rerun_cli.__file__).with_name("rerun")
        size = f"{width}x{height + TOP_BAR_PIXELS}"
        options = ["--headless", "--window-size", size, "--port", f"{port}", "--bind", HOST]
        self._process = subprocess.Popen(
            [program, *options, "--hide-welcome-screen"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self._address = f"rerun+http://{HOST}:{port}/proxy"
        self._client: rerun.experimental.ViewerClient
        _until(READY_S, self._answers, "the viewer to answer")

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


def _until(seconds: float, done, what: str) -> None:
    deadline = time.monotonic() + seconds
    while not done():
        if time.monotonic() > deadline:
            raise RuntimeError(f"expected {what} within {seconds:g} s")
        time.sleep(0.3)
