"""The page in a browser: each touch is one command, what is shown is the state, nothing leaves the machine."""

import time

import pytest

from tests.browser import Browser, needs_a_browser
from tests.viz.bench import fake

pytestmark = needs_a_browser


@pytest.fixture(scope="module")
def browser():
    with Browser() as opened:
        yield opened


def opened(browser, page, size=None):
    tab = browser.open(page.address, size)
    tab.wait_for("document.querySelector('[data-bench=status]') !== null")
    return tab


def told(bench, count=1):
    until = time.monotonic() + 20.0  # a click crosses two processes on shared cores
    while len(bench.commands()) < count and time.monotonic() < until:
        time.sleep(0.02)
    return bench.commands()


def test_a_click_and_a_key_are_a_command_each(browser):
    bench = fake.Bench()
    with fake.shown(bench) as page:
        tab = opened(browser, page)
        tab.click("text=start")
        assert told(bench) == [("start", {})]
        tab.key(" ")  # the button that was clicked has the focus: the space bar is STOP all the same
        assert told(bench, 2)[1:] == [("stop", {})]
        tab.key("ArrowUp")
        (name, given), = told(bench, 3)[2:]
        assert name == "point"
        assert given["pose_rad"] == pytest.approx([0.1 - 0.0174533, -0.1, 0.3], abs=1e-6)
        assert tab.errors == []
        assert tab.outside == []
        tab.close()
