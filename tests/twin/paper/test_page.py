"""The page of the experiments: Markdown and HTML of the same content, for any reader, from no other host."""

import re

import pytest
from matplotlib.figure import Figure

from spheretwin.paper import page
from spheretwin.paper.experiment import Finding
from spheretwin.paper.page import Chapter
from spheretwin.paper.runner import make_plan, run_plan
from spheretwin.viz.pages.markdown import Drawing
from tests.twin.paper.cases import IDEAL, experiment


def test_html_loads_nothing_and_shows_its_figure_in_dark_colours_too(tmp_path):
    figure = Figure()
    figure.text(0.5, 0.5, "drawn")
    made = experiment(IDEAL)
    sections = [
        section._replace(drawings=[lambda: Drawing("short.svg", "What is |drawn|.", figure)])
        for section in made.sections(run_plan(make_plan(made, 1)))
    ]
    _, html = (
        path.read_text(encoding="utf-8") for path in page.write(tmp_path, [Chapter(made, sections)], "")
    )
    loading = r'url\((?!#)|@import|src=|href="(?!#)|<(script|link|iframe|object|img)\b'
    assert not re.search(loading, html)
    assert ">drawn</text>" in html
    assert "prefers-color-scheme: dark" in html


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
