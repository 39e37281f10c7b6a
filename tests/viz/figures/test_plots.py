"""Figures: what they show is drawn, named and in the right unit."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from spheretwin.models.base.errors import InputError
from spheretwin.viz.figures import crosscheck, style
from spheretwin.viz.theme import AXIS_COLOURS

T = np.linspace(0, 1, 50)
THREE = np.stack([np.sin(T), np.cos(T), T], axis=1)


def bounded(bound=1e-3):
    return crosscheck.Bounded(1e-6 * (1 + T), bound)


FIGURES = {
    "margins": lambda: crosscheck.margins({"one": 0.5, "two": 2.0, "three": 0.0, "four": np.inf}, "margins"),
    "spreads": lambda: crosscheck.spreads({"engine": {"M": 1e-13 * T}}, {"M": 1e-12}, "spreads"),
    "motion": lambda: crosscheck.motion(T, THREE, 1e-12 * THREE, 1e-8, "motion"),
    "convergence": lambda: crosscheck.convergence(
        {"RK4": crosscheck.Slope(T[1:6], T[1:6] ** 4, 4.0)}, "order"
    ),
    "drifts": lambda: crosscheck.drifts(
        T, {"energy, relative": {"2π": bounded(), "30": bounded(None)}}, "drift"
    ),
    "closed_loops": lambda: crosscheck.closed_loops(
        T,
        {"PD": (THREE, THREE[:30])},
        {"PD": crosscheck.Bounded(1e-9 * T[:30], 1e-8)},
        ("one", "other"),
        "loops",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    "name", [name for name in FIGURES if name not in ("margins", "spreads", "convergence")]
)
def test_every_value_axis_has_a_unit(name):
    for axes in FIGURES[name]().axes:
        assert axes.get_ylabel().endswith((", rad", ", relative"))


@pytest.mark.parametrize("name", [name for name in FIGURES if name != "convergence"])
def test_bound_is_drawn_as_a_dashed_line(name):
    lines = [line for axes in FIGURES[name]().axes for line in axes.get_lines()]
    assert any(line.get_linestyle() == "--" and "bound" in str(line.get_label()) for line in lines)


def test_axes_have_the_colours_of_the_recordings():
    tilt, spin, _ = FIGURES["motion"]().axes
    drawn = [line.get_color() for line in (*tilt.get_lines(), *spin.get_lines())]
    assert drawn == [to_hex(np.array(colour) / 255) for colour in AXIS_COLOURS]


def test_a_broken_bound_stands_out():
    colours = {line.get_label(): line.get_color() for line in FIGURES["margins"]().axes[0].get_lines()}
    assert colours["exceeds the bound"] == style.BROKEN != colours["within the bound"]


def test_a_figure_that_cannot_be_written_is_bad_input(tmp_path):
    with pytest.raises(InputError, match="writable path"):
        style.save(FIGURES["margins"](), tmp_path / "missing" / "figure.png")
