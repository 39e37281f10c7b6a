"""Interactive plots state the values outside of their axes, in the words of the figures."""

import numpy as np
import pytest

from spheretwin.viz.figures import comparison
from spheretwin.viz.pages import interactive
from tests.viz.comparison.compared import VALUE, T_s, run_of

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
    assert np.isclose((high - low) * inner_px, interactive.HEIGHT_px)
    titles = [note for note in page.layout.annotations if not note.name]
    assert titles[0].yshift == 2 * interactive.NOTE_px


def test_an_axis_with_all_values_has_no_note():
    page = interactive.over_time([run_of(SETTLED)], [], [VALUE, ANGLE])
    assert notes_of(page) == {}
    assert page.layout.meta[0]["note"] == ""


def test_the_logarithmic_axis_has_its_own_note():
    decay = 10.0 ** (-4.0 * T_s)  # to 1e-16
    page = interactive.over_time([run_of(decay)], [], [VALUE, ANGLE])
    (of_axis,) = page.layout.meta
    assert of_axis["axis"] == "yaxis2"
    assert of_axis["range"] == pytest.approx([np.log10(1.5) - 6, np.log10(1.5)])
    assert of_axis["note"] == "values below 2e-06 are below the axis"
    below = comparison.over_time([run_of(decay)], [], [ANGLE], "title").axes[1]
    assert below.get_title(loc="right") == of_axis["note"]
    assert np.allclose(np.log10(below.get_ylim()), of_axis["range"])
    # Both notes take the same space.
    assert notes_of(page)["yaxis2"].count("<br>") == of_axis["note"].count("<br>")
