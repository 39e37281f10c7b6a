"""Figures with the widths of a paper: legible text, and nothing cut at an edge."""

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from spheretwin.viz.figures import style
from tests.content.test_figures import FIGURES

TITLE = "A title of many words that is longer than the width of one column of a paper can hold in one line"


def long_texts():
    """Return a figure with long texts in small sizes, and a legend of a line."""
    figure = Figure(figsize=(10.0, 6.0), layout="constrained")
    for panel in figure.subplots(1, 2):
        panel.set_ylabel("largest error of the hinge, mrad", fontsize="small")
        panel.set_title("a panel", fontsize="x-small")
    for number in range(8):
        panel.plot([0, 1], [1, 2], label=f"law {number} with a long name")
    figure.suptitle(TITLE)
    figure.legend(loc="outside lower center", ncols=8)
    return figure


NAMES = (
    *(name for name in FIGURES if name.startswith("crosscheck")),
    "error_courses", "error_lines", "heat", "by_condition_of_three_hinges", "map", "estimators",
)  # fmt: skip
DRAWN = {"long_texts": long_texts, **{name: FIGURES[name] for name in NAMES}}


@pytest.mark.release("draws 26 figures for 6 s; changes with Matplotlib")
@pytest.mark.parametrize("width_in", style.PAPER_WIDTHS_in.values())
@pytest.mark.parametrize("name", DRAWN)
def test_text_is_legible_and_within_the_figure(name, width_in):
    figure = DRAWN[name]()
    titles = [
        text.get_text() for axes in figure.axes for text in (axes.title, axes.xaxis.label, axes.yaxis.label)
    ]
    legends = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    style.fit_width(figure, width_in)
    figure.draw_without_rendering()
    assert figure.get_size_inches()[0] == width_in
    assert [text.get_text() for legend in figure.legends for text in legend.get_texts()] == legends
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
