"""Page of a command: tables, escaped tags, table of contents, figures with text, and the foot."""

import re
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from spheretwin.cli.options import COMMON
from spheretwin.viz.figures.style import PAPER_TEXT_pt, PAPER_WIDTHS_in, fit_width
from spheretwin.viz.pages import markdown


def test_tables_of_markdown_become_tables():
    lines = markdown.table(("law", "α"), [("a | b", "1.5"), ("*c*", "2")], (False, True))
    assert lines == ["| law | α |", "|---|---:|", "| a \\| b | 1.5 |", "| *c* | 2 |"]
    made = markdown.page("title", "\n".join(lines))
    assert made.count("<tr>") == 3
    assert "<td>a | b</td>" in made
    assert '<td style="text-align:right">1.5</td>' in made
    assert "<td><em>c</em></td>" in made


def test_tags_are_shown_and_not_obeyed():
    made = markdown.page("a < b", "<script>alert(1)</script> and [a link](javascript:alert(1))")
    assert "<title>a &lt; b</title>" in made
    assert "<script" not in made
    assert 'href="javascript' not in made


SVG = "{http://www.w3.org/2000/svg}"


def drawing(name):
    figure = Figure()
    axes = figure.subplots()
    axes.plot([0, 1], [2, 3], "o", clip_on=True)
    axes.set_xlabel(f"torque of {name}, N·m")
    return markdown.Drawing(f"{name}.svg", f"Torque of {name} < 2.", figure)


def write(folder, figure_format="svg"):
    folder.mkdir()
    drawings = [drawing("first"), drawing("second")]
    sections = ["## Gains, `pd`", "", "### Errors", "", "## Errors", "", *map(markdown.figure, drawings)]
    return markdown.write_page(
        folder, "page", "A title", ["Two of three hold."], sections, drawings, "spheretwin x", figure_format,
    )  # fmt: skip


def test_page_has_title_summary_contents_sections_and_foot_in_this_order(tmp_path):
    markdown_page, html_page = write(tmp_path / "a")
    parts = [
        "A title", "Two of three hold.", "](#gains-pd)", "](#errors)", "](#errors-1)", "## Gains",
        "Torque of first", "Created by `spheretwin x` with python ",
    ]  # fmt: skip
    text = markdown_page.read_text()
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    page = html_page.read_text()
    links = re.findall(r'<a href="#([^"]*)"', page)
    assert links == re.findall(r'<h[23] id="([^"]*)"', page) == ["gains-pd", "errors", "errors-1"]
    assert page.index("Two of three") < page.index('href="#gains-pd"') < page.index('id="gains-pd"')


def test_figures_of_a_page_have_text_a_title_and_identifiers_of_their_own(tmp_path):
    page = write(tmp_path / "a")[1].read_text()
    for name in ("first", "second"):
        root = ElementTree.parse(tmp_path / "a" / f"{name}.svg").getroot()
        assert f"torque of {name}, N·m" in [text.text for text in root.iter(f"{SVG}text")]
        assert root.find(f"{SVG}title").text == f"Torque of {name} < 2."
        assert f">torque of {name}, N·m</text>" in page
        assert f"<title>Torque of {name} &lt; 2.</title>" in page
    names = re.findall(r'\bid="([^"]*)"', page)
    assert len(names) == len(set(names))
    assert set(re.findall(r'href="#([^"]*)"|url\(#([^)]*)\)', page)) <= {
        pair for name in names for pair in ((name, ""), ("", name))
    }


@pytest.mark.parametrize(("kind", "start"), [("pdf", b"%PDF"), ("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_the_same_page_has_the_same_bytes_in_each_format(tmp_path, kind, start):
    for name in ("a", "b"):
        write(tmp_path / name, kind)
    files = {path.name for path in (tmp_path / "a").iterdir()}
    figures = {f"{name}.{suffix}" for name in ("first", "second") for suffix in ("svg", kind)}
    assert files == {"page.md", "page.html"} | figures
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    assert (tmp_path / "a" / f"first.{kind}").read_bytes().startswith(start)


def test_formats_of_a_paper_have_its_widths():
    assert PAPER_WIDTHS_in == {"pdf-one-column": 3.5, "pdf-two-columns": 7.16}
    assert set(COMMON["--figure-format"]["choices"]) == {"svg", "pdf", "png", *PAPER_WIDTHS_in}


@pytest.mark.parametrize("kind", PAPER_WIDTHS_in)
def test_pdf_of_a_paper_has_its_width_and_the_svg_that_of_the_page(tmp_path, kind):
    write(tmp_path / "a", kind)
    content = (tmp_path / "a" / "first.pdf").read_bytes()
    width_pt = float(re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ", content)[1])
    # PDF counts in 1/72 in, and matplotlib rounds to a thousandth.
    assert width_pt == pytest.approx(72 * PAPER_WIDTHS_in[kind], abs=1e-2)
    figure_width_in = Figure().get_size_inches()[0]
    svg = ElementTree.parse(tmp_path / "a" / "first.svg").getroot()
    assert svg.get("width") == f"{72 * figure_width_in:g}pt"


@pytest.mark.parametrize("width_in", PAPER_WIDTHS_in.values())
def test_text_of_a_paper_is_legible_and_within_the_figure(width_in):
    figure = Figure(figsize=(10.0, 6.0), layout="constrained")
    panels = figure.subplots(1, 2)
    labels = [f"law {number} with a long name" for number in range(8)]
    for label in labels:
        panels[0].plot([0, 1], [1, 2], label=label)
    for panel in panels:
        panel.set_ylabel("largest error of the hinge, mrad", fontsize="small")
        panel.set_title("a panel", fontsize="x-small")
    title = (
        "A title of many words that is longer than the width of one column of a paper can hold in one line"
    )
    figure.suptitle(title)
    figure.legend(loc="outside lower center", ncols=8)
    fit_width(figure, width_in)
    figure.draw_without_rendering()
    assert figure.get_size_inches()[0] == width_in
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == labels
    shown = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert {title, "largest error of the hinge, mrad", *labels} <= {text.get_text() for text in shown}
    assert min(text.get_fontsize() for text in shown) >= PAPER_TEXT_pt
    for text in [*legend.get_texts(), *figure.texts, *(panel.yaxis.label for panel in panels)]:
        box = text.get_window_extent()
        # Nothing is cut: a pixel is what the hinting of a letter may take.
        assert box.x0 >= -1
        assert box.x1 <= figure.bbox.width + 1
        assert box.y0 >= -1
        assert box.y1 <= figure.bbox.height + 1
