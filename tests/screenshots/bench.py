"""A bench that runs and is driven in Chromium, and what its page looks like then."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from spheretwin import scenario as scenarios
from spheretwin.bench import Bench
from spheretwin.bench.operators import Operators
from spheretwin.cli.bench import choices_of
from spheretwin.models.kinematics import rotation
from spheretwin.scenario import reading
from spheretwin.viz.bench import server
from spheretwin.viz.bench.page import Page
from tests.browser import Browser
from tests.viz.bench.on_page import on_screen, opened
from tests.waiting import UNLIMITED_S

# The picture is drawn, its camera is told, and what is not of the bench is gone.
READY_S = 2.0

# A way from pose to pose takes less.
REACHED_S = 2.5

# After the last one: on its way.
MOVING_S = 0.45

CLOSE = "document.querySelector('.mantine-Notification-closeButton')"


@contextmanager
def open_bench(
    run: list[str], size: tuple[int, int], light: bool = False
) -> Iterator[tuple[Bench, Page, Any]]:
    """Open the page of a paused bench in a browser; give the bench, its page and the tab."""
    ended = threading.Event()
    scenario = scenarios.load(run[0], reading.overrides(run[1:]))
    with (
        Bench(scenario, Operators(silence_s=UNLIMITED_S)) as bench,
        Page(bench, choices_of(bench), server.listen(0)) as page,
    ):
        bench.begin()
        following = threading.Thread(target=page.show, args=(ended.is_set,))
        following.start()
        try:
            with Browser(size) as browser:
                tab = opened(browser, page)
                tab.wait_for(f"{CLOSE} !== null")  # that no GPU draws this
                tab.evaluate(f"{CLOSE}.click()")
                if light:
                    tab.click("[data-theme]")
                yield bench, page, tab
        finally:
            ended.set()
            following.join()


def screenshot(
    run: list[str],
    poses_deg: tuple[tuple[float, float], ...],
    size: tuple[int, int],
    folder: Path,
    light: bool = False,
) -> Image.Image:
    """A page whose tip has been dragged to some poses, and is on its way to the last one."""
    with open_bench(run, size, light) as (bench, page, tab):
        tab.click("text=start")
        time.sleep(READY_S)
        for pose_deg in poses_deg:
            time.sleep(REACHED_S)
            _drag(bench, page, tab, np.radians([*pose_deg, 0.0]))
        time.sleep(MOVING_S)
        return Image.open(tab.screenshot(folder / "bench.png")).convert("RGB")


def _drag(bench: Bench, page: Page, tab, q_rad) -> None:
    """Drag the tip to the place that it has in another pose."""
    start, end = (
        on_screen(page, tab, rotation(np.array(q)) @ bench.actuator.shaft_tip_m)
        for q in (bench.state().q_ref_rad, q_rad)
    )
    tab.drag(start, end)
