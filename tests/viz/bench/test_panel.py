"""Panel of viser on the page: names for screen readers, keyboard, section of the mode."""

import pytest

from tests.browser import needs_a_browser
from tests.viz.bench.on_page import show_tab

pytestmark = [needs_a_browser, pytest.mark.release("browser, 3 to 12 s; only a browser has the panel")]

CONTROLS = ("button", "checkbox", "combobox", "menuitem", "slider", "spinbutton", "tab", "textbox")

OPEN = """[...document.querySelectorAll('#root svg.tabler-icon-chevron-up')]
  .map(({parentElement}) => parentElement.innerText)"""


def unnamed(tab):
    """Roles of the controls whose name the browser finds empty."""
    nodes = tab.command("Accessibility.getFullAXTree")["nodes"]
    roles = [
        node["role"]["value"]
        for node in nodes
        if not node["ignored"] and not node.get("name", {}).get("value", "").strip()
    ]
    return [role for role in roles if role in CONTROLS]


def test_every_control_has_a_name_in_every_tab(tab):
    for name in ("move", "law", "twin", "faults", "files"):
        show_tab(tab, name)
        while unnamed(tab):  # new controls are named within 0.2 s
            tab.draw(2)


def test_the_panel_follows_the_mode_and_leaves_the_choice_of_the_user(tab, bench):
    for mode, section in (
        ("manual", "manual"),
        ("jog", "jog"),
        ("hold", "point"),
        ("trajectory", "trajectory"),
        ("off", None),
        ("replay", "replay"),
    ):
        bench.now.mode = mode
        begins = f"{OPEN}[0].startsWith('{section}')" if section else "true"
        tab.wait_for(f"{OPEN}.length === {int(section is not None)} && {begins}")
    tab.wait_for("document.querySelector('#root [role=button][aria-expanded]') !== null")
    tab.evaluate("document.querySelector('#root [role=button][aria-expanded=false]').focus()")
    tab.key("Enter")
    tab.wait_for(f"{OPEN}.length === 2")
    tab.draw(5)
    assert tab.evaluate(f"{OPEN}.length") == 2
