"""The page of the experiments: Markdown and HTML of the same content, for any reader, from no other host."""

import re
from html.parser import HTMLParser

import pytest
from matplotlib.figure import Figure

from spheretwin.paper import page
from spheretwin.paper.experiment import Finding
from spheretwin.paper.page import Chapter
from spheretwin.paper.runner import make_plan, run_plan
from spheretwin.viz.pages.markdown import Drawing
from tests.twin.paper.cases import IDEAL, experiment


def drawing():
    figure = Figure()
    figure.text(0.5, 0.5, "drawn")
    return Drawing("short.svg", "What is |drawn|.", figure)


class Reader(HTMLParser):
    """Tags and texts of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.texts = [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_data(self, text):
        self.texts.append(text)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    made = experiment(IDEAL._replace(name="one | two"))
    sections = made.sections(run_plan(make_plan(made, 1)))
    sections = [section._replace(drawings=[drawing]) for section in sections]
    paths = page.write(folder, [Chapter(made, sections)], "spheretwin reproduce short --seeds 3")
    return folder, *(path.read_text(encoding="utf-8") for path in paths)


@pytest.mark.release("5.5 s; content of the paper has the pages")
def test_both_forms_and_the_figures_are_in_the_folder(written):
    folder, _, _ = written
    assert sorted(path.name for path in folder.iterdir()) == [
        "reproduce.html",
        "reproduce.md",
        "short.svg",
    ]


def test_both_forms_have_the_same_content(written):
    _, markdown, html = written
    reader = Reader(html)
    said = " ".join(reader.texts)
    for text in (
        "A short one",
        "It is over soon.",
        "What | was found",
        "Errors",
        "one | two",
        "What is |drawn|.",
    ):
        assert text in markdown.replace("\\|", "|")
        assert text in said
    cells = [tag for tag, _ in reader.tags if tag in ("td", "th")]
    assert len(cells) == 4
    assert "Created by `spheretwin reproduce short --seeds 3` with python " in markdown
    assert "spheretwin reproduce short --seeds 3" in said


def test_html_asks_nobody_for_anything(written):
    reader = Reader(written[2])
    names = {tag for tag, _ in reader.tags}
    assert not names & {"script", "link", "iframe", "object", "b"}  # nor is a tag in a text obeyed
    links = [value for _, attributes in reader.tags for key, value in attributes.items() if "href" in key]
    assert all(link.startswith("#") for link in links)
    assert "img" not in names  # the figure is in the page itself
    assert "drawn" in reader.texts
    assert not re.search(r"url\((?!#)|@import|src=", written[2])


def test_html_is_read_on_a_phone_and_in_the_dark(written):
    _, _, html = written
    reader = Reader(html)
    assert ("meta", {"name": "viewport", "content": "width=device-width, initial-scale=1"}) in reader.tags
    assert "prefers-color-scheme: dark" in html
    tags = [(tag, attributes.get("class")) for tag, attributes in reader.tags]
    assert tags[tags.index(("table", None)) - 1] == ("div", "wide")  # what is wide moves in its own box


def test_the_first_page_says_what_was_reproduced(tmp_path):
    made = experiment(IDEAL)
    findings = [Finding(True, "this was"), Finding(False, "that was not | at all"), Finding(None, "more")]
    chapters = [Chapter(made, made.sections(run_plan(make_plan(made, 1))), findings)]
    text = page.write(tmp_path, chapters, "")[0].read_text(encoding="utf-8")
    first = text.split("## A short one")[0]
    assert "1 of 2 results of the paper were reproduced." in first
    assert f"## {page.REPRODUCED}" in first
    assert "| short | **reproduced** | this was. |" in first
    assert "| short | **not reproduced** | that was not \\| at all. |" in first
    assert "| short | more. |" in first.split(f"## {page.FURTHER}")[1]


@pytest.mark.parametrize("count", [2, page.MOST_COMMANDS + 1])
def test_every_row_s_command_line_is_there(tmp_path, count):
    made = experiment(IDEAL)
    commands = [f"spheretwin simulate tilt --seed {number}" for number in range(count)]
    chapters = [Chapter(made, made.sections(run_plan(make_plan(made, 1))), [], commands, "Rows: some.")]
    text, html = (path.read_text(encoding="utf-8") for path in page.write(tmp_path, chapters, ""))
    assert "Rows: some." in text
    file = tmp_path / "short_commands.txt"
    if count > page.MOST_COMMANDS:
        assert file.read_text().splitlines() == commands
        assert "(short_commands.txt)" in text
        assert commands[-1] not in text
    else:
        assert not file.exists()
        assert all(command in text and command in html for command in commands)
