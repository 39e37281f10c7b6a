"""The browser of the tests clicks what it is told to click."""

from tests.browser import Browser, needs_a_browser

pytestmark = needs_a_browser

# Two buttons that a line pushes down as soon as the pointer arrives at them, and one that is covered.
PAGE = """<p id=line hidden style="height: 30px; margin: 0">a line</p>
<style>button {display: block; height: 30px; width: 90px}</style>
<button>pause</button><button>start</button><button id=covered>last</button>
<div id=cover style="position: fixed; inset: 60px 0 0 0">before it</div>
<script>
  const presses = [];
  for (const button of document.querySelectorAll("button"))
    for (const kind of ["pointerdown", "click"])
      button.addEventListener(kind, () => presses.push(button.innerText + " " + kind));
  addEventListener("mousemove", () => { line.hidden = false; }, {once: true});
</script>"""
ADDRESS = "data:text/html," + PAGE.replace("\n", " ").replace("#", "%23")


def test_a_click_reaches_an_element_that_moves_away_and_no_other():
    with Browser() as browser:
        page = browser.open(ADDRESS)
        page.evaluate("cover.hidden = true")
        page.click("text=start")
        assert page.evaluate("presses") == ["start pointerdown", "start click"]


def test_an_element_is_clicked_once_nothing_covers_it():
    with Browser() as browser:
        page = browser.open(ADDRESS)
        page.evaluate("void (presses.length = 0, setTimeout(() => cover.remove(), 300))")
        page.click("#covered")
        assert page.evaluate("presses") == ["last pointerdown", "last click"]
        assert page.evaluate("document.querySelector('#cover')") is None
