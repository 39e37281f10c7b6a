"""The magnetic model's figures as tables for people, on stdout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

# A table row for every third tilt: one screen.
ROW_STRIDE = 3

FIGURE_NAMES = {
    "least_norm": ("least norm", "least_norm_Nm", "N·m"),
    "best": ("best", "best_Nm", "N·m"),
    "singular_value": ("least σ", "singular_value_Nm_per_A", "N·m/A"),
}


def print_curve(title: str, rows: Sequence[tuple[str, str]]) -> None:
    """Print what is known of a torque curve."""
    table = Table(title=escape(title), title_justify="left", show_header=False, min_width=60)
    for row in rows:
        table.add_row(*map(escape, row))
    Console().print(table)


def print_field_check(figures: Mapping[str, Any]) -> None:
    """Print the errors of the torque matrix by tilt, and where they come from."""
    console = Console()
    title = (
        f"torque by the curve against the direct sum (largest torque {figures['largest_torque_Nm']:.3f} N·m)"
    )
    table = _table(title, "tilt", "poses", "median error", "largest", "of largest torque", "half the points")
    for row in figures["by_tilt"]:
        low, high = row["tilt_deg"]
        table.add_row(
            f"{low:.0f}° to {high:.0f}°",
            str(row["poses"]),
            _percent(row["median_relative_error"]),
            _percent(row["largest_relative_error"]),
            _percent(row["largest_error_of_largest_torque"]),
            _percent(row["quadrature_of_largest_torque"]),
        )
    console.print(table)
    source = figures["sources"]
    console.print(
        "Where it comes from: the direct sum's quadrature"
        f" (half the points change it by {source['quadrature_of_largest_torque']:.0e} of the largest torque);"
        f" the curve between its samples ({source['curve_between_samples_of_peak']:.0e} of its peak);"
        f" the look-up table ({source['lookup_of_peak']:.0e} of the peak)."
    )


def print_map(figures: Mapping[str, Any]) -> None:
    """Print the torque capability by tilt, and the weakest poses."""
    console = Console()
    limit, poses = figures["current_limit_A"], figures["poses"]
    table = _table(
        f"torque in every direction at {limit:g} A, N·m: worst and median of {poses} poses",
        "tilt",
        "least norm",
        "median",
        "best currents",
        "median",
        "least σ, N·m/A",
        "cond.",
        "copper, W/(N·m)²",
    )
    rows = figures["by_tilt"]
    for i, row in enumerate(rows):
        if i % ROW_STRIDE == 0 or i == len(rows) - 1:
            table.add_row(
                f"{row['tilt_deg']:g}°",
                f"{row['least_norm_Nm']:.3f}",
                f"{row['least_norm_median_Nm']:.3f}",
                f"{row['best_Nm']:.3f}",
                f"{row['best_median_Nm']:.3f}",
                f"{row['singular_value_Nm_per_A']:.4f}",
                f"{row['condition']:.2f}",
                f"{row['copper_W_per_Nm2']:.0f}",
            )
    console.print(table)
    weak = _table("weakest poses", "by", "worst", "tilt, °", "α, °", "β, °", "γ, °", "direction")
    for row in figures["weakest"]:
        name, key, unit = FIGURE_NAMES[row["figure"]]
        angles = (_tenths(angle) for angle in (row["tilt_deg"], *row["q_deg"]))
        weak.add_row(name, f"{row[key]:.3g} {unit}", *angles, direction_text(row["direction"]))
    console.print(weak)


def print_checks(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print measured figures against their bounds."""
    table = Table(title="checks", title_justify="left")
    for heading in ("check", "value", "bound", "", "why"):
        table.add_column(heading, overflow="fold")
    for row in rows:
        bounded = row["bound"] is not None
        table.add_row(
            row["name"],
            "not finite" if row["value"] is None else f"{row['value']:.2g}",
            f"{row['bound']:g}" if bounded else "",
            ("[green]ok[/]" if row["ok"] else "[red]broken[/]") if bounded else "",
            escape(row["why"]),
        )
    Console().print(table)


def print_files(paths: Sequence[Path]) -> None:
    """Print where files were written."""
    for path in paths:
        Console().print(f"written  {escape(str(path))}", soft_wrap=True)


def pose_text(q_deg: Sequence[float]) -> str:
    """A pose in a line."""
    return ", ".join(f"{name} {_tenths(angle)}°" for name, angle in zip("αβγ", q_deg, strict=True))


def direction_text(direction: Sequence[float]) -> str:
    """A unit vector in a line."""
    return " ".join(f"{round(part, 2) + 0.0:.2f}" for part in direction)


def _table(title: str, first: str, *others: str) -> Table:
    table = Table(title=escape(title), title_justify="left")
    table.add_column(first)
    for heading in others:
        table.add_column(heading, justify="right")
    return table


def _tenths(value: float) -> str:
    return f"{round(value, 1) + 0.0:.1f}"  # no negative zero


def _percent(share: float) -> str:
    return f"{100 * share:.3f} %"
