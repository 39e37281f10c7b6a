"""What the experiments found as one page: Markdown, HTML of the same content, and the figures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from spheretwin.twin.reproduce.experiment import Experiment, Section
from spheretwin.viz.figures.drawing import Drawing
from spheretwin.viz.page import html
from spheretwin.viz.page import markdown as pieces
from spheretwin.viz.page.folder import save_drawings, save_text

TITLE = "What the paper shows, run again"
MARKDOWN, HTML = "reproduce.md", "reproduce.html"


class Chapter(NamedTuple):
    """One experiment on the page."""

    experiment: Experiment
    sections: Sequence[Section]


def write(folder: Path, chapters: Sequence[Chapter], command: str, versions: Mapping[str, str]) -> list[Path]:
    """Write the page and its figures into a folder; returns both forms of the page.

    Parameters
    ----------
    folder : Path
        Exists.
    chapters : sequence of Chapter
    command : str
        What makes the page again, for its foot.
    versions : mapping
        Version by package, for the same.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    drawn = [[[draw() for draw in section.draw] for section in chapter.sections] for chapter in chapters]
    save_drawings(folder, (drawing for chapter in drawn for section in chapter for drawing in section))
    text = markdown(chapters, drawn, command, versions)
    return [
        save_text(folder / MARKDOWN, text),
        save_text(folder / HTML, html.page(TITLE, text)),
    ]


def markdown(
    chapters: Sequence[Chapter],
    drawn: Sequence[Sequence[Sequence[Drawing]]],
    command: str,
    versions: Mapping[str, str],
) -> str:
    """Text of the page."""
    used = ", ".join(f"{name} {version}" for name, version in versions.items())
    lines = [f"# {TITLE}", ""]
    for chapter, drawings in zip(chapters, drawn, strict=True):
        lines += [f"## {chapter.experiment.title}", "", chapter.experiment.shows, ""]
        for section, of_section in zip(chapter.sections, drawings, strict=True):
            lines += _section(section, of_section)
    lines += [f"Made by `{command}` with {used}.", ""]
    return "\n".join(lines)


def _section(section: Section, drawings: Iterable[Drawing]) -> list[str]:
    lines = [f"### {section.title}", "", section.text, ""]
    for table in section.tables:
        numbers = [column >= table.texts for column in range(len(table.head))]
        lines += [f"**{table.title}**", "", *pieces.table(table.head, table.rows, numbers), ""]
    return [*lines, *map(pieces.figure, drawings)]
