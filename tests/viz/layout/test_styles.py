"""Styles of lines: colours by the kind of a signal and by its size, names with units."""

import pytest

from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.viz import theme
from spheretwin.viz.layout.styles import MIDDLE, THICK, THIN, WIDEST, signal_style

GROUPS = tuple(f"group {group}" for group in range(18))


@pytest.mark.parametrize(
    ("name", "labels", "size", "colours", "width"),
    [
        ("q_rad", ANGLES, 3, list(theme.AXIS_COLOURS), THICK),
        ("q_ref_rad", ANGLES, 3, [theme.COMMAND] * 3, THIN),
        ("current_command_A", GROUPS, 18, [theme.COMMAND] * 18, THIN),
        ("qdot_estimated_rad_s", ANGLES, 3, [theme.ESTIMATE] * 3, WIDEST),
        ("disturbance_Nm", ANGLES, 3, [theme.DESIRED_TRACE] * 3, MIDDLE),
        ("new_rad", ANGLES, 3, list(theme.AXIS_COLOURS), MIDDLE),
        ("new_1", (), 1, [theme.PLAIN], MIDDLE),
        ("new_A", GROUPS, 18, [theme.GROUP] * 18, MIDDLE),
        ("three_others", ("a", "b", "c"), 3, [theme.GROUP] * 3, MIDDLE),
    ],
)
def test_lines_have_the_colour_and_the_width_of_their_kind(name, labels, size, colours, width):
    style = signal_style(Signal(name, "A", size, "a signal", labels))
    assert (style.colours, style.width) == (colours, width)
    assert len(style.names) == len(style.markers) == size


def test_names_of_lines_have_label_and_unit():
    assert signal_style(Signal("q_rad", "rad", 3, "angles", ANGLES)).names == [
        "q α [rad]",
        "q β [rad]",
        "q γ [rad]",
    ]
    assert signal_style(Signal("power_W", "W", 1, "power")).names == ["power [W]"]
