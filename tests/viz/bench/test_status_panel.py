"""Status in the bar: numbers with their units, badges and messages, read from its HTML."""

import re
from types import SimpleNamespace

import pytest

from spheretwin.viz.bench import server
from spheretwin.viz.bench.page import FRAMES_A_STATUS, Page
from spheretwin.viz.bench.status_panel import BAD, GOOD, QUIET, WARN, status_html
from tests.viz.bench.fake import CHOICES, STATE, Bench

BADGE = re.compile(r'<span class="badge (\w+)">([^<]*)</span>')
CELL = re.compile(r'<span class="cell" title="([^"]*)"><i>([^<]*)</i> (.*?)</span>(?=<span|</div>)')


def badges(**changes):
    return {text: kind for kind, text in BADGE.findall(shown(**changes))}


def shown(refused="", waits_for="", **changes):
    return status_html(SimpleNamespace(**STATE | changes), refused, waits_for)


def texts(html):
    return {name: re.sub("<[^>]*>", "", value).strip() for _, name, value in CELL.findall(html)}


def titles(html):
    return {name: title for title, name, _ in CELL.findall(html)}


def test_an_error_of_many_turns_fits_its_place():
    assert texts(shown(error_mrad=99_999.0))["error |e|"] == "99999.00 mrad"
    assert texts(shown(error_mrad=5.82e7))["error |e|"] == "5.82e+07 mrad"


def test_each_number_has_its_unit():
    html = shown(
        t_s=12.3456,
        missed=3,
        chunks=70,
        speed=0.5,
        realtime_factor=0.498,
        active_faults=("coil.07 open", "adc <b>"),
    )
    assert texts(html) == {
        "time": "12.346 s",
        "speed": "0.50×",
        "error |e|": "100.00 mrad",
        "torque margin": "75 %",
        "chatter": "12.3 A/s",
        "missed deadlines": "3",
        "faults": "2",
        "recording": "off",
        "control law": "afsm",
    }
    assert titles(html)["speed"].endswith("commanded: 0.5×")
    assert titles(html)["missed deadlines"] == "late chunks of 70"
    assert titles(html)["faults"] == "coil.07 open, adc &lt;b&gt;"
    assert titles(html)["error |e|"] == "error: 5.730°"
    assert titles(shown(speed=1e6))["speed"].endswith("as fast as possible")
    assert texts(shown(recording=("a.rrd",)))["recording"] == "on"


def test_the_status_is_sent_once_in_some_frames():
    with Page(Bench(), CHOICES, server.listen(0)) as page:
        states = []
        page._show_status = lambda state: states.append(state.t_s)
        for frame in range(3 * FRAMES_A_STATUS):
            page._bench.now.t_s = float(frame)
            page.draw()
    assert states == [0.0, FRAMES_A_STATUS, 2 * FRAMES_A_STATUS]


@pytest.mark.parametrize(
    ("changes", "badge", "kind"),
    [
        ({"stopped": True}, "STOPPED", BAD),
        ({"status": "failsafe"}, "FAILSAFE", BAD),
        ({"reason": "a law raised"}, "FAULT", BAD),
        ({"saturated": True}, "SATURATED", WARN),
        ({"rank_lost": True}, "RANK LOST", BAD),
        ({"running": False}, "PAUSED", QUIET),
        ({"mode": "off"}, "OFF", QUIET),
        ({"mode": "fault"}, "FAULT", BAD),
    ],
)
def test_each_state_has_its_badge_and_only_that(changes, badge, kind):
    before, after = badges(), badges(**changes)
    assert before == {"HOLD": GOOD, "RUNNING": GOOD}
    assert badge not in before
    assert after[badge] == kind
    assert len(set(after) - set(before)) == 1


@pytest.mark.parametrize(
    ("share", "width", "kind"),
    [(0.75, 75, GOOD), (0.31, 31, GOOD), (0.29, 29, WARN), (0.06, 6, WARN), (0.04, 4, BAD), (4.0, 100, GOOD)],
)
def test_the_bar_of_the_margin_is_as_long_as_its_share_and_red_where_little_is_left(share, width, kind):
    html = shown(torque_margin=share)
    assert re.findall(r'<b class="(\w+)" style="width:(\d+)%">', html) == [(kind, f"{width}")]
    assert texts(html)["torque margin"] == f"{100 * share:.0f} %"


def test_messages_have_their_kind_and_are_no_markup():
    html = shown(
        "expected <b>", "load", reason="stuck", note="disk", pending=[("seed", 3)], recording=["run.rrd"]
    )
    by_text = {text: kind for kind, text in re.findall(r'<span class="(\w+)">([^<]*)</span>', html)}
    assert by_text["stuck"] == by_text["expected &lt;b&gt;"] == BAD
    assert by_text["disk"] == by_text["at the next reset: seed = 3"] == WARN
    assert by_text["recording run.rrd"] == GOOD
    assert [text for text in by_text if "load" in text] != []
    assert "no client operates" not in html
    assert "no client operates" in shown(watching=("page 1",))
    assert "no client operates" not in shown(watching=("page 1",), operator="page 0")
