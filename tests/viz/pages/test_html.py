"""Page of a command: tables, escaped tags, table of contents, figures with text, and the foot."""

import re
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure

from spheretwin.cli.options import FIGURE_FORMATS
from spheretwin.viz.figures.style import PAPER_WIDTHS_in
from spheretwin.viz.pages import markdown


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
    gains = markdown.PageSection("Gains, `pd`", [markdown.PageSection("Errors", [])])
    errors = markdown.PageSection("Errors", [drawing("first"), drawing("second")])
    page = markdown.ReportPage("page", "A title", "Two of three hold.", [gains, errors], "spheretwin x")
    return page.write(folder, figure_format)


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


@pytest.mark.release("1.5 s; changes with Matplotlib")
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
    assert set(FIGURE_FORMATS) == {"svg", "pdf", "png", *PAPER_WIDTHS_in}


@pytest.mark.release("1 s; changes with Matplotlib")
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


def test_anchors_are_those_of_github_and_equal_headings_are_numbered():
    assert markdown.anchors(["Gains, `pd`", "Errors", "Errors"]) == ["gains-pd", "errors", "errors-1"]
