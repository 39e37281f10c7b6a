"""The page in a browser: controls send commands, the status is shown, no request leaves the machine."""

import numpy as np
import pytest
from PIL import Image

from spheretwin.models.kinematics import rotation
from spheretwin.viz import theme
from spheretwin.viz.bench.page import FRAMES_A_SETTING
from tests.browser import needs_a_browser
from tests.viz.bench import fake
from tests.viz.bench.on_page import STATUS, at_rest, on_screen, opened, show_tab, write
from tests.waiting import UNLIMITED_S, wait_for

# Of two colours, as directions: light and shade change their length. Told as they are, they come out pale:
# copper 0.982, blue 0.91, red 0.87.
ALIKE = 0.985

pytestmark = needs_a_browser


def told(bench, count):
    """All that a bench was told, once it is so much."""
    wait_for(lambda: len(bench.commands()) >= count)
    return bench.commands()


def tip(bench, q_rad):
    return rotation(np.array(q_rad)) @ bench.actuator.shaft_tip_m


@pytest.mark.release("browser, 3 to 12 s; test_server.py and test_messages.py have the protocol without one")
def test_an_arrow_steers_the_twin_alone_and_no_request_leaves_the_machine(tab, page, bench):
    at_rest(page, tab)
    (client,) = page._server.get_clients().values()
    tab.key("ArrowUp")
    tilted = pytest.approx([0.1 - np.radians(1.0), -0.1, 0.3], abs=1e-12)
    assert told(bench, 1) == [("point", {"pose_rad": tilted})]
    assert client.camera.position == pytest.approx([0.11, -0.16, 0.12])
    assert tab.outside == []
    others = [url for url in tab.requests if "/bench.data" not in url]
    assert len(others) == 4  # the address with the token, the page, its sockets for STOP and for the rest


@pytest.mark.release("browser, 3 to 12 s; test_server.py and test_messages.py have the protocol without one")
def test_the_tip_is_dragged_where_the_pointer_is(tab, page, bench):
    at_rest(page, tab)
    wanted = np.array([0.3, 0.2, 0.3])
    tab.drag(on_screen(page, tab, tip(bench, bench.now.q_ref_rad)), on_screen(page, tab, tip(bench, wanted)))
    # A pixel is 5 mrad of the shaft as the page comes up; it is pointed at to one, from one.
    arrived = [("point", {"pose_rad": pytest.approx(wanted, abs=1e-2)})]
    wait_for(lambda: bench.commands()[-1:] == arrived)


def test_the_status_follows_the_bench_and_its_texts_are_no_markup(tab, bench):
    reason = "<img src=x onerror=alert(1)>"
    faulty = {"mode": "fault", "status": "failsafe", "reason": reason, "saturated": True, "stopped": True}
    bench.now.__dict__.update(faulty)
    tab.wait_for(f"{STATUS}.innerText.includes('FAULT')")
    shown = tab.evaluate(f"{STATUS}.innerText")
    for word in ("FAILSAFE", "STOPPED", "SATURATED", "1.250 s", "error |e| –", "12.3 A/s", reason):
        assert word in shown
    bench.now.mode, bench.now.reason, bench.now.status = "hold", None, "running"
    tab.wait_for(f"!{STATUS}.innerText.includes('FAULT')")
    shown = tab.evaluate(f"{STATUS}.innerText")
    assert "FAILSAFE" not in shown
    assert "100.00 mrad" in shown


@pytest.mark.release("browser, 3 to 12 s; test_server.py and test_messages.py have the protocol without one")
def test_a_refusal_is_shown_at_its_field(tab, bench):
    bench.refused["set"] = "controller.stiffness: expected a value ≥ 0, received -1"
    show_tab(tab, "law")
    tab.click("text=all fields of the controller")
    write(tab, "stiffness", "-1")
    tab.click("text=Set gains")
    assert told(bench, 1) == [("set", {"name": "controller.stiffness", "value": "-1"})]
    tab.wait_for("document.body.innerText.includes('expected a value ≥ 0, received -1')")
    bench.refused.clear()
    write(tab, "stiffness", "5")
    tab.click("text=Set gains")
    tab.wait_for("!document.body.innerText.includes('received -1')")


@pytest.mark.release("browser, 3 to 12 s; test_server.py and test_messages.py have the protocol without one")
def test_one_page_operates_and_gives_over(bench, tabs):
    first, second = tabs
    second.wait_for("document.body.innerText.includes('Ask to operate')")
    second.click("text=start")
    second.wait_for("document.body.innerText.includes('This page is read-only')")
    assert bench.commands() == []
    second.click("text=STOP")
    assert told(bench, 1) == [("stop", {})]
    second.click("text=Ask to operate")
    assert told(bench, 2)[1:] == [("ask", {})]
    bench.now.asking = ("page 1",)
    first.click("text=Grant control to page 1")
    assert told(bench, 3)[2:] == [("grant", {"to": "page 1"})]


@pytest.mark.release("browser, 3 to 12 s; test_server.py and test_messages.py have the protocol without one")
def test_without_an_operator_the_pages_explain_how_to_take_over(browser):
    bench = fake.Bench()
    with fake.shown(bench) as page:
        first, second = opened(browser, page), opened(browser, page)
        third = opened(browser, page)
        bench.now.watching = ("page 1", "page 2")
        first.close()
        third.wait_for(f"{STATUS}.innerText.includes('no client operates: press “Take over”')")
        third.click("text=start")
        third.wait_for("document.body.innerText.includes('No client operates: press “Take over” above.')")
        assert bench.commands() == []
        third.click("text=Take over")
        assert told(bench, 1) == [("ask", {})]
        bench.now.watching = ("page 1",)
        third.wait_for(f"!{STATUS}.innerText.includes('no client operates')")
        third.click("text=start")
        assert told(bench, 2)[1:] == [("start", {})]
        second.close()
        third.close()


@pytest.mark.release("browser, 3 to 12 s; test_server.py and test_messages.py have the protocol without one")
@pytest.mark.parametrize("fresh_s", [UNLIMITED_S, 0.5])  # a busy machine opens it slowly
def test_a_single_page_operates_only_if_it_was_just_opened(browser, monkeypatch, fresh_s):
    monkeypatch.setattr("spheretwin.viz.bench.page.FRESH_S", fresh_s)
    bench = fake.Bench(operator="page 7", watching=("page 0",))
    with fake.shown(bench) as page:
        tab = opened(browser, page)
        at_rest(page, tab, 2 * FRAMES_A_SETTING)
        assert bench.commands() == []
        bench.now.operator = None
        if fresh_s == UNLIMITED_S:
            assert told(bench, 1) == [("ask", {})]
            assert bench.now.operator == "page 0"
        else:
            tab.wait_for("document.body.innerText.includes('Take over')")
            looked = (
                page._frame + FRAMES_A_SETTING
            )  # one look at the pages, at least, is among so many frames
            wait_for(lambda: page._frame > looked)
            assert bench.commands() == []
        tab.close()


def likeness(tab, path, at, colour):
    """Cosine between a colour and that of a pixel of the page."""
    pixel = np.array(Image.open(tab.screenshot(path)).convert("RGB").getpixel(at), dtype=float)
    return pixel @ colour / max(np.linalg.norm(pixel) * np.linalg.norm(colour), 1.0)


@pytest.mark.release("browser, 3 to 12 s; test_server.py and test_messages.py have the protocol without one")
def test_a_coil_has_the_colour_of_its_current(tab, page, bench, tmp_path):
    bench.now.q_ref_rad = (0.0, 0.0, 0.0)
    actuator = bench.actuator
    at_rest(page, tab)
    (client,) = page._server.get_clients().values()
    nearest = int(np.argmax(actuator.coil_axes @ client.camera.position))
    (group,) = np.flatnonzero((actuator.groups == nearest).any(axis=1))
    axis, coil = actuator.coil_axes[nearest], actuator.coil
    end = (coil.distance_m + coil.length_m / 2) * axis
    above = np.array([0.0, 0.0, 1.0]) - axis[2] * axis  # a hoop goes across the middle
    middle = (coil.inner_radius_m + coil.outer_radius_m) / 2
    at = tuple(map(int, on_screen(page, tab, end + middle * above / np.linalg.norm(above))))
    for current in (-8.0, 0.0, 8.0):
        bench.now.current_A = (0.0,) * group + (current,) + (0.0,) * (fake.GROUPS - 1 - group)
        meant = theme.current_colours(np.array(current), 8.0).astype(float)
        wait_for(lambda meant=meant: likeness(tab, tmp_path / "page.png", at, meant) > ALIKE)


@pytest.mark.release("browser, 3 to 12 s; test_server.py and test_messages.py have the protocol without one")
def test_a_page_reconnects(tab, page, bench):
    page._server._websock_server.disconnect_all_clients()
    bench.now.t_s = 77.0
    tab.wait_for(f"{STATUS}?.innerText.includes('77.000 s')")
