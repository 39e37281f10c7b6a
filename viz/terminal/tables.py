"""Style and width of all tables."""

from __future__ import annotations

import copy
import math
import os
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, TextIO

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape
from rich.padding import Padding
from rich.table import Column, Table
from rich.text import Text

from spheretwin.models.base.checks import Check, broken

WIDTH_WITHOUT_TERMINAL = 100
LEAST = 1e-3
"""Smaller figures are written as less than this: they are negligible."""

MOST_LINES = 3
"""Lines of a cell."""

PADDING, EDGE = 3, 1
"""Characters next to the text of a column, and at the end of a line."""


def terminal_console() -> Console:
    """Return a console for stdout: as wide as the terminal; in a pipe or a file of a readable width."""
    console = Console()
    if console.is_terminal:
        return console
    width = None if "COLUMNS" in os.environ else WIDTH_WITHOUT_TERMINAL
    file: Any = _Unpadded(sys.stdout)
    return Console(width=width, file=file)


class _Unpadded:
    """Standard output without the spaces at the ends of lines that fill a table."""

    def __init__(self, file: TextIO) -> None:
        self._file = file

    def write(self, text: str) -> int:
        return self._file.write(re.sub(" +(?=\n)", "", text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


def new_table(title: str, first: str, *others: str) -> Table:
    """Return a table with a title: labels in the left column, figures in the others.

    Without a terminal it is Markdown.

    Parameters
    ----------
    title, first, others : str
        As they are, without markup; headings of the columns.
    """
    console = terminal_console()
    table = Table(
        title=escape(title),
        title_justify="left",
        box=box.HORIZONTALS if console.is_terminal else box.MARKDOWN,
        pad_edge=not console.is_terminal,
        min_width=min(cell_len(title), console.width),  # a title is wrapped to its table
    )
    table.add_column(escape(first), overflow="fold")
    for heading in others:
        table.add_column(escape(heading), justify="right", overflow="fold")
    return table


def print_table(table: Table, labels: int = 1) -> None:
    """Print a table without broken words and without cells of more than three lines.

    A table that is too wide is split by columns into several, and each of them has the label columns. A table
    with longer texts is printed as a list.

    Parameters
    ----------
    table : Table
        From `new_table`.
    labels : int
        Number of label columns, at the left.
    """
    console = terminal_console()
    least = [_least_width(column, console) for column in table.columns]
    if any(
        _total(least, [*range(labels), column]) > console.width - EDGE for column in range(labels, len(least))
    ):
        _print_list(table, labels, console)
        return
    natural = [max((cell_len(line) for line in _lines(column)), default=0) for column in table.columns]
    for place, columns in enumerate(_blocks(least, natural, labels, console.width - EDGE)):
        block = copy.copy(table)
        block.columns = [
            replace(table.columns[column], _index=index, width=width)
            for index, (column, width) in enumerate(columns.items())
        ]
        if place:
            block.title = None
        console.print(block)


def _print_list(table: Table, labels: int, console: Console) -> None:
    """Print title, and for each row the labels and below them the other texts with their headings."""
    console.print(table.title)
    heads = [str(column.header) for column in table.columns]
    for row in zip(*(column.cells for column in table.columns), strict=True):
        console.print(f"- {', '.join(map(str, row[:labels]))}", soft_wrap=True)
        for head, text in zip(heads[labels:], row[labels:], strict=True):
            console.print(Padding(f"{head}: {text}", (0, 0, 0, 2)))


def _lines(column: Column) -> Iterator[str]:
    """Yield the lines of heading and cells of a column, without markup."""
    for cell in (column.header, *column.cells):
        yield from Text.from_markup(str(cell)).plain.splitlines()


def _least_width(column: Column, console: Console) -> int:
    """Return the least width with complete words and at most three lines in a cell."""
    texts = [Text.from_markup(str(cell)) for cell in (column.header, *column.cells)]
    width = max((cell_len(word) for text in texts for word in text.plain.split()), default=1)
    for text in texts:
        most_lines = max(MOST_LINES, len(text.plain.splitlines()))
        while len(text.wrap(console, width)) > most_lines:
            width += 1
    return width


def _blocks(
    least: Sequence[int], natural: Sequence[int], labels: int, available: int
) -> Iterator[dict[int, int]]:
    """Yield the columns of each block with their widths, as wide as the texts if there is space."""
    first, others = list(range(labels)), list(range(labels, len(least)))
    while True:
        block = first + others[:1]
        others = others[1:]
        while others and _total(least, [*block, others[0]]) <= available:
            block.append(others.pop(0))
        widths = {column: least[column] for column in block}
        space = available - _total(least, block)
        while space > 0 and (narrow := [column for column in block if widths[column] < natural[column]]):
            for column in narrow[:space]:
                widths[column] += 1
            space -= len(narrow)
        yield widths
        if not others:
            return


def _total(widths: Sequence[int], columns: Sequence[int]) -> int:
    return sum(widths[column] + PADDING for column in columns)


def three_digits(value: float) -> str:
    """Return a figure with three significant digits, without a power of ten."""
    if not math.isfinite(value):
        return "–"
    if abs(value) < LEAST:
        return "0" if value == 0 else f"< {LEAST:g}"
    places = 2 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):.{max(places, 0)}f}"


def percent(share: float) -> str:
    """Return a share in percent, with three significant digits."""
    return f"{three_digits(100 * share)} %"


def print_checks(title: str, checks: Sequence[Check], verbose: bool = False) -> None:
    """Print a line for each check: result, figure and bound; with `verbose` also its meaning."""
    console = terminal_console()
    table = new_table(title, "", "value", "bound")
    table.add_column("check", overflow="fold")
    for check in checks:
        look = "" if check.ok else "bold red"
        table.add_row(_verdict(check), check.value_text(), check.bound_text(), escape(check.name), style=look)
    print_table(table, labels=4)
    if verbose:
        for check in checks:
            console.print(f"\n[bold]{escape(check.name)}[/bold], {check.states} states")
            console.print(f"compares: {escape(check.compares)}")
            console.print(f"bound {check.bound_text()}: {escape(check.why)}")
    console.print(f"{len(checks) - len(broken(checks))} of {len(checks)} checks hold")
    if not verbose:
        console.print("--verbose explains each comparison and its bound.")


def _verdict(check: Check) -> str:
    if not check.ok:
        return "BROKEN"
    return "" if check.value is None or check.bound is None else "holds"
