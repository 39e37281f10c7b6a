"""A matplotlib figure as text: axes with scales, limits, ticks and labels, and every artist with its data."""

import contextlib
from collections.abc import Iterator
from unittest.mock import patch

import numpy as np
from matplotlib import collections, image, lines, patches, text
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from mpl_toolkits.mplot3d import art3d

from spheretwin.viz.figures import style
from tests.content.values import array, number, words


def figure_text(figure: Figure) -> str:
    """Return all that a figure shows."""
    size = " × ".join(map(number, figure.get_size_inches()))
    out = [f"figure {size} in, title {figure.get_suptitle()!r}"]
    out += [f"  text {_text(each)}" for each in figure.texts if each is not figure._suptitle]
    out += [f"  {line}" for legend in figure.legends for line in _legend(legend)]
    for axes in figure.axes:
        out += _axes(axes)
    return "\n".join(out)


@contextlib.contextmanager
def captured() -> Iterator[dict[str, str]]:
    """Yield the texts of the figures that are saved meanwhile, by the name of their file."""
    texts: dict[str, str] = {}

    def capture(figure: Figure, path, title: str = "") -> None:
        if path.name not in texts:
            texts[path.name] = f"title of the file: {title!r}\n{figure_text(figure)}"
        path.write_text("<svg></svg>", encoding="utf-8")

    with patch.object(style, "save", capture):
        yield texts


def _axes(axes: Axes) -> list[str]:
    place = axes.get_subplotspec()
    where = ""
    if place is not None:
        grid = place.get_gridspec()
        ratios = [each for each in (grid.get_height_ratios(), grid.get_width_ratios()) if len(set(each)) > 1]
        rows, columns = place.rowspan, place.colspan
        where = f" rows {rows.start}-{rows.stop} columns {columns.start}-{columns.stop}"
        where += f" of {grid.nrows}×{grid.ncols}" + "".join(
            f" ratios {list(map(float, each))}" for each in ratios
        )
    hidden = "" if axes.get_visible() and axes.axison else " hidden"
    titles = [axes.get_title(loc) for loc in ("left", "center", "right")]
    spines = [
        f"{name} {_colour(spine.get_edgecolor())} {number(spine.get_linewidth())}"
        for name, spine in axes.spines.items()
        if spine.get_visible()
    ]
    frame = f"below {axes.get_axisbelow()} aspect {axes.get_aspect()} spines {', '.join(spines)}"
    frame += f" face {_colour(axes.get_facecolor())}"
    if bar := getattr(axes, "_colorbar", None):
        shape = {
            name: value for name, value in axes._colorbar_info.items() if name in ("shrink", "aspect", "pad")
        }
        frame += f" colour bar {bar.orientation} extend {bar.extend} {shape}"
    out = [f"axes {axes.name}{hidden}{where} title {titles!r} {_look(axes.title)} {frame}"]
    for name, axis in axes._axis_map.items():
        out += _axis(name, axis, getattr(axes, f"get_{name}lim")())
    shared = [name for name in "xy" if len(getattr(axes, f"get_shared_{name}_axes")().get_siblings(axes)) > 1]
    out += [f"  shared {' '.join(shared)}"] if shared else []
    own = {axes.title, axes._left_title, axes._right_title, axes.patch, *axes.spines.values()}
    own |= set(axes._axis_map.values())
    for artist in axes.get_children():
        if artist not in own and artist is not axes.legend_:
            out += [f"  {line}" for line in _artist(artist)]
    if axes.legend_:
        out += [f"  {line}" for line in _legend(axes.legend_)]
    return out


def _axis(name: str, axis: Axis, limits) -> list[str]:
    axis.get_majorticklocs()
    low, high = sorted(limits)
    ticks = [place for place in axis.get_majorticklocs() if low <= place <= high]
    formatter = axis.get_major_formatter()
    labels = formatter.format_ticks(axis.get_majorticklocs())
    shown = [
        label for label, place in zip(labels, axis.get_majorticklocs(), strict=True) if low <= place <= high
    ]
    minor = len([place for place in axis.get_minorticklocs() if low <= place <= high])
    minor_labels = [
        label for label in axis.get_minor_formatter().format_ticks(axis.get_minorticklocs()) if label
    ]
    on = axis.get_tick_params()
    looks = sorted((name, value) for name, value in on.items() if name[:5] != "label" and name != "gridOn")
    looks.append(("labelsize", on.get("labelsize", "")))
    drawn = [side for side in ("labelleft", "labelbottom", "labelright", "labeltop") if on.get(side)]
    grid = ""
    if on.get("gridOn"):
        (line, *_) = [*axis.get_gridlines(), None]
        grid = f" grid {_colour(line.get_color())} {_dash(line)}{_common(line)}" if line else " grid"
    rotation = {label.get_rotation() for label in axis.get_majorticklabels()}
    turned = f" rotation {sorted(rotation)}" if rotation - {0.0} else ""
    small = f" minor labels {words(minor_labels)}" if minor_labels else ""
    head = f"  {name}: label {axis.get_label_text()!r} scale {axis.get_scale()} limits {array(limits)}"
    ticks_text = f"ticks {array(np.array(ticks))} {words(shown)} minor {minor}{small}{grid}{turned} {looks}"
    return [f"{head} {ticks_text} {' '.join(drawn)}"]


def _artist(artist) -> list[str]:
    if isinstance(artist, lines.Line2D):
        return [_line(artist)]
    if isinstance(artist, text.Text):
        return [f"text {_text(artist)}"] if artist.get_text() else []
    if isinstance(artist, collections.Collection):
        return [_collection(artist)]
    if isinstance(artist, image._ImageBase):
        origin, extent = artist.origin, artist.get_extent()
        look = f"origin {origin} interpolation {artist.get_interpolation()} {_mapped(artist)}"
        return [f"image extent {array(np.array(extent))} {look}{_common(artist)}"]
    if isinstance(artist, patches.Patch):
        return [_patch(artist)]
    if isinstance(artist, Legend):
        return _legend(artist)
    if isinstance(artist, Axes):
        return [f"inset {line}" for line in _axes(artist)]
    return [f"{type(artist).__name__}{_common(artist)}"]


def _line(line: lines.Line2D) -> str:
    data = line.get_data_3d() if isinstance(line, art3d.Line3D) else (line.get_xdata(), line.get_ydata())
    marker = line.get_marker()
    look = f"{_colour(line.get_color())} {_dash(line)} width {number(line.get_linewidth())}"
    if marker not in ("None", None, "", " "):
        size = f"{number(line.get_markersize())} edge {number(line.get_markeredgewidth())}"
        colours = f"{_colour(line.get_markerfacecolor())} {_colour(line.get_markeredgecolor())}"
        look += f" marker {marker} {size} {colours} every {line.get_markevery()}"
    if line.get_drawstyle() != "default":
        look += f" {line.get_drawstyle()}"
    arrays = " ".join(
        f"{name} {array(np.asarray(values))}" for name, values in zip("xyz", data, strict=False)
    )
    return f"line {look}{_common(line)} {arrays}"


def _dash(line: lines.Line2D) -> str:
    offset, pattern = line._unscaled_dash_pattern
    style_name = line.get_linestyle()
    return (
        style_name
        if style_name == "None" or pattern is None
        else f"dash {number(offset)} {list(map(float, pattern))}"
    )


def _collection(these: collections.Collection) -> str:
    colours = f"face {_colours(these.get_facecolor())} edge {_colours(these.get_edgecolor())}"
    widths = f"width {array(np.asarray(these.get_linewidth()))}"
    kind = type(these).__name__
    if isinstance(these, collections.QuadMesh):
        corners = these.get_coordinates()
        return (
            f"{kind} x {array(corners[..., 0])} y {array(corners[..., 1])} {_mapped(these)}{_common(these)}"
        )
    paths = these.get_paths()
    vertices = np.concatenate([path.vertices for path in paths]) if paths else np.empty((0, 2))
    x, y = vertices.T
    text_ = f"{kind} {colours} {widths} paths {len(paths)} vertices x {array(x)} y {array(y)}"
    offsets = these.get_offsets()
    if len(offsets) and np.any(offsets):
        text_ += f" at x {array(offsets[:, 0])} y {array(offsets[:, 1])}"
    if hasattr(these, "get_sizes"):
        text_ += f" sizes {array(these.get_sizes())}"
    dashes = [
        f"{float(offset)} {pattern and list(map(float, pattern))}"
        for offset, pattern in these.get_linestyle()
    ]
    text_ += f" dashes {sorted(set(dashes))}" if set(dashes) != {"0.0 None"} else ""
    if hasattr(these, "_offsets3d"):
        text_ += " space " + " ".join(array(np.asarray(each)) for each in these._offsets3d)
    return text_ + (f" {_mapped(these)}" if these.get_array() is not None else "") + _common(these)


def _patch(patch: patches.Patch) -> str:
    if isinstance(patch, patches.Rectangle):
        place = (
            f"{array(np.array(patch.get_xy()))} {number(patch.get_width())} × {number(patch.get_height())}"
        )
    else:
        vertices = patch.get_path().vertices
        place = f"x {array(vertices[:, 0])} y {array(vertices[:, 1])}"
    look = f"face {_colour(patch.get_facecolor())} edge {_colour(patch.get_edgecolor())}"
    look += f" {patch.get_linestyle()} {number(patch.get_linewidth())}"
    return f"{type(patch).__name__} {place} {look}{_common(patch)}"


def _mapped(mapped) -> str:
    norm = mapped.norm
    bounds = f"{type(norm).__name__} {number(norm.vmin)} to {number(norm.vmax)}"
    return f"colours {mapped.get_cmap().name} {bounds} values {array(np.ma.asarray(mapped.get_array()))}"


def _legend(legend: Legend) -> list[str]:
    place = f"columns {legend._ncols} at {legend._get_loc()} {legend._outside_loc}"
    sizes = {text.get_fontsize() for text in legend.get_texts()}
    place += f" frame {legend.get_frame_on()} handles {number(legend.handlelength)} texts {sorted(sizes)} pt"
    out = [f"legend title {legend.get_title().get_text()!r} {place}"]
    for label, handle in zip(legend.get_texts(), legend.legend_handles, strict=True):
        look = _artist(handle)[0].partition(" x [")[0].partition(" x n=")[0] if handle is not None else ""
        out.append(f"  {label.get_text()!r}: {look}")
    return out


def _text(artist: text.Text) -> str:
    extra = ""
    if isinstance(artist, text.Annotation):
        extra = f" of {array(np.array(artist.xy, float))} in {artist.xycoords}"
    align = f"{artist.get_ha()} {artist.get_va()}"
    place = array(np.array(artist.get_position(), float))
    return f"{artist.get_text()!r} at {place}{extra} {align} {_look(artist)}"


def _look(artist: text.Text) -> str:
    turned = f" rotated {number(artist.get_rotation())}" if artist.get_rotation() else ""
    bold = "" if artist.get_weight() in ("normal", 400) else f" {artist.get_weight()}"
    return f"{_colour(artist.get_color())} {number(float(artist.get_fontsize()))} pt{bold}{turned}"


def _common(artist) -> str:
    label = artist.get_label()
    named = f" label {label!r}" if label and not str(label).startswith("_") else ""
    hidden = "" if artist.get_visible() else " hidden"
    alpha = artist.get_alpha()
    faint = "" if alpha is None else f" alpha {array(alpha) if np.ndim(alpha) else number(float(alpha))}"
    beyond = "" if artist.get_clip_on() else " unclipped"
    effects = f" effects {len(artist.get_path_effects())}" if artist.get_path_effects() else ""
    pixels = " rasterized" if artist.get_rasterized() else ""
    return f"{named} z {number(artist.get_zorder())}{faint}{hidden}{beyond}{effects}{pixels}"


def _colour(colour) -> str:
    return (
        colour if isinstance(colour, str) and colour in ("none", "auto") else to_hex(colour, keep_alpha=True)
    )


def _colours(colours) -> str:
    distinct = (
        [to_hex(colour, keep_alpha=True) for colour in np.unique(colours, axis=0)] if len(colours) else []
    )
    return (
        f"{' '.join(distinct) or 'none'}"
        if len(distinct) <= 1
        else words([_colour(each) for each in colours])
    )
