"""Page of the experiments: nothing loaded, verdicts of findings, commands in a file if they are many."""

import re

from matplotlib.figure import Figure

from spheretwin.paper import page
from spheretwin.paper.experiment import Statement
from spheretwin.paper.page import Chapter
from spheretwin.viz.pages.markdown import Drawing
from tests.twin.paper.cases import IDEAL, experiment


def texts_of(folder, *findings, commands=(), **fields):
    """Markdown and HTML of the page of an experiment without a run."""
    made = experiment(IDEAL)
    sections = [section._replace(**fields) for section in made.sections({})]
    written = page.write(folder, [Chapter(made, sections, findings, commands)], "")
    return [path.read_text(encoding="utf-8") for path in written]


def test_html_loads_nothing_and_shows_its_figure_in_dark_colours_too(tmp_path):
    figure = Figure()
    figure.text(0.5, 0.5, "drawn")
    _, html = texts_of(tmp_path, drawings=[lambda: Drawing("short.svg", "What is |drawn|.", figure)])
    loading = r'url\((?!#)|@import|src=|href="(?!#)|<(script|link|iframe|object|img)\b'
    assert not re.search(loading, html)
    assert ">drawn</text>" in html
    assert "prefers-color-scheme: dark" in html


def test_the_first_page_counts_what_was_reproduced(tmp_path):
    findings = [
        Statement(True, "this was"),
        Statement(False, "that was not | at all"),
        Statement(None, "more"),
    ]
    first = texts_of(tmp_path, *findings)[0].split("## A short one")[0]
    assert "1 of 2 results of the paper were reproduced." in first
    assert "| short | **reproduced** | this was. |" in first
    assert "| short | **not reproduced** | that was not \\| at all. |" in first


def test_more_commands_than_a_page_takes_are_in_a_file(tmp_path):
    commands = [f"spheretwin simulate tilt --seed {number}" for number in range(page.MOST_COMMANDS + 1)]
    file = tmp_path / "short_commands.txt"
    assert all(commands[-2] in text for text in texts_of(tmp_path, commands=commands[:-1]))
    assert not file.exists()
    text, _ = texts_of(tmp_path, commands=commands)
    assert file.read_text().splitlines() == commands
    assert "(short_commands.txt)" in text
    assert commands[-1] not in text
