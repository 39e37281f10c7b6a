"""Pieces of a page in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from spheretwin.viz.figures.drawing import Drawing


def table(head: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[bool]) -> list[str]:
    """Lines of a table.

    Parameters
    ----------
    head : sequence of str
        A heading for each column.
    rows : sequence of sequence of str
    numbers : sequence of bool
        Whether each column is of figures, and so at the right.
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
