"""Page of a command: title, summary, table of contents, sections with tables and figures, and a foot.

It is Markdown, and HTML in one file, without fonts, scripts and requests to a host.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from markdown_it import MarkdownIt

from spheretwin.models.base.checks import Check, broken
from spheretwin.models.base.extras import missing
from spheretwin.models.base.files import make_folder, whole_file
from spheretwin.models.telemetry.run_record import versions

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def shipped_text(name: str) -> str:
    """Contents of a style or a script of this folder."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


Inset = Callable[[str], str]
"""Return the HTML of a figure by its file or name."""


def page(title: str, markdown: str, inset: Inset | None = None, head: str = "", end: str = "") -> str:
    """Whole page, light or dark as the reader's system is; wide content scrolls in its box.

    Parameters
    ----------
    title : str
        As it is, without markup.
    markdown : str
        CommonMark with tables; tags in it are shown, not obeyed.
    inset : callable, optional
        Figures in the page; it refers to their files unless given.
    head, end : str
        HTML at the end of the head and of the page.
    """
    return "\n".join(
        [
            "<!doctype html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(title)}</title>",
            f"<style>\n{shipped_text('page.css')}</style>",
            *([head] if head else []),
            "</head>",
            "<body>",
            "<main>",
            f"{_rendered(markdown, inset)}{end}</main>",
            "</body>",
            "</html>",
            "",
        ]
    )


def _rendered(markdown: str, inset: Inset | None) -> str:
    reader = MarkdownIt("commonmark", {"html": False}).enable("table")
    reader.add_render_rule("table_open", _constant('<div class="wide" tabindex="0">\n<table>\n'))
    reader.add_render_rule("table_close", _constant("</table>\n</div>\n"))
    tokens = reader.parse(markdown)
    headings = [i for i, token in enumerate(tokens) if token.type == "heading_open" and token.tag != "h1"]
    for i, anchor in zip(headings, anchors(tokens[i + 1].content for i in headings), strict=True):
        tokens[i].attrs["id"] = anchor
    if inset:
        reader.add_render_rule("image", lambda _, images, place, *__: inset(str(images[place].attrs["src"])))
    for before, content, after in zip(tokens, tokens[1:], tokens[2:], strict=False):
        # A block is in no paragraph.
        if content.type == "inline" and re.fullmatch(rf"!\[[^]]*\]\({BLOCK}[^)]*\)", content.content):
            before.hidden = after.hidden = True
    # Code that is wider than the page scrolls by keyboard; texts are escaped.
    return str(reader.renderer.render(tokens, reader.options, {})).replace("<pre>", '<pre tabindex="0">')


BLOCK = "block:"
"""Before the name of an inset that is a block."""


def anchors(titles: Iterable[str]) -> list[str]:
    """Anchor of each heading, as GitHub makes them; a number tells equal ones apart."""
    counts: Counter[str] = Counter()
    names = []
    for title in titles:
        name = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
        names.append(f"{name}-{counts[name]}" if counts[name] else name)
        counts[name] += 1
    return names


def _svg(path: Path) -> str:
    """Inline SVG of a figure; its identifiers begin with the file's name, as a page has several."""
    content = path.read_text(encoding="utf-8")
    content = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{path.stem}-", content[content.index("<svg") :])
    return content.replace("<svg", '<svg role="img"', 1)


def _constant(text: str) -> Callable[..., str]:
    """Render rule with the same HTML for every token."""
    return lambda *_: text


class Drawing(NamedTuple):
    """Figure of a page, with its SVG file and its caption."""

    file: str
    caption: str
    figure: Figure


class ResultTable(NamedTuple):
    """Rows of text under headings, for a page and for the terminal."""

    title: str
    """Stands above the table unless it is empty."""
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    texts: int = 1
    """Number of columns of words at the left; the others are numbers, aligned at the right."""
    words: Sequence[str] = ()
    """Headings of further columns of words."""

    def lines(self) -> list[str]:
        """Return the lines of Markdown."""
        is_right = [place >= self.texts and name not in self.words for place, name in enumerate(self.head)]
        rule = f"|{'|'.join('---:' if right else '---' for right in is_right)}|"
        return [_row(self.head), rule, *map(_row, self.rows)]


class PageSection(NamedTuple):
    """Section of a page."""

    title: str
    content: Sequence[str | ResultTable | Drawing | PageSection]
    """Texts in Markdown, tables, figures, and sections of the next level; empty texts are left out."""

    def lines(self, level: int = 2) -> Iterator[str]:
        """Yield the lines of Markdown, with a heading of some level."""
        yield from (f"{'#' * level} {self.title}", "")
        for part in self.content:
            if isinstance(part, PageSection):
                yield from part.lines(level + 1)
            elif isinstance(part, ResultTable):
                yield from (f"**{part.title}**", "") if part.title else ()
                yield from (*part.lines(), "")
            elif isinstance(part, Drawing):
                yield from (f"![{part.caption}]({part.file})", "", f"*{part.caption}*", "")
            elif part:
                yield from (part, "")

    def drawings(self) -> Iterator[Drawing]:
        """Yield the figures, also of inner sections."""
        for part in self.content:
            if isinstance(part, PageSection):
                yield from part.drawings()
            elif isinstance(part, Drawing):
                yield part


def _row(cells: Sequence[str]) -> str:
    """Row of a table; no bar in a text ends a cell."""
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


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
    check_libraries("matplotlib", *libraries)
    make_folder(folder)


def check_libraries(*libraries: str) -> None:
    """Check that libraries for figures are installed; raises `InputError` otherwise."""
    for library in libraries:
        if find_spec(library) is None:
            raise missing("output", library, "plots", "to draw figures")


class ReportPage(NamedTuple):
    """Page of a command."""

    name: str
    """Name of its files without the suffix."""
    title: str
    lead: str
    """Summary in Markdown."""
    sections: Sequence[PageSection]
    command: str
    """Command that creates the page."""

    def write(self, folder: Path, figure_format: str = "svg") -> list[Path]:
        """Write Markdown, self-contained HTML, and the figures into a folder that exists; return the pages.

        Parameters
        ----------
        folder : Path
        figure_format : str
            Format in which the figures are written in addition to SVG, as in `save_drawings`.

        Raises
        ------
        InputError
            A file cannot be written there.
        """
        save_drawings(
            folder, (drawing for section in self.sections for drawing in section.drawings()), figure_format
        )
        text, svg = self.text(), lambda file: _svg(folder / file)
        return [
            save_text(folder / f"{self.name}.md", text),
            save_text(folder / f"{self.name}.html", page(self.title, text, svg)),
        ]

    def text(self) -> str:
        """Return the page in Markdown."""
        lines = [line for section in self.sections for line in section.lines()]
        return "\n".join(
            [f"# {self.title}", "", self.lead, "", *contents(lines), *lines, *foot(self.command)]
        )


def figures_section(drawings: Iterable[Drawing]) -> list[PageSection]:
    """Section of all figures of a page; none without a figure."""
    return [PageSection("Figures", all_drawings)] if (all_drawings := tuple(drawings)) else []


CHECK_HEAD = ("check", "compared quantities", "states", "value", "bound", "passed", "reason for the bound")


def verdict(checks: Sequence[Check]) -> str:
    """Sentence on the bounds that checks exceed."""
    names = broken(checks)
    result = f"**Exceeded bounds: {'; '.join(names)}.**" if names else "**No bound is exceeded.**"
    return f"Number of checks: {len(checks)}. {result}"


def checks_section(checks: Iterable[Check]) -> PageSection:
    """Section with a row for each check."""
    return PageSection(
        "Checks", [ResultTable("", CHECK_HEAD, list(map(_check_row, checks)), 2, CHECK_HEAD[-2:])]
    )


def _check_row(check: Check) -> tuple[str, ...]:
    figures = f"{check.states:,}", check.value_text(), check.bound_text()
    return check.name, check.compares, *figures, "yes" if check.ok else "**no**", check.why


def contents(lines: Sequence[str]) -> list[str]:
    """Table of contents: a list of links to the headings of the second and third level."""
    headings = [line for text in lines for line in text.splitlines() if line.startswith(("## ", "### "))]
    titles = [heading.lstrip("#").strip() for heading in headings]
    links = [f"[{text}](#{anchor})" for text, anchor in zip(titles, anchors(titles), strict=True)]
    indents = ["" if heading.startswith("## ") else "  " for heading in headings]
    return [*(f"{indent}- {link}" for indent, link in zip(indents, links, strict=True)), ""]


def foot(command: str) -> list[str]:
    """Command and versions below a page."""
    used = ", ".join(f"{name} {version}" for name, version in versions().items())
    return ["---", "", f"Created by `{command}` with {used}.", ""]


FIGURE_KINDS = ("svg", "pdf", "png")
"""Endings of the files of figures."""


def save_drawings(folder: Path, drawings: Iterable[Drawing], figure_format: str = "svg") -> list[Path]:
    """Write figures into a folder that exists, as SVG and in a given format; return the written files.

    Parameters
    ----------
    folder : Path
    drawings : iterable of Drawing
    figure_format : str
        svg, pdf, png, or pdf of a width of `style.PAPER_WIDTHS_in`.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    written = []
    for drawing in drawings:
        from spheretwin.viz.figures import style  # without figures, matplotlib may be absent

        for kind in dict.fromkeys(("svg", figure_format)):
            if kind in style.PAPER_WIDTHS_in:
                style.fit_width(drawing.figure, style.PAPER_WIDTHS_in[kind])
            path = (folder / drawing.file).with_suffix(f".{kind.partition('-')[0]}")
            style.save(drawing.figure, path, drawing.caption)
            written.append(path)
    return written


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
