"""Overview of a run: its lines are the telemetry's, in named colours, with units."""

import numpy as np
import pytest
from matplotlib.colors import to_rgb

import spheretwin as st
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.viz.figures.comparison import overview
from spheretwin.viz.figures.style import AXES


@pytest.fixture(scope="module")
def run():
    """Ten ticks with the Lagrangian: fewer rows than the figure has points, so none is omitted."""
    return st.simulate("nutation", {"plant.engine": "lagrangian", "controller.law": "pd", "duration": 0.01})


def test_every_line_is_its_signal(run):
    table = run.telemetry
    angles, errors, currents = overview(table, "title").axes
    expected = {
        angles: [*np.degrees(table["q_rad"]).T, *np.degrees(table["q_ref_rad"]).T],
        errors: list(1e3 * table["error_rad"].T),
        currents: [np.abs(table["current_A"]).max(axis=1)],
    }
    for panel, columns in expected.items():
        for line, column in zip(panel.get_lines(), columns, strict=True):
            assert line.get_ydata() == pytest.approx(column, rel=1e-12)
            assert line.get_xdata() == pytest.approx(table["t_s"], abs=1e-12)
    for panel in (angles, errors):
        colours = [to_rgb(line.get_color()) for line in panel.get_lines()[:3]]
        assert colours == [to_rgb(colour) for colour in AXES]


def test_lines_have_names_and_axes_units(run):
    figure = overview(run.telemetry, "nutation under pd")
    assert [panel.get_ylabel() for panel in figure.axes] == ["angle, °", "error, mrad", "largest current, A"]
    assert figure.axes[-1].get_xlabel() == "time, s"
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [*ANGLES, "references"]
    handles = [to_rgb(line.get_color()) for line in legend.get_lines()]
    assert handles[:3] == [to_rgb(colour) for colour in AXES]
    assert figure.get_suptitle() == "nutation under pd"


def test_metrics_without_a_value_are_omitted(run):
    text = repr(run)
    assert "None" not in text
    assert "overshoot" not in text  # a nutation has none
