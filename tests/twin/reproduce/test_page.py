"""The page of the experiments: Markdown and HTML of the same content, for any reader, from no other host."""

import re
from html.parser import HTMLParser

import pytest
from matplotlib.figure import Figure

from spheretwin.twin.reproduce import page
from spheretwin.twin.reproduce.page import Chapter
from spheretwin.twin.reproduce.planning import planned
from spheretwin.twin.reproduce.running import carried_out
from spheretwin.viz.figures.drawing import Drawing
from tests.twin.reproduce.cases import IDEAL, experiment


def drawing():
    figure = Figure()
    figure.text(0.5, 0.5, "drawn")
    return Drawing("short.png", "What is |drawn|.", figure)


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
    sections = made.tell(carried_out(planned(made, 1)))
    sections = [section._replace(draw=[drawing]) for section in sections]
    paths = page.write(
        folder, [Chapter(made, sections)], "spheretwin reproduce short --seeds 3", {"python": "3"}
    )
    return folder, *(path.read_text(encoding="utf-8") for path in paths)


def test_both_forms_and_the_figures_are_in_the_folder(written):
    folder, _, _ = written
    assert sorted(path.name for path in folder.iterdir()) == ["reproduce.html", "reproduce.md", "short.png"]


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
    assert "Made by `spheretwin reproduce short --seeds 3` with python 3." in markdown
    assert "spheretwin reproduce short --seeds 3" in said


def test_html_asks_nobody_for_anything(written):
    reader = Reader(written[2])
    names = {tag for tag, _ in reader.tags}
    assert not names & {"script", "link", "iframe", "object", "b"}  # nor is a tag in a text obeyed
    asked = [
        value for _, attributes in reader.tags for key, value in attributes.items() if key in ("src", "href")
    ]
    assert asked == ["short.png"]
    assert not re.search(r"url\(|@import|https?:", written[2])


def test_html_is_read_on_a_phone_and_in_the_dark(written):
    _, _, html = written
    reader = Reader(html)
    assert ("meta", {"name": "viewport", "content": "width=device-width, initial-scale=1"}) in reader.tags
    assert "prefers-color-scheme: dark" in html
    tags = [(tag, attributes.get("class")) for tag, attributes in reader.tags]
    assert tags[tags.index(("table", None)) - 1] == ("div", "wide")  # what is wide moves in its own box
