"""Short silent clips: frames of a recording in the viewer, or of a bench that is driven in Chromium.

A clip is an animated WebP that plays once, within five seconds: a reader who cannot stop it is not disturbed
for longer.
"""

import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from PIL import Image

from tests.screenshots.bench import open_bench
from tests.screenshots.viewer import HeadlessViewer

FRAME_s = 0.1
FRAMES = 48
SIZE = 1280, 800
SHOWN = 960, 600
BYTES = 1_000_000
QUALITIES = 60, 45, 30, 20

FRAMES_OF_A_POSE = 12


def nutation(recording: Path) -> list[Image.Image]:
    """Return frames of a recording in the viewer."""
    with HeadlessViewer(*SIZE) as viewer:
        viewer.open(recording)
        return [viewer.at(FRAME_s * frame) for frame in range(1, FRAMES + 1)]


def bench(run: list[str], poses_deg: tuple[tuple[float, float], ...], folder: Path) -> list[Image.Image]:
    """Return frames of a bench in single steps, so that they are evenly spaced on any machine."""
    frames = []
    with open_bench(run, SIZE) as (twin, _, tab):
        ticks = round(FRAME_s / twin.state().period_s)
        for pose_deg in poses_deg:
            twin.do("point", pose_rad=tuple(np.radians([*pose_deg, 0.0])))
            for _ in range(FRAMES_OF_A_POSE):
                twin.do("step", ticks=ticks)
                time.sleep(0.5)  # the page is informed several times a second
                tab.draw(1)
                frames.append(Image.open(tab.screenshot(folder / "frame.png")).convert("RGB"))
    return frames


def save(frames: Iterable[Image.Image], path: Path) -> None:
    """Write an animated WebP of at most `BYTES`, with the best quality that allows it.

    Raises
    ------
    ValueError
        It is larger at any quality.
    """
    first, *others = [frame.resize(SHOWN, Image.Resampling.LANCZOS) for frame in frames]
    for quality in QUALITIES:
        first.save(
            path, save_all=True, append_images=others, duration=round(1e3 * FRAME_s), loop=1, quality=quality
        )
        if path.stat().st_size <= BYTES:
            print(f"{path}: quality {quality}, {path.stat().st_size} bytes")
            return
    raise ValueError(f"{path}: expected at most {BYTES} bytes, received {path.stat().st_size}")
