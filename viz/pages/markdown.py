"""Page of a command: title, summary, table of contents, sections with tables and figures, and a foot."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import make_folder, whole_file
from spheretwin.models.telemetry.run_record import versions
from spheretwin.viz.pages import html

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Drawing(NamedTuple):
    """Figure of a page, with its SVG file and its caption."""

    file: str
    caption: str
    figure: Figure


def table(head: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[bool]) -> list[str]:
    """Lines of a table.

    Parameters
    ----------
    head : sequence of str
        A heading for each column.
    rows : sequence of sequence of str
    numbers : sequence of bool
        Whether each column contains numbers, aligned at the right.
    """
    return [
        _row(head),
        f"|{'|'.join('---:' if right else '---' for right in numbers)}|",
        *(_row(row) for row in rows),
    ]


def figure(drawing: Drawing) -> str:
    """A figure and, below it, what it shows."""
    return f"![{drawing.caption}]({drawing.file})\n\n*{drawing.caption}*\n"


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(_cell(cell) for cell in cells)} |"


def _cell(text: str) -> str:
    """Text in which no bar ends a cell of the table."""
    return text.replace("|", "\\|")


def prepare(folder: Path, *libraries: str) -> None:
    """Check before a run that a page can be drawn and written, and make its folder.

    Parameters
    ----------
    folder : Path
    *libraries : str
        Libraries besides matplotlib.

    Raises
    ------
    InputError
        A library is not installed, or the folder cannot be made or written to.
    """
    for library in ("matplotlib", *libraries):
        if find_spec(library) is None:
            raise InputError(
                "output: expected the extra `spheretwin[plots]` to draw figures,"
                f" received an installation without {library}"
            )
    make_folder(folder)


def write_page(
    folder: Path,
    name: str,
    title: str,
    summary: Sequence[str],
    sections: Sequence[str],
    drawings: Iterable[Drawing],
    command: str,
    figure_format: str = "svg",
) -> list[Path]:
    """Write a page as Markdown and as self-contained HTML, and its figures; return the two pages.

    Parameters
    ----------
    folder : Path
        Exists.
    name : str
        Name of the page's files without the suffix.
    title : str
    summary, sections : sequence of str
        Lines of Markdown.
    drawings : iterable of Drawing
        Figures to which the lines refer.
    command : str
        Command that creates the page.
    figure_format : str
        Format in which the figures are written in addition to SVG: svg, pdf or png.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    save_drawings(folder, drawings, figure_format)
    lines = [f"# {title}", "", *summary, "", *contents(sections), *sections, *foot(command)]
    text = "\n".join(lines)
    return [
        save_text(folder / f"{name}.md", text),
        save_text(folder / f"{name}.html", html.page(title, text, folder)),
    ]


def contents(lines: Sequence[str]) -> list[str]:
    """Table of contents: a list of links to the headings of the second and third level."""
    headings = [line for text in lines for line in text.splitlines() if line.startswith(("## ", "### "))]
    titles = [heading.lstrip("#").strip() for heading in headings]
    links = [f"[{text}](#{anchor})" for text, anchor in zip(titles, html.anchors(titles), strict=True)]
    indents = ["" if heading.startswith("## ") else "  " for heading in headings]
    return [*(f"{indent}- {link}" for indent, link in zip(indents, links, strict=True)), ""]


def foot(command: str) -> list[str]:
    """Command and versions below a page."""
    used = ", ".join(f"{name} {version}" for name, version in versions().items())
    return ["---", "", f"Created by `{command}` with {used}.", ""]


def save_drawings(folder: Path, drawings: Iterable[Drawing], figure_format: str = "svg") -> None:
    """Write figures into a folder that exists: as SVG and in a given format.

    Parameters
    ----------
    folder : Path
    drawings : iterable of Drawing
    figure_format : str
        svg, pdf or png.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    for drawing in drawings:
        from spheretwin.viz.figures.style import save  # without figures, matplotlib may be absent

        for suffix in dict.fromkeys(("svg", figure_format)):
            path = (folder / drawing.file).with_suffix(f".{suffix}")
            save(drawing.figure, path, drawing.caption)


def save_text(path: Path, text: str) -> Path:
    """Write a file completely or not at all; return its path.

    Raises
    ------
    InputError
        It cannot be written there.
    """
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path
