"""Styles of lines: colours by the kind of a signal and by its size, names with units."""

import pytest

from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.viz import theme
from spheretwin.viz.layout.styles import MIDDLE, signal_style

GROUPS = tuple(f"group {group}" for group in range(18))


@pytest.mark.parametrize(
    ("name", "labels", "size", "colours", "width"),
    [
        ("new_rad", ANGLES, 3, list(theme.AXIS_COLOURS), MIDDLE),
        ("new_1", (), 1, [theme.PLAIN], MIDDLE),
        ("new_A", GROUPS, 18, [theme.GROUP] * 18, MIDDLE),
        ("three_others", ("a", "b", "c"), 3, [theme.GROUP] * 3, MIDDLE),
    ],
)
def test_lines_of_signals_without_a_kind_of_their_own_have_the_colours_of_their_size(
    name, labels, size, colours, width
):
    style = signal_style(Signal(name, "A", size, "a signal", labels))
    assert (style.colours, style.width) == (colours, width)
    assert len(style.names) == len(style.markers) == size
