"""What benchmarks share: sides measured in turn, and rows that are told with their bounds."""

import argparse
import json
import time
from collections.abc import Callable
from typing import Any


def fastest(measures: dict[str, Callable[[], float]], rounds: int) -> dict[str, float]:
    """Least time of each measure over several rounds in turn, s; a first round warms up."""
    taken = {name: [] for name in measures}
    for turn in range(rounds + 1):
        for name, measure in measures.items():
            seconds = measure()
            if turn:
                taken[name].append(seconds)
    return {name: min(seconds) for name, seconds in taken.items()}


def seconds_of(work: Callable[[], object]) -> float:
    """Time of some work, s."""
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def ratio(
    name: str,
    numerator_s: float,
    denominator_s: float,
    at_most: float | None = None,
    at_least: float | None = None,
) -> dict[str, Any]:
    """Row of a ratio: name, value, bound (None: reported only) and the two sides in s."""
    value = numerator_s / denominator_s
    ok = (at_most is None or value <= at_most) and (at_least is None or value >= at_least)
    sides = {"numerator_s": numerator_s, "denominator_s": denominator_s}
    return {"name": name, "value": value, "at_most": at_most, "at_least": at_least, "ok": ok, **sides}


def options_of(document: str) -> argparse.Namespace:
    """Return the options of a benchmark with its documentation: results as text or as JSON."""
    parser = argparse.ArgumentParser(description=document.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    return parser.parse_args()


def report(rows: list[dict[str, Any]], as_json: bool, **others: object) -> bool:
    """Print rows of ratios, in JSON with other results; return True if each keeps its bound."""
    if as_json:
        print(json.dumps({**others, "ratios": rows}))
    else:
        for row in rows:
            tell(row)
    return all(row["ok"] for row in rows)


def tell(row: dict[str, Any]) -> None:
    """Print a row of a ratio."""
    sides = f"{1e6 * row['numerator_s']:.4g} / {1e6 * row['denominator_s']:.4g} µs"
    tell_value(f"{row['value']:.2f}", bound_of(row), f"{row['name']} ({sides})", row["ok"])


def tell_value(value: str, bound: str, name: str, ok: bool) -> None:
    """Print a figure beside its bound."""
    print(f"{value:>8}  {bound:>8}  {name}{'' if ok else '  MISSED'}", flush=True)


def bound_of(row: dict[str, Any]) -> str:
    """Bound of a row in words."""
    if row["at_most"] is not None:
        return f"<= {row['at_most']}"
    return "reported" if row["at_least"] is None else f">= {row['at_least']}"
