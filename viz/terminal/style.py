"""How every table looks, and how wide it may be."""

from __future__ import annotations

import os

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape
from rich.table import Table

WIDTH_WITHOUT_TERMINAL = 150


def console() -> Console:
    """What is written to stdout, as wide as the terminal, or as a file is read."""
    told = Console()
    if told.is_terminal or "COLUMNS" in os.environ:
        return told
    return Console(width=WIDTH_WITHOUT_TERMINAL)


def table(title: str, first: str, *others: str, lines: bool = False) -> Table:
    """A table under its title: what a row is about at the left, figures at the right.

    Parameters
    ----------
    title, first, others : str
        As they are, without markup; headings of the columns.
    lines : bool
        Whether to part the rows, where they have several lines each.
    """
    made = Table(
        title=escape(title),
        title_justify="left",
        box=box.HORIZONTALS,
        pad_edge=False,
        show_lines=lines,
        min_width=min(cell_len(title), console().width),  # a title is wrapped to its table
    )
    made.add_column(escape(first), overflow="fold")
    for heading in others:
        made.add_column(escape(heading), justify="right")
    return made
