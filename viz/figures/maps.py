"""Figures of numbers by row and column: each in a square, coloured by value or by change."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import LogNorm, Normalize, SymLogNorm
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.design.capability import Capability
from spheretwin.models.design.workspace import Workspace
from spheretwin.viz.figures.style import FAINT, INK, SERIES, WIDTH_in, faint_grid, sheet
from spheretwin.viz.theme import law_colours, text_colour

ROW_in = 0.3
NEAR, FAR = 0.003, 0.1  # degrees: less change is hardly coloured, more has the full colour
TICKS = (-0.1, -0.03, -0.01, 0, 0.01, 0.03, 0.1)
MOST_SIDE_BY_SIDE = 5  # columns of panels that have room side by side
DARK = 0.36  # distance from the middle of the scale beyond which numbers are written in white


class HeatPanel(NamedTuple):
    """Numbers of one panel; NaN stays empty."""

    values: Array  # (rows, columns)
    changes: Array  # (rows, columns)


def heat(
    panels: Mapping[str, HeatPanel], rows: Sequence[str], columns: Sequence[str], title: str, change: str
) -> Figure:
    """Panels side by side, or one below the other where columns are many, on one scale of colours.

    Blue is less, red is more.

    Parameters
    ----------
    panels : mapping of title to Panel
    rows, columns : sequence of str
    title : str
    change : str
        Quantity of the colours, with its unit.
    """
    scale = SymLogNorm(linthresh=NEAR, vmin=-FAR, vmax=FAR)
    side_by_side = len(columns) <= MOST_SIDE_BY_SIDE
    down, across = (1, len(panels)) if side_by_side else (len(panels), 1)
    height_in = 1.8 + ROW_in * len(rows) * down
    share = {"sharex": not side_by_side, "sharey": side_by_side}
    figure, grid = sheet(height_in, down, across, title, 1.35 * WIDTH_in, **share)
    sides = grid.ravel()
    for axes, (name, panel) in zip(sides, panels.items(), strict=True):
        image = axes.imshow(np.clip(panel.changes, -FAR, FAR), norm=scale, cmap="RdBu_r", aspect="auto")
        _write_cells(axes, panel, scale)
        axes.set_xticks(range(len(columns)), columns, rotation=35, ha="right")
        axes.set_yticks(range(len(rows)), rows)
        axes.set_title(name, fontsize="medium")
        axes.tick_params(length=0)
        axes.spines[:].set_color(FAINT)
    bar = figure.colorbar(image, ax=list(sides), shrink=0.8, aspect=30, extend="both", label=change)
    bar.set_ticks(list(TICKS), labels=[f"{tick:+g}" if tick else "0" for tick in TICKS])
    bar.ax.minorticks_off()
    return figure


def _write_cells(axes: Axes, panel: HeatPanel, scale: SymLogNorm) -> None:
    for (row, column), value in np.ndenumerate(panel.values):
        if np.isfinite(value):
            change = panel.changes[row, column]
            away = abs(float(scale(np.clip(change, -FAR, FAR))) - 0.5) if np.isfinite(change) else 0.0
            axes.text(column, row, _text(value), ha="center", va="center", fontsize="small",
                      color="white" if away > DARK else CELL_INK)  # fmt: skip


def _text(value: float) -> str:
    return f"{value:.3f}" if value < 1 else f"{value:.2f}"


CELL_INK = "#101214"
"""Text on a light cell; a dark page inverts black text, which is outside of cells."""
CELL_in = 0.42
LIGHT = 0.55  # share of the scale beyond which numbers are written in black
MANY = 200.0  # beyond this ratio, ticks at whole powers of ten are enough
SEVERAL = 5.0  # ratio of largest to smallest from which on a scale is logarithmic
MOST_WRITTEN = 12  # rows or columns: in more, the numbers of the squares cannot be read


class MapPanel(NamedTuple):
    """Numbers of one law."""

    values: Array  # (rows, columns); NaN if no run was completed
    lost: NDArray[np.bool_]  # (rows, columns) where some runs did not


class StudyLine(NamedTuple):
    """Numbers of one law over one axis."""

    median: Array  # (n,)
    low: Array  # (n,)
    high: Array  # (n,)
    lost: NDArray[np.bool_]  # (n,) True if some runs were not completed


def maps(
    panels: Mapping[str, MapPanel],
    axes_names: tuple[str, str],
    labels: tuple[Sequence[str], Sequence[str]],
    quantity: str,
    title: str,
) -> Figure:
    """Draw squares, a panel for each law, on one scale of colours; crossed out if runs were not completed.

    Parameters
    ----------
    panels : mapping of law to Panel
    axes_names : two str
        Names of the rows and of the columns.
    labels : two sequences of str
        Values of the rows, and of the columns.
    quantity : str
        Name of the numbers.
    title : str
    """
    count, colours = len(panels), law_colours(list(panels))
    across, down = min(count, 3), -(-count // 3)
    cells = [min(len(names), MOST_WRITTEN) * CELL_in for names in labels]
    lost = any(np.any(panel.lost) for panel in panels.values())
    title = f"{title}\n× not all runs completed" if lost else title
    width_in, height_in = max(WIDTH_in, across * (cells[1] + 0.5) + 1.6), 1.5 + down * (cells[0] + 0.9)
    figure, grid = sheet(height_in, down, across, title, width_in, count, sharex=True, sharey=True)
    values = np.concatenate([panel.values.ravel() for panel in panels.values()])
    scale = _scale(values)
    for axes, (law, panel) in zip(grid.flat, panels.items(), strict=False):
        image = axes.imshow(panel.values, norm=scale, cmap="viridis", aspect="auto", origin="lower")
        _write_map_cells(axes, panel, scale)
        axes.set_xticks(*_ticks(labels[1]))
        axes.set_yticks(*_ticks(labels[0]))
        axes.set_title(law, fontsize="medium", color=text_colour(colours[law]), fontweight="bold")
        axes.set_facecolor("#eceef0")
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
    for axes in grid[:, 0]:
        axes.set_ylabel(axes_names[0])
    for axes in grid[-1]:
        axes.set_xlabel(axes_names[1])
    bar = figure.colorbar(image, ax=list(grid.flat), shrink=0.9, aspect=30, label=quantity)
    bar.outline.set_visible(False)
    if is_wide(values):
        _in_plain_numbers(bar.ax.yaxis, float(np.nanmax(values) / np.nanmin(values)))
    bar.ax.tick_params(labelsize="small")
    return figure


def lines(
    by_law: Mapping[str, StudyLine], x: Array | Sequence[str], axis_name: str, quantity: str, title: str
) -> Figure:
    """A line a law over one axis: the median of the repeats, their range a band, crosses where some are lost.

    Parameters
    ----------
    by_law : mapping of law to Line
    x : (n,) array, or names
    axis_name, quantity, title : str
    """
    figure, ((axes,),) = sheet(4.2, title=title)
    named, colours = not isinstance(x, np.ndarray), law_colours(list(by_law))
    places = np.arange(len(x)) if named else np.asarray(x)
    for law, line in by_law.items():
        colour = colours[law]
        axes.fill_between(places, line.low, line.high, color=colour, alpha=0.18, linewidth=0)
        axes.plot(places, line.median, "o-", color=colour, markersize=4, linewidth=1.3, label=law)
        axes.plot(places[line.lost], line.median[line.lost], "x", color=INK, markersize=9)
    if any(np.any(line.lost) for line in by_law.values()):
        axes.plot([], [], "x", color=INK, label="not all runs completed")
    if named:
        axes.set_xticks(places, list(x), rotation=20, ha="right")
    values = np.concatenate([line.median for line in by_law.values()])
    fit_scale(axes, "y", values)
    axes.set(xlabel=axis_name, ylabel=quantity)
    faint_grid(axes, 0.3, which="both")
    axes.legend(frameon=False)
    return figure


def is_wide(values: Array) -> bool:
    """True if a logarithmic scale suits some values better."""
    numbers = values[np.isfinite(values)]
    return bool(len(numbers)) and numbers.min() > 0 and numbers.max() > SEVERAL * numbers.min()


def fit_scale(axes: Axes, which: Literal["x", "y"], values: Array) -> None:
    """Make an axis logarithmic, in plain numbers, if that suits its values better."""
    if is_wide(values):
        (axes.set_yscale if which == "y" else axes.set_xscale)("log")
        numbers = values[np.isfinite(values)]
        _in_plain_numbers(axes.yaxis if which == "y" else axes.xaxis, numbers.max() / numbers.min())


def _in_plain_numbers(axis: Axis, ratio: float) -> None:
    """Set ticks of a logarithmic axis: 1, 2 and 5, or on a long axis whole powers of ten."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if ratio < MANY else (1,)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def _scale(values: Array) -> Normalize:
    numbers = values[np.isfinite(values)]
    low, high = (numbers.min(), numbers.max()) if len(numbers) else (0.0, 1.0)
    return LogNorm(low, high) if is_wide(values) else Normalize(low, high)


def _write_map_cells(axes: Axes, panel: MapPanel, scale: Normalize) -> None:
    written = max(panel.values.shape) <= MOST_WRITTEN
    for (row, column), value in np.ndenumerate(panel.values):
        if panel.lost[row, column]:
            axes.plot(column, row, "x", color=INK, markersize=11 if np.isnan(value) else 17, alpha=0.55,
                      markeredgewidth=1)  # fmt: skip
        if written and np.isfinite(value):
            light = float(scale(value)) > LIGHT
            text = f"{value:.2g}" if abs(value) < 100 else f"{value:.0f}"
            colour = CELL_INK if light else "white"
            axes.text(column, row, text, ha="center", va="center", fontsize="x-small", color=colour)


def _ticks(labels: Sequence[str]) -> tuple[list[int], list[str]]:
    """Places and labels of at most twelve of them."""
    step = -(-len(labels) // MOST_WRITTEN)
    places = list(range(0, len(labels), step))
    return places, [labels[place] for place in places]


def capability_map(workspace: Workspace, on_grid: Capability, limit_A: float) -> Figure:
    """Polar maps over the direction of tilt, each the worst over all spins.

    Parameters
    ----------
    workspace : Workspace
        The grid.
    on_grid : Capability
        Capability of its poses, in the grid's shape.
    limit_A : float, A
        Current limit, for the title.
    """
    title = (
        f"Worst direction and worst spin at {limit_A:g} A; radius: tilt of the shaft in degrees, angle: its"
    )
    title += " azimuth"
    figure, grid = sheet(1.2 * WIDTH_in, 2, 2, title, 1.25 * WIDTH_in, subplot_kw={"projection": "polar"})
    least_norm, best, singular_value = (
        _over_spin(workspace, values, np.min)
        for values in (on_grid.least_norm_Nm, on_grid.best_Nm, on_grid.singular_value_Nm_per_A)
    )
    condition = _over_spin(workspace, on_grid.condition, np.max)
    torque = Normalize(np.nanmin(least_norm), np.nanmax(best))  # one scale: the two are to be compared
    maps = (
        ("least-norm torque, N·m", least_norm, torque, "viridis"),
        ("torque by best currents, N·m", best, torque, "viridis"),
        ("least singular value, N·m/A", singular_value, None, "viridis"),
        ("condition number", condition, None, "viridis_r"),
    )
    for axes, (name, values, scale, colours) in zip(grid.flat, maps, strict=True):
        _polar(figure, axes, workspace, values, scale, name, colours)
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
    title = f"Torque capability at {limit_A:g} A a group"
    figure, ((torque,), (copper,)) = sheet(6.0, 2, title=title, sharex=True, height_ratios=[3, 2])
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
    _, middle, _ = _spread(workspace, on_grid.copper_W_per_Nm2)
    high = _at_all_tilts(workspace, worst["copper_W_per_Nm2"])
    copper.plot(tilt, high, color=INK, label="worst pose")
    copper.plot(tilt, middle, color=INK, linestyle=":", label="median")
    copper.set_yscale("log")
    copper.set(ylabel="copper loss, W/(N·m)²", xlabel="tilt of the shaft, degrees")
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
