"""Style and width of all tables."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from spheretwin.models.base.checks import Check, broken

WIDTH_WITHOUT_TERMINAL = 100
LEAST = 1e-3
"""Smaller figures are written as less than this: they are negligible."""


def terminal_console() -> Console:
    """Return a console for stdout: as wide as the terminal; in a pipe or a file of a readable width."""
    console = Console()
    if console.is_terminal or "COLUMNS" in os.environ:
        return console
    return Console(width=WIDTH_WITHOUT_TERMINAL)


def new_table(title: str, first: str, *others: str, lines: bool = False) -> Table:
    """Return a table with a title: labels in the left column, figures in the others.

    Without a terminal it is Markdown.

    Parameters
    ----------
    title, first, others : str
        As they are, without markup; headings of the columns.
    lines : bool
        Whether to separate the rows, if they have several lines each.
    """
    console = terminal_console()
    table = Table(
        title=escape(title),
        title_justify="left",
        box=box.HORIZONTALS if console.is_terminal else box.MARKDOWN,
        pad_edge=not console.is_terminal,
        show_lines=lines and console.is_terminal,
        min_width=min(cell_len(title), console.width),  # a title is wrapped to its table
    )
    table.add_column(escape(first), overflow="fold")
    for heading in others:
        table.add_column(escape(heading), justify="right")
    return table


def three_digits(value: float) -> str:
    """Return a figure with three significant digits, without a power of ten."""
    if not math.isfinite(value):
        return "–"
    if abs(value) < LEAST:
        return "0" if value == 0 else f"< {LEAST:g}"
    places = 2 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):.{max(places, 0)}f}"


def print_checks(title: str, checks: Sequence[Check], verbose: bool = False) -> None:
    """Print a line for each check: result, figure and bound; with `verbose` also its meaning."""
    console = terminal_console()
    table = new_table(title, "", "value", "bound")
    table.add_column("check")
    for column in table.columns[:3]:
        column.no_wrap = True
    for check in checks:
        look = "" if check.ok else "bold red"
        table.add_row(_verdict(check), check.value_text(), check.bound_text(), escape(check.name), style=look)
    console.print(table)
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
