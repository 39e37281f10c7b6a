"""Figures and page of a review: no source but the page, formats, earlier reviews, refusals, and a browser."""

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from spheretwin import cli
from spheretwin.analysis import comparison
from spheretwin.analysis.comparison import compared_runs
from spheretwin.analysis.recorded_run import read
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.status import Status
from spheretwin.viz.quantities import compared_quantities
from tests.browser import Browser, needs_a_browser
from tests.content.figures import captured
from tests.twin.analysis.runs import written

NAMES = ["whole", "error", "angle", "sliding", "effort", "more", "currents", "spectra", "events"]
LARGEST_BYTES = 6_000_000


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Two runs of one law, one of them of a name that would end a script."""
    folder = tmp_path_factory.mktemp("runs")
    first, _ = written(folder, "first", duration=0.4)
    other, _ = written(
        folder, "<b>&<i>", **{"duration": 0.3, "controller.period_s": 2e-3, "disturbance.load": 2}
    )
    return [first, other]


@pytest.fixture(scope="module")
def folder(files, tmp_path_factory):
    """Folder of a review whose figures are not drawn."""
    folder = tmp_path_factory.mktemp("page") / "new"
    with captured():
        assert cli.main(["review", *map(str, files), "--figures", str(folder)]) == 0
    return folder


class Sources(HTMLParser):
    """Addresses of a page, its policies, scripts and styles, and the texts of its buttons."""

    def __init__(self, path):
        super().__init__()
        self.addresses, self.policies, self.inside = [], [], None
        self.texts = {"script": [], "style": [], "button": []}
        self.feed(path.read_text(encoding="utf-8"))
        (self.own,) = (text for text in self.texts["script"] if text.startswith("const figures = "))
        self.figures = json.JSONDecoder().raw_decode(self.own.removeprefix("const figures = "))[0]

    def handle_starttag(self, tag, attributes):
        named = dict(attributes)
        if tag in self.texts:
            self.inside = tag
            self.texts[tag].append("")
        elif tag not in ("svg", "line"):  # within a button
            self.inside = None
        self.addresses += [
            named[each] for each in ("src", "href", "data", "action", "poster", "srcset") if each in named
        ]
        if tag == "meta" and named.get("http-equiv") == "Content-Security-Policy":
            self.policies.append(named["content"])

    def handle_endtag(self, tag):
        if tag == self.inside:
            self.inside = None

    def handle_data(self, data):
        if self.inside:
            self.texts[self.inside][-1] += data


@pytest.fixture(scope="module")
def page(folder):
    return Sources(folder / comparison.PAGE)


def test_the_page_asks_no_host_for_anything(page, folder):
    assert all(address.startswith("#") for address in page.addresses)
    assert not re.search(r"url\(|@import", "".join(page.texts["style"]))
    (policy,) = page.policies
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert not re.search(r"https?:|\*", policy)
    assert "connect-src" not in rules  # so that of `default-src` holds
    own = [script for script in page.texts["script"] if not script.lstrip().startswith("/**")]
    assert not re.search(r"https?://|fetch|XMLHttpRequest|import\(", "".join(own))
    assert (folder / comparison.PAGE).stat().st_size < LARGEST_BYTES


def test_text_of_a_user_is_never_markup(page):
    """The name of a file in a title of the plots and in a button; content of a script ends at no tag."""
    titles = [each["text"] for each in page.figures["over-time"]["layout"]["annotations"]]
    assert any("&lt;b&gt;&amp;&lt;i&gt;" in title for title in titles)
    assert "<" not in page.own.split("const config")[0]
    assert any(text.startswith("2 <b>&<i>: afsm, L 2, ") for text in page.texts["button"])


def review(run, folder, *options):
    """Review one run; its figures are not drawn."""
    with captured():
        assert cli.main(["review", str(run), "--figures", str(folder), *options]) == 0


def test_figures_of_an_earlier_review_are_replaced_and_other_files_stay(files, tmp_path):
    review(files[0], tmp_path, "--figure-format", "png")
    assert (tmp_path / "sliding.svg").exists()
    assert (tmp_path / "events.png").exists()
    # Without sliding variables the new review has a figure less.
    (runs := tmp_path / "runs").mkdir()
    pid, _ = written(runs, "pid", duration=0.1, **{"controller.law": "pid"})
    (notes := tmp_path / "notes.svg").write_text("of the user's", encoding="utf-8")
    review(pid, tmp_path)
    left = {path.name for path in tmp_path.iterdir() if path.is_file()}
    figures = {f"{name}.svg" for name in NAMES if name != "sliding"}
    assert left == {comparison.PAGE, notes.name, *figures}
    # A folder without a page is no earlier review: the files in it are the user's.
    (tmp_path / comparison.PAGE).unlink()
    (other := tmp_path / "sliding.svg").write_text("of the user's", encoding="utf-8")
    review(pid, tmp_path)
    assert other.read_text(encoding="utf-8") == "of the user's"


def test_a_long_run_is_drawn_by_its_extremes(files, tmp_path, monkeypatch):
    from spheretwin.viz.pages import interactive

    monkeypatch.setattr(interactive, "MOST_NUMBERS", 0)  # then as few points as ever
    monkeypatch.setattr(interactive, "FEWEST_POINTS", 50)
    review(files[0], tmp_path)
    page = tmp_path / comparison.PAGE
    assert "drawn by the lowest and highest value" in page.read_text(encoding="utf-8")
    traces = [each for each in Sources(page).figures["over-time"]["data"] if each["type"] == "scatter"]
    run = compared_runs([read(files[0])])[0]
    values = compared_quantities([run.table])[0].column(run.rows)
    band, mean = traces[:2]
    size = -(-len(values) // (50 // 8))
    blocks = [values[first : first + size] for first in range(0, len(values), size)]
    assert (band["fill"], band["meta"], mean["meta"]) == ("toself", "0", "0")
    for bound in (np.min, np.max):
        assert np.isin(np.float32([bound(block) for block in blocks]), decoded(band["y"])).all()
    np.testing.assert_allclose(decoded(mean["y"])[1:-1], [np.mean(block) for block in blocks], rtol=1e-6)
    assert decoded(mean["x"])[-1] == pytest.approx(run.table["t_s"][-1])


def decoded(values):
    return np.frombuffer(base64.b64decode(values["bdata"]), dtype=np.dtype(values["dtype"]))


@pytest.mark.parametrize("library", ["matplotlib", "plotly"])
def test_a_missing_library_is_reported_on_one_line(files, tmp_path, monkeypatch, library, capsys):
    from spheretwin.viz.pages import markdown

    present = markdown.find_spec
    monkeypatch.setattr(markdown, "find_spec", lambda name: None if name == library else present(name))
    assert cli.main(["review", str(files[0]), "--figures", str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"expected {library} to draw figures, which the extra plots installs: " in line


@pytest.mark.parametrize(
    ("status", "text"), [(None, "not closed"), (Status.LEFT_WORKSPACE, "left workspace")]
)
def test_the_end_of_a_run_is_that_of_its_last_tick_and_of_a_file_that_was_not_closed_its_last_row(
    files, status, text
):
    run = read(files[0])
    (drawn,) = compared_runs([replace(run, record=replace(run.record, status=status))])
    end_s = run.table["t_s"][-1] + (run.period_s if status else 0.0)
    assert drawn.early_end.t_s == pytest.approx(end_s, abs=1e-12)
    assert drawn.early_end.status == text
    assert compared_runs([run])[0].early_end is None


def test_a_folder_that_is_a_file_is_refused(files, capsys):
    assert cli.main(["review", str(files[0]), "--figures", str(files[1])]) == 2
    assert "expected a writable folder" in capsys.readouterr().err


def test_a_run_without_a_tick_is_not_drawn(files, tmp_path):
    run = read(files[0])
    with pytest.raises(InputError, match="at least one tick"):
        comparison.write_figures([replace(run, table=run.table.rows(0, 0))], [{}], tmp_path)


DRAWN = """[...plots[0].querySelectorAll(".xy .js-line")].map((line) => line.getAttribute("d")).join("|")"""
"""Outlines of the lines of the first panel, the error as one angle."""

PANEL = """(() => {
  const panel = plots[0].querySelector(".nsewdrag[data-subplot='xy']");
  const {x, y, width, height} = panel.getBoundingClientRect();
  return [x, y, width, height];
})()"""


DOUBLE_CLICK = """(() => {
  const panel = plots[0].querySelector(".nsewdrag[data-subplot='xy']");
  const place = {bubbles: true, cancelable: true, view: window, clientX: %f, clientY: %f};
  for (const kind of ["mousedown", "mouseup", "mousedown", "mouseup"])
    panel.dispatchEvent(new MouseEvent(kind, place));
})()"""


@pytest.fixture(scope="module")
def browser():
    with Browser() as browser:
        yield browser


@pytest.fixture
def opened(browser, folder):
    page = browser.open((folder / comparison.PAGE).as_uri())
    page.wait_for("plots.every((plot) => plot.querySelector('.js-line'))")
    yield page
    assert page.errors == []
    page.close()


@pytest.mark.release("browser, 5 s; content of reviews has the figures without one")
@needs_a_browser
def test_a_drag_zooms_into_the_time_and_a_double_click_resets_it(opened):
    before, (first, last) = opened.evaluate(DRAWN), opened.evaluate("plots[0].layout.xaxis.range")
    x, y, width, height = opened.evaluate(PANEL)
    middle = y + height / 2
    # The panel is what a reader sees there: nothing covers it.
    assert opened.evaluate(f"document.elementFromPoint({x + width / 2}, {middle}).matches('.nsewdrag')")
    opened.drag((x + 0.25 * width, middle), (x + 0.5 * width, middle))
    opened.wait_for(f"plots[0].layout.xaxis.range[0] > {first}")
    zoomed = opened.evaluate("plots[0].layout.xaxis.range")
    # Whole pixels of some hundred.
    expected = [first + share * (last - first) for share in (0.25, 0.5)]
    assert zoomed == pytest.approx(expected, abs=0.01 * (last - first))
    assert opened.evaluate(DRAWN) != before
    # In one task of the page: the time between two clicks does not depend on the load of the machine.
    opened.evaluate(DOUBLE_CLICK % (x + width / 2, middle))
    opened.wait_for(f"plots[0].layout.xaxis.range[1] === {last}")
    assert opened.evaluate(DRAWN) == before


@pytest.mark.release("browser, 5 s; content of reviews has the figures without one")
@needs_a_browser
def test_the_button_of_a_run_hides_its_lines_in_every_figure(opened):
    count = "plots.map((plot) => plot.querySelectorAll('.js-line').length)"
    both = opened.evaluate(count)
    opened.click("[data-run='0']")
    opened.wait_for("plots.every((plot) => plot.data.every((t) => t.meta !== '0' || t.visible === false))")
    assert all(0 < one < every for one, every in zip(opened.evaluate(count), both, strict=True))
    opened.click("[data-run='0']")
    opened.wait_for(f"String({count}) === '{','.join(map(str, both))}'")
