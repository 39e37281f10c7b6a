"""Results of studies and tunings as tables, on stdout."""

from __future__ import annotations

from typing import Any

from rich.markup import escape

from spheretwin.viz.terminal import tables


def print_study(name: str, result: dict[str, Any], summary: dict[str, Any]) -> None:
    """Print the results of a study: median and 95 % range of each figure, rows by status, for each law."""
    figures = [figure for figure in next(iter(summary.values()), {}) if figure != "statuses"]
    table = tables.new_table(
        f"{name}: {result['rows']} of {result['of']} rows", "median (95 % range)", *summary
    )
    for figure in figures:
        table.add_row(figure, *(_spread(of_law[figure]) for of_law in summary.values()))
    counts = [of_law["statuses"] for of_law in summary.values()]
    for status in sorted({status for statuses in counts for status in statuses}):
        table.add_row(status, *(str(statuses.get(status, 0)) for statuses in counts))
    tables.print_table(table)
    if result["startup_s"] is not None:
        tables.terminal_console().print(
            f"took   {result['wall_s']:.1f} s, {result['startup_s']:.1f} s of it to start"
        )
    tables.terminal_console().print(f"table  {escape(result['table'])}", soft_wrap=True)


def _spread(figure: dict[str, Any]) -> str:
    if figure["median"] is None:
        return "–"
    low, high = figure["range_95"]
    return f"{figure['median']:.4g} ({low:.4g} to {high:.4g})"


NONE = "–"
MOST = 15
"""Trials of a front that are printed, evenly along it; the table has all."""


def print_tuning(name: str, result: dict[str, Any]) -> None:
    """Print the best trial of each law, or its front, with the gains at the start."""
    console = tables.terminal_console()
    for law, of_law in result["laws"].items():
        _print_law(f"{name}, {law}: {_counted(of_law)}", of_law)
        if len(of_law["best"]) > MOST:
            console.print(f"{MOST} of {len(of_law['best'])} on the front")
        if of_law["lost"]:
            console.print(f"lost first: {escape(of_law['lost'])}", soft_wrap=True)
        if len(of_law["best"]) == 1:
            console.print(escape(of_law["best"][0]["command"]), soft_wrap=True)
    console.print(f"table  {escape(result['table'])}", soft_wrap=True)


def _print_law(title: str, of_law: dict[str, Any]) -> None:
    chosen = [trial for trial in (of_law["start"], *of_law["best"]) if trial]
    if not chosen:
        tables.terminal_console().print(escape(f"{title}: none completed"), soft_wrap=True)
        return
    gains = list(chosen[0]["gains"])
    values = next((list(trial["values"]) for trial in chosen if trial["values"]), [])
    is_fresh = any(trial["fresh"] or trial["fresh_reason"] for trial in chosen)
    fresh = [f"{name}, fresh seeds" for name in values] if is_fresh else []
    table = tables.new_table(title, "trial", *gains, *values, *fresh)
    rows = [("start", of_law["start"])] if of_law["start"] else []
    for label, trial in rows + [(str(trial["trial"]), trial) for trial in _some(of_law["best"])]:
        cells = ["off" if value is None else f"{value:.4g}" for value in map(trial["gains"].get, gains)]
        cells += _cells(trial["values"], values, trial["ended"])
        cells += _cells(trial["fresh"], values, "lost") if is_fresh else []
        table.add_row(label, *cells)
    tables.print_table(table)


def _cells(figures: dict[str, float] | None, names: list[str], otherwise: str) -> list[str]:
    return (
        [f"{figures[name]:.4g}" for name in names] if figures else [otherwise if names else NONE] * len(names)
    )


def _some(best: list[dict[str, Any]]) -> list[dict[str, Any]]:
    if len(best) <= MOST:
        return best
    return [best[round(place * (len(best) - 1) / (MOST - 1))] for place in range(MOST)]


def _counted(of_law: dict[str, Any]) -> str:
    ended = ", ".join(f"{count} {how}" for how, count in of_law["ended"].items() if count)
    return f"{ended or 'no trials'}; {of_law['rows']} rows"
