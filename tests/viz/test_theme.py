"""Colours: contrast on every ground, difference for every reader, and names that are true.

Luminance, contrast, CIELAB and the simulation of colour blindness are implemented here once more.
"""

import math
import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from spheretwin.control.laws import LAWS as CONTROL_LAWS
from spheretwin.viz import theme
from spheretwin.viz.figures import style

GROUNDS = {"viewer, dark": (13, 13, 13), "viewer, light": (255, 255, 255), "page, dark": (0x15, 0x18, 0x1C)}

# Machado, Oliveira and Fernandes (2009), severity 1.0, on linear red, green and blue.
VISION = {
    "normal": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}

BODIES = ("NORTH", "SOUTH")
"""Surfaces of 3D views, which lights shade."""


def linear(colour):
    return [c / 255 / 12.92 if c / 255 <= 0.04045 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in colour]


def contrast(colour, ground):
    """Contrast ratio of WCAG 2."""
    low, high = sorted(np.dot((0.2126, 0.7152, 0.0722), linear(each)) for each in (colour, ground))
    return (high + 0.05) / (low + 0.05)


def cielab(shares):
    """CIELAB of linear red, green and blue, white D65."""
    of_xyz = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
                       [0.0193339, 0.1191920, 0.9503041]])  # fmt: skip
    x, y, z = (of_xyz @ np.clip(shares, 0, 1)) / (of_xyz @ np.ones(3))
    f = [math.cbrt(t) if t > (6 / 29) ** 3 else t / (3 * (6 / 29) ** 2) + 4 / 29 for t in (x, y, z)]
    return 116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])


def difference(one, other):
    """The least CIE76 difference over all kinds of sight."""
    return min(
        math.dist(cielab(np.array(matrix) @ linear(one)), cielab(np.array(matrix) @ linear(other)))
        for matrix in VISION.values()
    )


def rgb(text):
    return tuple(int(text[i : i + 2], 16) for i in (1, 3, 5))


def least_difference(colours):
    return min(difference(*pair) for pair in combinations(colours, 2))


def roles():
    """Every colour of the theme, by its name."""
    named = {
        name: value
        for name, value in vars(theme).items()
        if name.isupper() and name[0] != "_" and name not in BODIES and isinstance(value, tuple)
    }
    named = {name: value for name, value in named.items() if all(isinstance(entry, int) for entry in value)}
    named |= {f"axis {axis}": colour for axis, colour in zip("αβγ", theme.AXIS_COLOURS, strict=True)}
    return named | {text: rgb(text) for text in (*theme.LAW_COLOURS.values(), *theme.SPARE, theme.OTHER_LAW)}


LAWS = [rgb(colour) for colour in theme.LAW_COLOURS.values()]
ROLES = (theme.COMMAND, theme.ESTIMATE, theme.DESIRED_TRACE)


def test_the_known_contrast_and_difference_of_two_colours():
    # #777777 on white has 4.48:1 (WebAIM); sRGB red is L 53.24, a 80.09, b 67.20 (Lindbloom).
    assert contrast((0x77, 0x77, 0x77), (255, 255, 255)) == pytest.approx(4.48, abs=0.005)
    np.testing.assert_allclose(cielab(linear((255, 0, 0))), (53.24, 80.09, 67.20), atol=0.01)


@pytest.mark.parametrize("ground", GROUNDS)
def test_every_line_has_a_contrast_of_three_on_every_ground(ground):
    assert len(roles()) >= 30
    ratios = {name: contrast(colour, GROUNDS[ground]) for name, colour in roles().items()}
    assert {name: ratio for name, ratio in ratios.items() if ratio < 3} == {}


@pytest.mark.parametrize("law", ["afsm", "afsm_eso"])
@pytest.mark.parametrize("count", [2, 5, 6, 7, 8, 17, 40])
def test_colours_of_many_runs_of_one_law_are_distinct_and_have_this_contrast(law, count):
    colours = theme.run_colours([law] * count)
    assert len(set(colours)) == count
    assert min(contrast(rgb(colour), ground) for colour in colours for ground in GROUNDS.values()) >= 3


def test_lines_of_figures_have_this_contrast_on_white():
    for colour in (*style.SERIES, *style.AXES, style.INK, style.FAINT, style.BROKEN):
        assert contrast(rgb(colour), (255, 255, 255)) >= 3, colour


@pytest.mark.parametrize("axis", range(3))
def test_lines_of_one_plot_differ_for_every_reader(axis):
    # Within these contrasts, lightness L* is from 42 to 62: greys differ by no more than 20.
    assert least_difference([theme.AXIS_COLOURS[axis], *ROLES]) >= 15


MARKS = (theme.TRACE, theme.DESIRED_TRACE, theme.COIL_TORQUE, theme.LOAD, theme.FAILURE)


@pytest.mark.parametrize(
    ("colours", "least"),
    [
        (theme.AXIS_COLOURS, 40),
        ([theme.FINE, theme.ESTIMATE, theme.WARNING, theme.FAILURE], 25),
        ([*theme.AXIS_COLOURS, *MARKS], 17),
        (LAWS, 17),
        ([*LAWS, *map(rgb, theme.SPARE), rgb(theme.OTHER_LAW)], 10),
        ([rgb(colour) for colour in style.SERIES], 35),
    ],
    ids=["axes", "states", "marks of the scene", "laws", "all laws", "series of figures"],
)
def test_colours_of_a_kind_differ_for_every_reader(colours, least):
    assert least_difference(colours) >= least


def test_laws_have_colours_of_their_own_and_that_of_no_role():
    assert set(theme.LAW_COLOURS) <= set(CONTROL_LAWS)
    assert theme.law_colour("one of the user's") == theme.OTHER_LAW not in theme.LAW_COLOURS.values()
    for law in (*LAWS, *map(rgb, theme.SPARE), rgb(theme.OTHER_LAW)):
        assert min(difference(law, role) for role in (theme.COMMAND, theme.DESIRED_TRACE)) >= 10
        assert difference(law, theme.FAILURE) >= 12


def test_the_scale_of_currents_is_linear_with_a_neutral_zero():
    shares = np.linspace(-1.25, 1.25, 41)
    colours = theme.current_colours(8.0 * shares, 8.0).astype(float)
    negative, zero, positive = (
        theme.current_colours(np.array([a]), 8.0)[0].astype(float) for a in (-8, 0, 8)
    )
    assert len(set(zero)) == 1
    assert negative[2] > 1.5 * max(negative[:2])  # blue
    assert positive[0] > 2 * max(positive[1:])  # red
    for share, colour in zip(np.clip(shares, -1, 1), colours, strict=True):
        full = negative if share < 0 else positive
        np.testing.assert_allclose(colour, zero + abs(share) * (full - zero), atol=0.5)  # eight bits


def test_currents_differ_from_zero_and_by_their_sign_for_every_reader_and_are_visible():
    negative, zero, positive = theme.current_colours(np.array([-1.0, 0.0, 1.0]), 1.0).tolist()
    assert difference(negative, positive) >= 100
    assert min(difference(negative, zero), difference(positive, zero)) >= 30
    for colour in (negative, zero, positive):
        assert min(contrast(colour, ground) for ground in GROUNDS.values()) >= 3


@pytest.mark.parametrize("count", [17, 40])
def test_colours_of_many_runs_have_one_luminance(count):
    """The luminance with which a colour has a contrast of 4:1 both to black and to white is 0.2."""
    colours = theme.run_colours(["afsm"] * count)
    luminance = [np.dot((0.2126, 0.7152, 0.0722), linear(rgb(colour))) for colour in colours]
    # Steps of lightness are 0.003, whose luminance is at most 0.005 here, and colours have eight bits.
    assert luminance == pytest.approx([0.2] * count, abs=0.008)


CURRENTS = theme.current_colours(np.array([-1.0, 0.0, 1.0]), 1.0).tolist()
LABELLED = (
    *LAWS,
    *map(rgb, theme.SPARE),
    *theme.AXIS_COLOURS,
    *CURRENTS,
    theme.FAILURE,
    theme.COIL_TORQUE,
    theme.LOAD,
    (0, 0, 0),
)


@pytest.mark.parametrize("colour", LABELLED, ids=str)
def test_a_label_is_readable_on_the_grounds_of_labels(colour):
    label = theme.label_colour(colour)
    assert contrast(label, (38, 38, 38)) >= 4.5
    assert contrast(label, (255, 255, 255)) >= 3.0


def test_a_readable_colour_is_the_colour_of_its_label():
    assert theme.label_colour((230, 190, 40)) == (230, 190, 40)


INKS = (*theme.LAW_COLOURS.values(), *theme.SPARE, theme.OTHER_LAW, "#ffffff", "#000000")


@pytest.mark.parametrize("colour", INKS)
def test_text_in_the_colour_of_a_law_is_readable_on_white(colour):
    text = theme.text_colour(colour)
    assert contrast(rgb(text), (255, 255, 255)) >= 4.5
    if contrast(rgb(colour), (255, 255, 255)) >= 4.6:
        assert text == colour


@pytest.mark.parametrize(("scheme", "ground"), [("light", (255, 255, 255)), ("dark", (36, 36, 36))])
def test_messages_of_the_bench_are_readable_in_both_themes(scheme, ground):
    css = (Path(theme.__file__).parent / "bench" / "bench.css").read_text(encoding="utf-8")
    (rule,) = re.findall(rf"(?m)^\[data-mantine-color-scheme={scheme}\] {{(.*?)}}", css)
    colours = dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", rule))
    assert set(colours) == {"good", "warn", "bad", "work"}
    for name, colour in colours.items():
        assert contrast(rgb(colour), ground) >= 4.5, name
