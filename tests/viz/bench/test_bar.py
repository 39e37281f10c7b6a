"""Bar of the page: everything in view at each size and in both themes; its buttons, and whose page it is."""

import pytest

from tests.browser import needs_a_browser
from tests.viz.bench import fake
from tests.viz.bench.on_page import STATUS, opened
from tests.waiting import wait_for

pytestmark = [
    needs_a_browser,
    pytest.mark.release("browser, 3 to 17 s; content of the bench has the page's messages"),
]

SIZES = ((800, 600), (1280, 800), (1920, 1080), (2560, 1440))

MODES = {
    "off": {},
    "hold": {},
    "point": {"pose_rad": [0.1, -0.1, 0.3]},
    "trajectory": {},
    "jog": {"rates_rad_s": [0.0] * 3},
    "manual": {"currents_A": [0.0] * fake.GROUPS},
    "replay": {"file": "run.parquet"},
}

RUN = ("start", "pause", "step", "reset")

# Elements of the bar that are out of the window, covered, cut, or over another one.
HIDDEN = """[...document.querySelectorAll(
    "#bench-bar button:not([hidden]), #bench-bar select, .badge, .cell")]
  .filter((each) => {
    const {left, right, top, bottom, width, height} = each.getBoundingClientRect();
    const middle = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
    const inside = left >= 0 && top >= 0 && right <= innerWidth + 0.5 && bottom <= innerHeight;
    const seen = each.contains(middle) || middle?.contains(each);
    return !(width && height && inside && seen && each.scrollWidth <= each.clientWidth + 1);
  }).map((each) => each.innerText)"""

BOXES = """[...document.querySelectorAll("#bench-bar button, .badge, .cell, .messages")]
  .map((each) => { const {x, y} = each.getBoundingClientRect(); return [x, y]; })"""

# Least contrast of a text with what is behind it (WCAG 2).
CONTRAST = """(() => {
  const light = ([red, green, blue]) => [red, green, blue].map((value) => value / 255)
    .map((value) => value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4)
    .reduce((sum, value, i) => sum + value * [0.2126, 0.7152, 0.0722][i], 0);
  const rgb = (text) => text.match(/[\\d.]+/g).map(Number);
  const behind = (each) => {
    for (; each; each = each.parentElement) {
      const colour = rgb(getComputedStyle(each).backgroundColor);
      if (colour.length < 4 || colour[3] > 0.99) return colour;
    }
  };
  const contrasts = [...document.querySelectorAll(
      "#bench-bar button, #bench-bar select, .badge, .cell > b, .messages span, #bench-dock button")]
    .filter((each) => each.innerText?.trim()).map((each) => {
      const [one, other] = [light(rgb(getComputedStyle(each).color)), light(behind(each))];
      return [(Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05), each.innerText];
    });
  return contrasts.sort((one, other) => one[0] - other[0])[0];
})()"""


def test_all_is_visible_at_each_size_and_in_both_themes(tab, bench):
    """At its worst: every badge, the largest numbers, long messages."""
    worst = {
        "mode": "trajectory",
        "stopped": True,
        "saturated": True,
        "rank_lost": True,
        "status": "failsafe",
        "t_s": 123456.789,
        "missed": 123456,
        "torque_margin": 1.0,
        "error_mrad": 1234.56,
        "chatter_A_s": 1234.5,
        "active_faults": ("coil.07 open",) * 12,
        "recording": ("/a/long/path/" * 20 + "run.rrd",),
        "note": "long " * 99,
        "law": "backstepping_sliding_mode",
    }
    bench.now.__dict__.update(worst)
    tab.wait_for(f"{STATUS}.innerText.includes('FAILSAFE')")
    fonts = []
    for scheme in ("dark", "light"):
        tab.wait_for(f"document.documentElement.dataset.mantineColorScheme === '{scheme}'")
        for size in SIZES:
            tab.resize(*size)
            tab.draw(3)
            hidden = [text for text in tab.evaluate(HIDDEN) if not text.startswith("control law")]
            assert hidden == [], (size, scheme)
            root, bar, dock = tab.evaluate(
                "['#root', '#bench-bar', '#bench-dock'].map((id) => document.querySelector(id)"
                ".getBoundingClientRect()).map(({top, bottom}) => [top, bottom])"
            )
            assert bar[0] == 0.0
            assert root == pytest.approx([bar[1], dock[0]], abs=1.0)  # nothing is under the bar and the plots
            assert root[1] - root[0] > 0.35 * size[1]
            fonts.append(
                float(tab.evaluate("parseFloat(getComputedStyle(document.documentElement).fontSize)"))
            )
            contrast, text = tab.evaluate(CONTRAST)
            assert contrast > 4.5, (text, scheme)
        tab.click("[data-theme]")
    assert fonts[: len(SIZES)] == fonts[len(SIZES) :] == sorted(set(fonts))  # larger in a larger window


def test_nothing_in_the_bar_moves_with_the_numbers(tab, bench):
    tab.resize(1280, 800)
    tab.draw(3)
    tab.wait_for("document.querySelector('[data-role]').innerText === 'OPERATOR'")
    before = tab.evaluate(BOXES)
    bench.now.t_s, bench.now.error_mrad, bench.now.missed = 98765.4321, 999.99, 54321
    bench.now.note = "something happened"
    bench.now.recording = ("run.rrd",)
    tab.wait_for(f"{STATUS}.innerText.includes('98765.432 s')")
    assert tab.evaluate(BOXES) == before


def test_every_button_sends_its_command(tab, bench):
    expected = []
    for name in ("stop", *RUN):
        tab.click(f"[data-send={name}]")
        expected.append((name, {}))
        wait_for(lambda: bench.commands() == expected)
    for mode, given in MODES.items():
        tab.click(f"[data-mode={mode}]")
        expected.append((mode, given))
        wait_for(lambda: bench.commands() == expected)
    tab.evaluate("(s => { s.value = '0.5×'; s.dispatchEvent(new Event('change', {bubbles: true})); })"
                 "(document.querySelector('[data-speed]'))")  # fmt: skip
    wait_for(lambda: bench.commands()[-1] == ("speed", {"factor": 0.5}))


def test_the_bar_follows_commands_from_elsewhere(tab, bench):
    bench.now.running = False
    pressed = "[...document.querySelectorAll('#bench-bar [aria-pressed=true]')].map((each) => each.innerText)"
    tab.wait_for(f"{pressed}.join() === 'hold'")
    bench.now.mode, bench.now.running = "jog", True
    tab.wait_for(f"{pressed}.join() === 'start,jog'")
    for speed, text in ((2.0, "2×"), (1e6, "as fast as possible"), (3.7, "3.7×")):
        bench.now.speed = speed
        tab.wait_for(f"document.querySelector('[data-speed]').selectedOptions[0].text === {text!r}")


def test_a_badge_states_whose_page_it_is(bench, tabs):
    role = "document.querySelector('[data-role]').innerText"
    first, second = tabs
    first.wait_for(f"{role} === 'OPERATOR'")
    second.wait_for(f"{role} === 'WATCHING page 0'")
    bench.now.operator = "page 1"
    second.wait_for(f"{role} === 'OPERATOR'")
    bench.now.operator = None
    first.wait_for(f"{role} === 'WATCHING, no operator'")


def test_a_page_without_its_server_says_so(browser):
    with fake.shown(fake.Bench()) as page:
        tab = opened(browser, page)
    tab.wait_for("document.querySelector('[data-role]').innerText === 'NO CONNECTION'")
    tab.close()
