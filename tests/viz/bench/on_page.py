"""Where things are on a bench's page."""

import numpy as np
from scipy.spatial.transform import Rotation

from tests.waiting import wait_for

STATUS = "document.querySelector('[data-bench=status]')"

_LINE = "[...document.querySelectorAll('label')].find(each => each.innerText == %r)"


def opened(browser, page, size=None):
    """A page of the bench that is served, once it shows its state."""
    tab = browser.open(page.address, size)
    tab.wait_for(f"{STATUS}?.innerText && bench.page() !== undefined")
    return tab


def at_rest(page, tab, frames=20):
    """Wait until the server has sent some frames more, and the page has drawn as many."""
    sent = page._frame + frames
    wait_for(lambda: page._frame >= sent)
    tab.draw(frames)


def errors(tab):
    """What a page says on its console, but for what viser's own code says of each thing that is dragged."""
    return [line for line in tab.errors if "preventDefault inside passive event listener" not in line]


def on_screen(page, tab, point_m):
    """Where a point of the picture is on the page, pixels, by the camera that the page tells of itself."""
    (client,) = page._server.get_clients().values()
    camera = client.camera
    right, down, ahead = (
        Rotation.from_quat(camera.wxyz, scalar_first=True).inv().apply(point_m - camera.position)
    )
    left, top, width, height = tab.evaluate(
        "(box => [box.x, box.y, box.width, box.height])"
        "(document.querySelector('canvas[data-engine]').getBoundingClientRect())"
    )
    focal = height / 2 / np.tan(camera.fov / 2)
    return left + width / 2 + focal * right / ahead, top + height / 2 + focal * down / ahead


def show_tab(tab, name):
    """Show a tab of the panel; other parts of the page may have the same text."""
    named = f"[...document.querySelectorAll('[role=tab]')].find((each) => each.innerText == '{name}')"
    tab.evaluate(f"{named}.id = 'tab {name}'")
    tab.click(f"[id='tab {name}']")
    tab.wait_for(f"{named}.getAttribute('aria-selected') == 'true'")


def write(tab, label, text):
    """Write into the line of a label in place of what is there."""
    line = f"{_LINE % label}.parentElement.parentElement.parentElement.querySelector('input')"
    tab.wait_for(f"{_LINE % label} !== undefined")
    # A line in a folder that is opening cannot have the focus yet.
    tab.wait_for(f"({line}.focus(), document.activeElement === {line})")
    tab.evaluate(f"{line}.select()")
    if text:
        tab.write(text)
    else:
        tab.key("Backspace")


def choose(tab, label, option):
    """Choose of the list of a label."""
    line = f"{_LINE % label}.parentElement.parentElement.parentElement.querySelector('input')"
    tab.wait_for(f"{_LINE % label} !== undefined")
    tab.evaluate(f"{line}.click()")
    tab.click(f"text={option}")
