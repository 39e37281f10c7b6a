"""STOP by the space bar and by Esc from everywhere on the page, before any control sees the key."""

import pytest

from tests.browser import needs_a_browser
from tests.viz.bench import fake
from tests.viz.bench.on_page import at_rest, show_tab
from tests.waiting import wait_for

pytestmark = needs_a_browser
IN_A_BROWSER = pytest.mark.release("browser, 2 to 8 s; the button and a held key have STOP in a page")

TABS = ("move", "law", "twin", "faults", "files")

# All that can have the focus, and what the space bar does in it.
FOCUSABLE = """window.focusable = [...document.querySelectorAll(
  "a, button, input, textarea, select, summary, [tabindex], [contenteditable]")]
  .filter((each) => each.checkVisibility({visibilityProperty: true}) && !each.disabled)"""
TYPES = """(each => !each.readOnly && (each.tagName == 'TEXTAREA' || each.tagName == 'INPUT'
  && each.type == 'text' && each.inputMode == '' && each.role != 'combobox'))(focusable[%d])"""


# Sockets of the page itself; viser has its own in a worker.
RECORDED = """window.sockets = []; window.WebSocket = class extends WebSocket {
  constructor(...given) { super(...given); sockets.push(this); } }"""


def stops(bench):
    return bench.commands().count(("stop", {}))


def pressed(tab, bench, key):
    """Press a key and wait until it has acted."""
    before = stops(bench)
    tab.key(key)
    wait_for(lambda: stops(bench) == before + 1)


def text_in(tab, place):
    return tab.evaluate(f"focusable[{place}].value")


@IN_A_BROWSER
@pytest.mark.parametrize("shown", TABS)
def test_stop_acts_from_every_element_that_can_have_the_focus(tab, page, bench, shown):
    show_tab(tab, shown)
    at_rest(page, tab, 5)
    count = tab.evaluate(f"({FOCUSABLE}).length")
    assert count > 20
    texts = 0
    for place in range(count):
        tab.evaluate(f"focusable[{place}].focus()")
        pressed(tab, bench, "Escape")
        tab.evaluate(f"focusable[{place}].focus()")
        if tab.evaluate(TYPES % place):
            texts += 1
            before, count_before = text_in(tab, place), stops(bench)
            tab.key(" ")
            assert text_in(tab, place) == before + " "
            tab.key("Backspace")
            assert stops(bench) == count_before
        else:
            pressed(tab, bench, " ")
    assert (texts > 0) == (shown in ("twin", "faults", "files"))
    # No element has acted: no button was pressed, no list opened, no box ticked.
    assert {name for name, _ in bench.commands()} == {"stop"}
    assert not tab.evaluate("document.querySelector('[role=option]')?.getClientRects().length")


@IN_A_BROWSER
def test_stop_acts_over_a_dialog(tab, page, bench):
    gui = page._server.gui
    with gui.add_modal("a dialog"):
        gui.add_button("inside")
        gui.add_text("its text", "")
    tab.wait_for("document.querySelector('[role=dialog]') !== null")
    tab.evaluate(
        "[...document.querySelectorAll('[role=dialog] button')]"
        ".find((each) => each.innerText == 'inside').focus()"
    )
    pressed(tab, bench, " ")
    tab.evaluate("document.querySelector('[role=dialog] input').focus()")
    tab.key(" ")
    assert tab.evaluate("document.querySelector('[role=dialog] input').value") == " "
    pressed(tab, bench, "Escape")
    assert {name for name, _ in bench.commands()} == {"stop"}


def test_a_held_key_is_one_stop_and_the_button_acts_by_the_mouse(tab, bench):
    space = {"key": " ", "code": "Space", "windowsVirtualKeyCode": 32, "text": " "}
    for repeats in (False, True, True):
        tab.command("Input.dispatchKeyEvent", type="keyDown", autoRepeat=repeats, **space)
    tab.command("Input.dispatchKeyEvent", type="keyUp", **space)
    tab.click("text=pause")
    wait_for(lambda: ("pause", {}) in bench.commands())
    assert stops(bench) == 1
    tab.click("text=STOP")
    wait_for(lambda: stops(bench) == 2)


@IN_A_BROWSER
def test_stop_waits_for_a_channel_that_is_being_opened_again(browser):
    bench = fake.Bench()
    with fake.shown(bench) as page:
        tab = browser.open("about:blank")
        tab.command("Page.addScriptToEvaluateOnNewDocument", source=RECORDED)
        tab.go(page.address)
        tab.wait_for("control.send('beat')")
        assert tab.evaluate("(sockets[0].close(), control.send('beat'))") is False
        tab.key("Escape")
        wait_for(lambda: stops(bench) == 1)
        tab.close()


@IN_A_BROWSER
@pytest.mark.usefixtures("tabs")
def test_heartbeats_state_the_page(bench):
    wait_for(lambda: {"page 0", "page 1"} <= set(bench.beats))
