"""Figures of the torque capability: polar maps over the shaft's tilt, and curves against it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from numpy.typing import NDArray

from spheretwin.models.design.capability import Capability
from spheretwin.models.design.workspace import Workspace
from spheretwin.viz.figures.style import (
    INK,
    SERIES,
    WIDTH_in,
)

Array = NDArray[np.float64]


def capability_map(workspace: Workspace, on_grid: Capability, limit_A: float) -> Figure:
    """Polar maps over the direction of tilt, each the worst over all spins.

    Parameters
    ----------
    workspace : Workspace
        The grid.
    on_grid : Capability
        Capability of its poses, in the grid's shape.
    limit_A : float, A
        Current limit, for the titles.
    """
    figure = Figure(figsize=(1.25 * WIDTH_in, 1.2 * WIDTH_in), layout="constrained")
    least_norm, best, singular_value = (
        _over_spin(workspace, values, np.min)
        for values in (on_grid.least_norm_Nm, on_grid.best_Nm, on_grid.singular_value_Nm_per_A)
    )
    condition = _over_spin(workspace, on_grid.condition, np.max)
    torque = Normalize(np.nanmin(least_norm), np.nanmax(best))  # one scale: the two are to be compared
    maps = (
        (f"least-norm torque at {limit_A:g} A, N·m", least_norm, torque, "viridis"),
        (f"torque by the best currents at {limit_A:g} A, N·m", best, torque, "viridis"),
        ("least singular value σ, N·m/A", singular_value, None, "viridis"),
        ("condition number", condition, None, "viridis_r"),
    )
    grid = figure.subplots(2, 2, subplot_kw={"projection": "polar"})
    for axes, (title, values, scale, colours) in zip(grid.flat, maps, strict=True):
        _polar(figure, axes, workspace, values, scale, title, colours)
    figure.suptitle(
        "Worst direction and worst spin on the grid; radius: tilt of the shaft, angle: its azimuth"
    )
    return figure


def capability_by_tilt(
    workspace: Workspace, on_grid: Capability, worst: Mapping[str, Array], limit_A: float
) -> Figure:
    """Torque and copper loss against tilt: worst pose, median, and best pose.

    Parameters
    ----------
    workspace, on_grid, limit_A
        As in `capability_map`.
    worst : mapping of str to (t,) array
        Worst figures at each reachable tilt, searched between the grid's poses: ``least_norm_Nm``,
        ``best_Nm`` and ``copper_W_per_Nm2``.
    """
    figure = Figure(figsize=(WIDTH_in, 6.0), layout="constrained")
    torque, copper = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    tilt = np.degrees(workspace.tilt_rad)
    series = (("best currents", "best_Nm"), ("least-norm currents", "least_norm_Nm"))
    for colour, (name, figure_of_merit) in zip(SERIES, series, strict=False):
        _, middle, high = _spread(workspace, getattr(on_grid, figure_of_merit))
        low = _at_all_tilts(workspace, worst[figure_of_merit])
        torque.fill_between(tilt, low, high, color=colour, alpha=0.2, linewidth=0, label=f"{name}: all poses")
        torque.plot(tilt, low, color=colour, label=f"{name}: worst pose")
        torque.plot(tilt, middle, color=colour, linestyle=":", label=f"{name}: median")
    torque.set_ylim(bottom=0.0)
    torque.set_ylabel("torque in every direction, N·m")
    torque.set_title(f"Torque capability at {limit_A:g} A a group", loc="left")
    _, middle, _ = _spread(workspace, on_grid.copper_W_per_Nm2)
    high = _at_all_tilts(workspace, worst["copper_W_per_Nm2"])
    copper.plot(tilt, high, color=INK, label="worst pose")
    copper.plot(tilt, middle, color=INK, linestyle=":", label="median")
    copper.set_yscale("log")
    copper.set_ylabel("copper loss, W/(N·m)²")
    copper.set_xlabel("tilt of the shaft, degrees")
    for axes in (torque, copper):
        axes.grid(alpha=0.3)
        axes.legend()
        axes.margins(x=0.0)
    return figure


def _polar(
    figure: Figure,
    axes: PolarAxes,
    workspace: Workspace,
    values: Array,
    scale: Normalize | None,
    title: str,
    colours: str,
) -> None:
    azimuth = np.append(workspace.azimuth_rad, 2 * np.pi)
    closed = np.column_stack([values, values[:, :1]])  # (t, a + 1)
    mesh = axes.pcolormesh(
        azimuth,
        np.degrees(workspace.tilt_rad),
        closed,
        shading="gouraud",
        cmap=colours,
        norm=scale,
        rasterized=True,
    )
    figure.colorbar(mesh, ax=axes, shrink=0.8, pad=0.09)
    axes.set_title(title)
    axes.set_rlabel_position(15)
    axes.tick_params(axis="y", colors="white")
    axes.grid(alpha=0.3, color="white")


def _at_all_tilts(workspace: Workspace, values: Array) -> Array:
    """(t,) values of the reachable tilts, NaN at the others."""
    everywhere = np.full(len(workspace.tilt_rad), np.nan)
    everywhere[workspace.reachable.any(axis=(1, 2))] = values
    return everywhere


def _over_spin(workspace: Workspace, values: Array, worst: Callable[..., Array]) -> Array:
    """Return (t, a) worst finite values over the reachable spins; NaN if there are none."""
    usable = workspace.reachable & np.isfinite(values)
    start = np.inf if worst is np.min else -np.inf
    result = worst(values, axis=2, where=usable, initial=start)
    return np.where(usable.any(axis=2), result, np.nan)


def _spread(workspace: Workspace, values: Array) -> tuple[Array, Array, Array]:
    """Smallest, middle and largest value at each tilt."""
    rows = []
    for value, reachable in zip(values, workspace.reachable, strict=True):
        here = value[reachable & np.isfinite(value)]
        rows.append(np.quantile(here, [0.0, 0.5, 1.0]) if len(here) else np.full(3, np.nan))
    low, middle, high = np.array(rows).T
    return low, middle, high
