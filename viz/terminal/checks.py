"""Measured figures against their bounds, as a table for people, on stdout."""

from __future__ import annotations

from collections.abc import Sequence

from rich.markup import escape

from spheretwin.models.base.check import Check, broken
from spheretwin.viz.terminal import style


def print_checks(title: str, checks: Sequence[Check], verbose: bool = False) -> None:
    """Print a line a check: whether it holds, figure and bound; at length also what each means."""
    console = style.console()
    table = style.table(title, "", "value", "bound")
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
        console.print("What each compares, and why its bound: --verbose.")


def _verdict(check: Check) -> str:
    if not check.ok:
        return "BROKEN"
    return "" if check.value is None or check.bound is None else "holds"
