"""Figures and page of runs: every series is there, and the page has no source but itself."""

import base64
import json
import os
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from spheretwin import cli
from spheretwin.analysis import comparison, run_summary
from spheretwin.analysis.comparison import compared_runs
from spheretwin.analysis.recorded_run import read
from spheretwin.analysis.run_summary import amplitudes
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.status import Status
from spheretwin.viz.quantities import compared_quantities
from spheretwin.viz.theme import run_colours
from tests.browser import Browser, needs_a_browser
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
def drawn_into(files, tmp_path_factory):
    folder = tmp_path_factory.mktemp("drawn") / "new"
    assert cli.main(["review", *map(str, files), "--figures", str(folder), "--figure-format", "pdf"]) == 0
    return folder


class Sources(HTMLParser):
    """What a page asks for, what it says in its head, and its scripts."""

    def __init__(self, text):
        super().__init__()
        self.asked, self.policies, self.scripts, self.styles, self.inside = [], [], [], [], None
        self.buttons = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        named = dict(attributes)
        if tag not in ("svg", "line"):  # within a button
            self.inside = tag if tag in ("script", "style", "button") else None
        self.asked += [
            named[each] for each in ("src", "href", "data", "action", "poster", "srcset") if each in named
        ]
        if tag == "meta" and named.get("http-equiv") == "Content-Security-Policy":
            self.policies.append(named["content"])
        if tag == "button":
            self.buttons.append("")

    def handle_endtag(self, tag):
        if tag == self.inside:
            self.inside = None

    def handle_data(self, data):
        if self.inside == "script":
            self.scripts.append(data)
        elif self.inside == "style":
            self.styles.append(data)
        elif self.inside == "button":
            self.buttons[-1] += data


@pytest.fixture(scope="module")
def page(drawn_into):
    return Sources((drawn_into / comparison.PAGE).read_text(encoding="utf-8"))


def figures_of(page):
    """What the page's own script is given to draw."""
    (script,) = (each for each in page.scripts if each.startswith("const figures = "))
    content = script.removeprefix("const figures = ")
    return json.JSONDecoder().raw_decode(content)[0]


def decoded(values):
    if isinstance(values, dict):
        return np.frombuffer(base64.b64decode(values["bdata"]), dtype=np.dtype(values["dtype"]))
    return np.array(values)


def test_every_figure_is_there_twice_beside_the_page(drawn_into):
    kinds = [f"{name}.{kind}" for name in NAMES for kind in ("pdf", "svg")]
    assert sorted(os.listdir(drawn_into)) == sorted([comparison.PAGE, *kinds])
    for name in NAMES:
        assert (drawn_into / f"{name}.pdf").read_bytes().startswith(b"%PDF")
        assert ElementTree.parse(drawn_into / f"{name}.svg").getroot().tag.endswith("svg")


def test_the_page_asks_no_host_for_anything(page, drawn_into):
    assert all(address.startswith("#") for address in page.asked)
    assert not re.search(r"url\(|@import", "".join(page.styles))
    (policy,) = page.policies
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert not re.search(r"https?:|\*", policy)
    assert "connect-src" not in rules  # so that of `default-src` holds
    own = [script for script in page.scripts if not script.lstrip().startswith("/**")]
    assert not re.search(r"https?://|fetch|XMLHttpRequest|import\(", "".join(own))
    assert (drawn_into / comparison.PAGE).stat().st_size < LARGEST_BYTES


def test_every_series_of_every_run_is_on_the_page_to_seven_digits(files, page):
    runs = compared_runs([read(path) for path in files])
    traces = figures_of(page)["over-time"]["data"]
    for quantity in compared_quantities([run.table for run in runs]):
        for place, run in enumerate(runs):
            wanted = quantity.column(run.rows)
            results = [
                trace for trace in traces
                if trace["meta"] == f"{place}" and trace["type"] == "scatter" and trace["mode"] == "lines"
                and len(decoded(trace["y"])) == len(wanted)
                and np.allclose(decoded(trace["y"]), wanted, rtol=1e-6, atol=1e-12)
            ]  # fmt: skip
            assert results, (quantity.name, place)
            assert all(trace["dx"] == run.period_s for trace in results)
    maps = [trace for trace in traces if trace["type"] == "heatmap"]
    assert [trace["z"]["shape"] for trace in maps] == ["18, 400", "1, 400", "18, 150", "1, 150"]
    for run, means, variation in zip(runs, maps[::2], maps[1::2], strict=True):
        shown = decoded(means["z"]).reshape(18, -1)
        # Every tick is a cell: single precision.
        np.testing.assert_allclose(shown, run.table["current_A"].T, rtol=1e-6, atol=1e-7)
        assert not decoded(variation["z"]).any()


def test_the_axes_have_units_and_the_buttons_name_the_runs(page):
    figures = figures_of(page)
    titles = [each["text"] for each in figures["over-time"]["layout"]["annotations"]]
    for heading in (
        "error as one angle [°]",
        "β error [mrad]",
        "γ angle [rad]",
        "top current [A]",
    ):
        assert f"<b>{heading}</b>" in titles
    assert figures["over-time"]["layout"]["xaxis"]["title"]["text"] == "time [s]"
    assert figures["spectra"]["layout"]["xaxis"]["title"]["text"] == "frequency [Hz]"
    assert page.buttons == [
        "1 first: afsm, L 1, duration 0.4, …",
        "2 <b>&<i>: afsm, L 2, duration 0.3, …",
        "logarithmic axis of the error angle",
    ]


def test_text_of_a_user_is_never_markup(page):
    """The name of a file in a title of the plots; what a script holds ends at no tag within."""
    titles = [each["text"] for each in figures_of(page)["over-time"]["layout"]["annotations"]]
    assert any("&lt;b&gt;&amp;&lt;i&gt;" in title for title in titles)
    own = [script for script in page.scripts if script.startswith("const figures = ")]
    assert "<" not in own[0].split("const config")[0]


def test_the_same_runs_give_the_same_bytes(files, drawn_into, tmp_path):
    # That a PDF has no time and no random name in it is tested where it is written.
    assert cli.main(["review", *map(str, files), "--figures", str(tmp_path)]) == 0
    assert len(os.listdir(tmp_path)) == len(NAMES) + 1
    for name in os.listdir(tmp_path):
        assert (tmp_path / name).read_bytes() == (drawn_into / name).read_bytes(), name


def test_figures_of_an_earlier_review_are_replaced_and_other_files_stay(files, tmp_path):
    assert cli.main(["review", str(files[0]), "--figures", str(tmp_path), "--figure-format", "png"]) == 0
    assert (tmp_path / "sliding.svg").exists()
    assert (tmp_path / "events.png").exists()
    # Without sliding variables the new review has a figure less.
    (runs := tmp_path / "runs").mkdir()
    pid, _ = written(runs, "pid", duration=0.1, **{"controller.law": "pid"})
    (notes := tmp_path / "notes.svg").write_text("of the user's", encoding="utf-8")
    assert cli.main(["review", str(pid), "--figures", str(tmp_path)]) == 0
    left = {path.name for path in tmp_path.iterdir() if path.is_file()}
    figures = {f"{name}.svg" for name in NAMES if name != "sliding"}
    assert left == {comparison.PAGE, notes.name, *figures}
    # A folder without a page is no earlier review: the files in it are the user's.
    (tmp_path / comparison.PAGE).unlink()
    (other := tmp_path / "sliding.svg").write_text("of the user's", encoding="utf-8")
    assert cli.main(["review", str(pid), "--figures", str(tmp_path)]) == 0
    assert other.read_text(encoding="utf-8") == "of the user's"


def test_one_run_alone_and_a_long_one_by_its_extremes(files, tmp_path, monkeypatch):
    from spheretwin.viz.pages import interactive

    monkeypatch.setattr(interactive, "MOST_NUMBERS", 0)  # then as few points as ever
    monkeypatch.setattr(interactive, "FEWEST_POINTS", 50)
    assert cli.main(["review", str(files[0]), "--figures", str(tmp_path)]) == 0
    assert len(os.listdir(tmp_path)) == len(NAMES) + 1
    text = (tmp_path / comparison.PAGE).read_text(encoding="utf-8")
    assert "drawn by the lowest and highest value" in text
    traces = [each for each in figures_of(Sources(text))["over-time"]["data"] if each["type"] == "scatter"]
    low, high, mean = traces[:3]
    quantity = compared_quantities([read(files[0]).table])[0]
    run = compared_runs([read(files[0])])[0]
    values = quantity.column(run.rows)
    size = -(-len(values) // (50 // 3))
    blocks = [values[first : first + size] for first in range(0, len(values), size)]
    for trace, bound in ((low, np.min), (high, np.max), (mean, np.mean)):
        shown = decoded(trace["y"])[: len(blocks)]
        np.testing.assert_allclose(shown, [bound(block) for block in blocks], rtol=1e-6)
    assert high["fill"] == "tonexty"
    assert (low["x0"], low["dx"]) == (high["x0"], high["dx"]) == (0.0, pytest.approx(size * run.period_s))
    assert decoded(mean["x"])[-1] == pytest.approx(run.table["t_s"][-1])


@pytest.mark.parametrize("library", ["matplotlib", "plotly"])
def test_a_missing_library_is_reported_on_one_line(files, tmp_path, monkeypatch, library, capsys):
    from spheretwin.viz.pages import markdown

    present = markdown.find_spec
    monkeypatch.setattr(markdown, "find_spec", lambda name: None if name == library else present(name))
    assert cli.main(["review", str(files[0]), "--figures", str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"expected {library} to draw figures, which the extra plots installs: " in line


def test_a_folder_that_is_a_file_is_refused(files, capsys):
    assert cli.main(["review", str(files[0]), "--figures", str(files[1])]) == 2
    assert "expected a writable folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("status", "text"), [(None, "not closed"), (Status.LEFT_WORKSPACE, "left workspace")]
)
def test_the_end_of_a_run_that_is_not_complete_is_at_its_last_row(files, status, text):
    run = read(files[0])
    (drawn,) = compared_runs([replace(run, record=replace(run.record, status=status))])
    assert (drawn.early_end.t_s, drawn.early_end.status) == (run.table["t_s"][-1], text)
    assert compared_runs([run])[0].early_end is None


def test_a_run_without_a_tick_is_not_drawn(files, tmp_path):
    run = read(files[0])
    with pytest.raises(InputError, match="at least one tick"):
        comparison.write_figures([replace(run, table=run.table.rows(0, 0))], [{}], tmp_path)


def test_the_page_shows_the_spectra_in_mrad(files, page):
    traces = figures_of(page)["spectra"]["data"]
    colours = run_colours(["afsm", "afsm"])
    assert colours[0] != colours[1]
    for trace in traces:
        look = trace["line"] if trace["mode"] == "lines" else trace["marker"]
        assert look["color"] == colours[int(trace["meta"])]
    for place, path in enumerate(files):
        run = read(path)
        largest_mrad = [amplitudes(1e3 * error, run.period_s)[1].max() for error in run.table["error_rad"].T]
        shown = [
            np.max(decoded(trace["y"]))
            for trace in traces
            if trace["meta"] == f"{place}" and trace["mode"] == "lines"
        ]
        np.testing.assert_allclose(shown, largest_mrad, rtol=1e-6)
        peaks = run_summary.figures(run)["error_peaks"].values()
        messages = [1e3 * peak["amplitude_rad"] for axis in peaks for peak in axis]
        tops = np.concatenate(
            [
                decoded(trace["y"])
                for trace in traces
                if trace["meta"] == f"{place}" and trace["mode"] == "markers"
            ]
        )
        np.testing.assert_allclose(sorted(tops), sorted(messages), rtol=1e-6)


def test_the_page_has_the_differences_of_the_scenarios_and_the_ranges_of_settled_runs(
    files, page, drawn_into
):
    text = (drawn_into / comparison.PAGE).read_text(encoding="utf-8")
    _, _, table = text.partition("Differences of the scenarios</h2>")
    cells = [re.sub("<[^>]*>", "", cell) for cell in re.findall("<t[hd][^>]*>(.*?)</t[hd]>", table)]
    rows = [cells[first : first + 3] for first in range(0, len(cells), 3)]
    assert rows[0] == ["field", "run 1", "run 2"]
    assert ["L", "1", "2"] in rows
    assert ["duration", "0.4", "0.3"] in rows
    assert ["controller.period_s", "0.001", "0.002"] in rows
    layout = figures_of(page)["over-time"]["layout"]
    runs = compared_runs([read(path) for path in files])
    for place, quantity in enumerate(compared_quantities([run.table for run in runs]), start=1):
        values = [quantity.column(run.rows) for run in runs]
        low, high = layout[f"yaxis{place if place > 1 else ''}"]["range"]
        if quantity.limits:
            assert (low, high) == quantity.limits
        else:
            settled = [half[len(half) // 2 :] for half in values]
            assert low <= min(half.min() for half in settled)
            assert high >= max(half.max() for half in settled)


def test_titles_of_figures_name_the_common_conditions(files, drawn_into):
    svg = (drawn_into / "error.svg").read_text(encoding="utf-8")
    assert "Tracking error of each hinge: scenario hold, m 0, hardware ideal" in svg  # L differs


FIRST_AXIS = "plots[0].layout.yaxis"
DRAWN = """[...plots[0].querySelectorAll(".xy .js-line")].map((line) => line.getAttribute("d")).join("|")"""
"""Outlines of the lines of the first panel, the error as one angle."""

PANEL = """(() => {
  const panel = plots[0].querySelector(".nsewdrag[data-subplot='xy']");
  const {x, y, width, height} = panel.getBoundingClientRect();
  return [x, y, width, height];
})()"""


@pytest.fixture(scope="module")
def browser():
    with Browser() as browser:
        yield browser


@pytest.fixture
def opened(browser, drawn_into):
    page = browser.open((drawn_into / comparison.PAGE).as_uri())
    page.wait_for("plots.every((plot) => plot.querySelector('.js-line'))")
    yield page
    assert page.errors == []
    page.close()


@needs_a_browser
def test_the_switch_draws_the_error_angle_on_a_logarithmic_axis_and_back(opened):
    linear, (low, high) = opened.evaluate(DRAWN), opened.evaluate(f"{FIRST_AXIS}.range")
    assert opened.evaluate("plots[0].layout.meta[0].axis") == "yaxis"  # the first panel
    opened.click("#logarithmic")
    opened.wait_for(f"{FIRST_AXIS}.type === 'log'")
    assert opened.evaluate("scale.getAttribute('aria-pressed')") == "true"
    bottom, top = opened.evaluate(f"{FIRST_AXIS}.range")
    # The axis ends at the largest error, and has at most six decades.
    largest = opened.evaluate(
        "Math.max(...plots[0]._fullData.filter((t) => t.yaxis === 'y').flatMap((t) => [...t.y]))"
    )
    assert bottom < np.log10(largest) < top < np.log10(largest) + 0.5
    assert top - bottom <= 6 + 1e-9
    assert opened.evaluate(DRAWN) != linear
    others = opened.evaluate("Object.keys(plots[0].layout).filter((key) => /^yaxis[0-9]/.test(key))")
    assert all(opened.evaluate(f"plots[0].layout['{name}'].type") != "log" for name in others)
    opened.click("#logarithmic")
    opened.wait_for(f"{FIRST_AXIS}.type === 'linear'")
    assert opened.evaluate(f"{FIRST_AXIS}.range") == [low, high]
    assert opened.evaluate(DRAWN) == linear


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
    for count in (1, 2):
        for kind in ("mousePressed", "mouseReleased"):
            opened._mouse(kind, x + width / 2, middle, clickCount=count)
    opened.wait_for(f"plots[0].layout.xaxis.range[1] === {last}")
    assert opened.evaluate(DRAWN) == before


@needs_a_browser
def test_the_button_of_a_run_hides_its_lines_in_every_figure(opened):
    count = "plots.map((plot) => plot.querySelectorAll('.js-line').length)"
    both = opened.evaluate(count)
    opened.click("[data-run='0']")
    opened.wait_for("plots.every((plot) => plot.data.every((t) => t.meta !== '0' || t.visible === false))")
    assert all(0 < one < every for one, every in zip(opened.evaluate(count), both, strict=True))
    opened.click("[data-run='0']")
    opened.wait_for(f"String({count}) === '{','.join(map(str, both))}'")
