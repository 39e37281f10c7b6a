"""Status in the bar: large numbers, the margin at its limits, texts that are no markup, and its rate."""

import pytest

from spheretwin.viz.bench import server
from spheretwin.viz.bench.page import FRAMES_A_STATUS, Page
from spheretwin.viz.bench.status_panel import status_html
from tests.viz.bench.fake import CHOICES, Bench


def test_the_status_is_sent_once_in_some_frames():
    with Page(Bench(), CHOICES, server.listen(0)) as page:
        states = []
        page._show_status = lambda state: states.append(state.t_s)
        for frame in range(3 * FRAMES_A_STATUS):
            page._bench.now.t_s = float(frame)
            page.draw()
    assert states == [0.0, FRAMES_A_STATUS, 2 * FRAMES_A_STATUS]


@pytest.mark.parametrize(
    ("mode", "error"),
    [("hold", "100.00 mrad"), ("replay", "100.00 mrad"), ("off", "–"), ("manual", "–"), ("fault", "–")],
)
def test_an_error_is_shown_only_against_a_reference_that_applies(mode, error):
    assert f"</i> <b>{error}</b>" in status_html(Bench(mode=mode).now, "", "").partition("error |e|")[2]
