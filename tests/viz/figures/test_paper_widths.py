"""Figures with the widths of a paper: legible text, and nothing cut at an edge."""

import pytest
from matplotlib.text import Text

from spheretwin.viz.figures import style
from tests.viz.figures import test_conditions, test_errors, test_over_time, test_study
from tests.viz.figures.test_plots import FIGURES

DRAWN = {
    **FIGURES,
    "courses": test_errors.courses,
    "changes": test_errors.lines,
    "heat": test_errors.heated,
    "by_condition": test_over_time.drawn,
    "map": test_study.map_figure,
    "estimators": test_conditions.drawn,
}


@pytest.mark.parametrize("width_in", style.PAPER_WIDTHS_in.values())
@pytest.mark.parametrize("name", DRAWN)
def test_text_is_legible_and_within_the_figure(name, width_in):
    figure = DRAWN[name]()
    titles = [
        text.get_text() for axes in figure.axes for text in (axes.title, axes.xaxis.label, axes.yaxis.label)
    ]
    style.fit_width(figure, width_in)
    figure.draw_without_rendering()
    assert figure.get_size_inches()[0] == width_in
    shown = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    # Text of a page is at most 12 pt: a paper's is between the least and that.
    assert all(style.PAPER_TEXT_pt <= text.get_fontsize() <= 12 for text in shown)
    assert set(filter(None, titles)) <= {text.get_text() for text in shown}
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    pixel_in = 1 / figure.dpi  # hinting may take one
    assert -pixel_in <= box.x0
    assert -pixel_in <= box.y0
    assert box.x1 <= width + pixel_in
    assert box.y1 <= height + pixel_in
