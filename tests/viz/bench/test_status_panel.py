"""Status in the bar: large numbers, the margin at its limits, texts that are no markup, and its rate."""

import re
from types import SimpleNamespace

import pytest

from spheretwin.viz.bench import server
from spheretwin.viz.bench.page import FRAMES_A_STATUS, Page
from spheretwin.viz.bench.status_panel import BAD, GOOD, WARN, status_html
from tests.viz.bench.fake import CHOICES, STATE, Bench

CELL = re.compile(r'<span class="cell" title="([^"]*)"><i>([^<]*)</i> (.*?)</span>(?=<span|</div>)')


def shown(**changes):
    return status_html(SimpleNamespace(**STATE | changes), "", "")


def texts(html):
    return {name: re.sub("<[^>]*>", "", value).strip() for _, name, value in CELL.findall(html)}


def test_an_error_of_many_turns_fits_its_place():
    assert texts(shown(error_mrad=99_999.0))["error |e|"] == "99999.00 mrad"
    assert texts(shown(error_mrad=5.82e7))["error |e|"] == "5.82e+07 mrad"


def test_messages_are_no_markup():
    given = {
        "reason": "<p>",
        "note": "<em>",
        "active_faults": ("adc <u>",),
        "recording": ["<s>"],
        "law": "<a>",
    }
    html = shown(**given)
    for tag in ("p", "em", "u", "s", "a"):
        assert f"<{tag}>" not in html
        assert f"&lt;{tag}&gt;" in html


def test_the_status_is_sent_once_in_some_frames():
    with Page(Bench(), CHOICES, server.listen(0)) as page:
        states = []
        page._show_status = lambda state: states.append(state.t_s)
        for frame in range(3 * FRAMES_A_STATUS):
            page._bench.now.t_s = float(frame)
            page.draw()
    assert states == [0.0, FRAMES_A_STATUS, 2 * FRAMES_A_STATUS]


@pytest.mark.parametrize(
    ("share", "width", "kind"),
    [(0.75, 75, GOOD), (0.31, 31, GOOD), (0.29, 29, WARN), (0.06, 6, WARN), (0.04, 4, BAD), (4.0, 100, GOOD)],
)
def test_the_bar_of_the_margin_is_as_long_as_its_share_and_red_where_little_is_left(share, width, kind):
    html = shown(torque_margin=share)
    assert re.findall(r'<b class="(\w+)" style="width:(\d+)%">', html) == [(kind, f"{width}")]
    assert texts(html)["torque margin"] == f"{100 * share:.0f} %"
