"""For people, on stdout: what a tuning found, a table a law."""

from __future__ import annotations

from typing import Any

from rich.markup import escape

from spheretwin.viz.terminal import style

NONE = "–"
MOST = 15
"""Of a front that are printed, evenly along it; its table has all."""


def print_tuning(name: str, told: dict[str, Any]) -> None:
    """Print the best trial of each law, or its front, beside the gains that it started with."""
    console = style.console()
    for law, of_law in told["laws"].items():
        _print_law(f"{name}, {law}: {_counted(of_law)}", of_law)
        if len(of_law["best"]) > MOST:
            console.print(f"{MOST} of {len(of_law['best'])} on the front")
        if of_law["lost"]:
            console.print(f"lost first: {escape(of_law['lost'])}", soft_wrap=True)
        if len(of_law["best"]) == 1:
            console.print(escape(of_law["best"][0]["command"]), soft_wrap=True)
    console.print(f"table  {escape(told['table'])}", soft_wrap=True)


def _print_law(title: str, of_law: dict[str, Any]) -> None:
    chosen = [each for each in (of_law["start"], *of_law["best"]) if each]
    if not chosen:
        style.console().print(escape(f"{title}: none completed"), soft_wrap=True)
        return
    gains = list(chosen[0]["gains"])
    values = next((list(each["values"]) for each in chosen if each["values"]), [])
    is_fresh = any(each["fresh"] or each["fresh_reason"] for each in chosen)
    fresh = [f"{each}, fresh seeds" for each in values] if is_fresh else []
    table = style.table(title, "trial", *gains, *values, *fresh)
    rows = [("start", of_law["start"])] if of_law["start"] else []
    for label, each in rows + [(str(each["trial"]), each) for each in _some(of_law["best"])]:
        cells = ["off" if value is None else f"{value:.4g}" for value in map(each["gains"].get, gains)]
        cells += _cells(each["values"], values, each["ended"])
        cells += _cells(each["fresh"], values, "lost") if is_fresh else []
        table.add_row(label, *cells)
    style.console().print(table)


def _cells(found: dict[str, float] | None, names: list[str], otherwise: str) -> list[str]:
    return [f"{found[name]:.4g}" for name in names] if found else [otherwise if names else NONE] * len(names)


def _some(best: list[dict[str, Any]]) -> list[dict[str, Any]]:
    if len(best) <= MOST:
        return best
    return [best[round(place * (len(best) - 1) / (MOST - 1))] for place in range(MOST)]


def _counted(of_law: dict[str, Any]) -> str:
    ended = ", ".join(f"{count} {how}" for how, count in of_law["ended"].items() if count)
    return f"{ended or 'no trials'}; {of_law['rows']} rows"
