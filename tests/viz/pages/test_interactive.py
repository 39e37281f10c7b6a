"""Interactive plots: dashes of the runs, and values outside of the axes in the words of the figures."""

import re

import numpy as np
import pytest

from spheretwin.viz.figures import comparison
from spheretwin.viz.pages import interactive
from tests.viz.comparison.compared import RAMP, VALUE, T_s, run_of

RUNS = [run_of((place + 1) * RAMP, label=f"{place + 1} run", law="pd") for place in range(8)]


def test_every_run_has_its_own_dash_in_the_plot_and_on_its_switch():
    figure = interactive.over_time(RUNS, [], [VALUE])
    lines = [trace for trace in figure.data if trace.type == "scatter" and trace.mode == "lines"]
    assert [trace.meta for trace in lines] == [str(place) for place in range(8)]
    dashes = [trace.line.dash for trace in lines]
    assert len(set(dashes)) == 8
    assert dashes[:2] == ["solid", "7.5px,1.5px"]
    switches = interactive._switches(RUNS)
    strokes = re.findall(r'stroke="([^"]*)" stroke-width="3" stroke-dasharray="([^"]*)"', switches)
    assert [colour for colour, _ in strokes] == [trace.line.color for trace in lines]
    assert [dash.replace(",", "px,") + "px" if dash else "solid" for _, dash in strokes] == dashes


SETTLED = 0.01 * np.abs(np.sin(40 * T_s)) + 1e-3
TRANSIENT = SETTLED + np.where(T_s < 0.3, 2.0, 0.0)
ANGLE = VALUE._replace(title="error as one angle", group="whole")


def notes_of(figure):
    return {note.name: note.text for note in figure.layout.annotations if note.name}


def test_a_transient_outside_of_the_axis_is_stated_as_in_the_figure():
    runs = [run_of(TRANSIENT, f"{place} run") for place in (1, 2, 3)]
    page = interactive.over_time(runs, [], [VALUE])
    (note,) = notes_of(page).values()
    assert note.startswith("outside of the axis: run 1 reaches 2.01 (0 s to 0.299 s), run 2 reaches")
    title = comparison.over_time(runs, [], [VALUE], "title").axes[0].get_title(loc="right")
    assert note.split("<br>") == title.splitlines()
    # The panel keeps its height; the note has space of its own below the title.
    height = page.layout.height - interactive.over_time([run_of(SETTLED)] * 3, [], [VALUE]).layout.height
    assert height == pytest.approx(2 * interactive.NOTE_px)
    low, high = page.layout.yaxis.domain
    inner_px = page.layout.height - 2 * interactive.MARGIN_px
    assert (high - low) * inner_px == pytest.approx(interactive.HEIGHT_px)
    titles = [note for note in page.layout.annotations if not note.name]
    assert titles[0].yshift == 2 * interactive.NOTE_px


def test_an_axis_with_all_values_has_no_note():
    assert notes_of(interactive.over_time([run_of(SETTLED)], [], [VALUE, ANGLE])) == {}


def test_the_logarithmic_axis_has_its_own_range_and_note():
    page = interactive.over_time([run_of(10.0 ** (-4.0 * T_s))], [], [VALUE, ANGLE])  # to 1e-16
    assert notes_of(page)["yaxis3"] == "values below 2e-06 are below the axis"
    assert page.layout.yaxis3.type == "log"
    assert page.layout.yaxis3.range == pytest.approx([np.log10(1.5) - 6, np.log10(1.5)])
