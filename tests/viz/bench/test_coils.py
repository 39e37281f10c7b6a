"""Coils on the page: their places, numbers and values, menus, marks, and their selection in the plots."""

import numpy as np
import pytest
from PIL import Image

from tests.browser import needs_a_browser
from tests.viz.bench.on_page import at_rest, on_screen
from tests.waiting import wait_for

pytestmark = [
    needs_a_browser,
    pytest.mark.release("browser, 7 to 9 s; content of the bench has the coils' messages"),
]

TIP = "document.querySelector('#bench-tip')"
NEAREST = """bench.places().map((at, coil) => ({...at, coil})).filter((at) => !at.hidden)
  .sort((a, b) => a.depth - b.depth)[0]"""


@pytest.fixture
def tab(tab, page):
    tab.wait_for("bench.places().length === 36")
    at_rest(page, tab)
    return tab


def test_coils_are_where_the_camera_shows_them(tab, page, bench):
    """The camera of the page's messages and that of its script give the same places."""
    actuator = bench.actuator
    ends = (actuator.coil.distance_m + actuator.coil.length_m / 2) * actuator.coil_axes

    def differ():
        places = tab.evaluate("bench.places().map(({x, y}) => [x, y])")
        return np.abs(np.array(places) - [on_screen(page, tab, end) for end in ends]).max()

    wait_for(lambda: differ() < 0.5)  # pixels; while the panel gets its width, the two are not of one moment
    (client,) = page._server.get_clients().values()
    facing = ends @ client.camera.position > 0.02 * np.linalg.norm(client.camera.position)
    hidden = np.array(tab.evaluate("bench.places().map(({hidden}) => hidden)"))
    assert not hidden[facing].any()  # no coil on this side of the ball is behind it
    assert hidden.any()


def test_a_coil_shows_its_number_and_value_and_a_menu(tab, bench):
    at = tab.evaluate(NEAREST)
    coil, place = at["coil"], (at["x"], at["y"])
    (group,) = np.flatnonzero((bench.actuator.groups == coil).any(axis=1)).tolist()
    bench.now.temperature_C = (20.0,) * group + (61.5,) + (20.0,) * (17 - group)
    tab.wait_for("bench.header.temperature_C !== null")
    tab._mouse("mouseMoved", *place)
    text = f"coil {coil}, group {group}: {bench.now.current_A[group]:.2f} A, 61.5 °C"
    tab.wait_for(f"{TIP}.innerText === {text!r} && !{TIP}.hidden")
    fault = {"target": f"coil.{group:02}"}
    actions = {
        "Drive alone at 1 A": ("manual", {"group": group, "current_A": 1}),
        "Open circuit": ("add_fault", {"fault": {**fault, "mode": "open"}}),
        "Short circuit": ("add_fault", {"fault": {**fault, "mode": "short"}}),
        "Clear its faults": ("clear_faults", fault),
    }
    for count, (label, command) in enumerate(actions.items(), 1):
        tab.click(place)
        tab.click(f"text={label}")
        wait_for(lambda count=count: len(bench.commands()) >= count)
        assert bench.commands()[-1] == command
        assert tab.evaluate("document.querySelector('#bench-menu').hidden")
    assert tab.evaluate("bench.selected") == [group]
    tab.wait_for(f"'current{group}' in bench.plots.live.bounds")
    tab.wait_for(f"document.querySelector('[data-pane=currents] .values').innerText.includes('{group}: ')")


def test_a_bar_selects_a_group_and_its_coils_are_marked(tab, bench, tmp_path):
    tab.wait_for("document.querySelector('[data-pane=bars]')?.scale !== undefined")
    at = tab.evaluate(NEAREST)
    group = tab.evaluate(f"bench.groupOf({at['coil']})")
    middle = tab.evaluate(
        "((pane) => { const {x, y, height} = pane.getBoundingClientRect();"
        f" return [x + pane.scale.left + {group + 0.5} * pane.scale.wide, y + height / 2]; }})"
        "(document.querySelector('[data-pane=bars]'))"
    )
    tab.click(tuple(middle))
    tab.wait_for(f"bench.selected.join() === '{group}'")
    # The ring of the selection, at its left and its right, has the colour of the group in the plots.
    ring = [(at["x"] - at["radius"], at["y"]), (at["x"] + at["radius"], at["y"])]
    wanted = tuple(bytes.fromhex(tab.evaluate("bench.fixed.selected[0]").lstrip("#")))
    wait_for(lambda: all(is_near(colour_at(tab, tmp_path, place), wanted) for place in ring))
    bench.now.failed_groups = (group,)
    failed = tuple(map(int, tab.evaluate("bench.fixed.failed").strip("rgb()").split(",")))
    wait_for(lambda: is_near(colour_at(tab, tmp_path, (at["x"], at["y"])), failed))  # middle of the cross
    tab._mouse("mouseMoved", at["x"], at["y"])
    tab.wait_for(f"{TIP}.innerText.endsWith(', failed')")


def colour_at(tab, folder, place):
    x, y = (round(value) for value in place)
    return Image.open(tab.screenshot(folder / "page.png")).convert("RGB").getpixel((x, y))


def is_near(colour, wanted):
    """Lines are drawn between pixels: a fifth of the scale."""
    return max(abs(a - b) for a, b in zip(colour, wanted, strict=True)) < 51
