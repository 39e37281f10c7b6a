"""Pieces of a page in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import make_folder, whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Drawing(NamedTuple):
    """Figure of a page, with its file and its caption."""

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


def save_drawings(folder: Path, drawings: Iterable[Drawing], *, vector: bool = False) -> None:
    """Write figures into a folder that exists.

    Parameters
    ----------
    folder : Path
    drawings : iterable of Drawing
    vector : bool
        Write each as SVG too, next to its PNG.

    Raises
    ------
    InputError
        A file cannot be written there.
    """
    from spheretwin.viz.figures.style import save

    for drawing in drawings:
        save(drawing.figure, folder / drawing.file)
        if vector:
            save(drawing.figure, (folder / drawing.file).with_suffix(".svg"))


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
