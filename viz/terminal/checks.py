"""Measured figures against their bounds, as a table for people, on stdout."""

from __future__ import annotations

from collections.abc import Sequence

from rich.markup import escape

from spheretwin.models.base.check import Check, broken
from spheretwin.viz.terminal import style

WIDTH_OF_REASONS = 120  # a narrower table would have more lines of reasons than of figures


def print_checks(title: str, checks: Sequence[Check]) -> None:
    """Print each figure beside its bound; in a wide terminal also what is compared, and why the bound."""
    console = style.console()
    reasons = console.width >= WIDTH_OF_REASONS
    table = style.table(title, "check", "states", "value", "bound", lines=reasons)
    table.columns[0].ratio = 5
    for column in table.columns[1:]:
        column.no_wrap = True
    if reasons:
        table.add_column("why the bound", ratio=4)
    for check in checks:
        name, compares = escape(check.name), f"\n[dim]{escape(check.compares)}[/dim]" if reasons else ""
        value = check.value_text() + ("" if check.ok else " BROKEN")
        cells = (name + compares, f"{check.states}", value, check.bound_text())
        table.add_row(*cells, *([escape(check.why)] if reasons else []), style="" if check.ok else "bold red")
    console.print(table)
    console.print(f"{len(checks) - len(broken(checks))} of {len(checks)} checks hold")
    if not reasons:
        console.print("What each compares, and why its bound: --json, or a wider terminal.")
