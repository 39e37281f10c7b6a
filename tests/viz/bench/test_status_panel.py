"""Status panel: numbers with their units, badges, bars and colours, read from its HTML."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from spheretwin.viz import theme
from spheretwin.viz.bench import server, status_panel
from spheretwin.viz.bench.page import FRAMES_A_STATUS, Page
from spheretwin.viz.bench.status_panel import BAD, GOOD, WARN, currents_html, scale_html, status_html
from tests.viz.bench.fake import CHOICES, STATE, Bench

BADGE = re.compile(r'<span style="background:(#\w+);[^>]*>([^<]*)</span>')
ROW = re.compile(r"<span style=\"color:#868e96\">([^<]*)</span><span>(.*?)</span>(?=<span style|</div>)")
BAR = re.compile(r"top:(\d+)%;height:(\d+)%;background:rgb\((\d+),(\d+),(\d+)\)")


def badges(**changes):
    return {text: colour for colour, text in BADGE.findall(shown(**changes))}


def shown(refused="", waits_for="", **changes):
    return status_html(SimpleNamespace(**STATE | changes), refused, waits_for)


def texts(html):
    return {name: re.sub("<[^>]*>", "", value).strip() for name, value in ROW.findall(html)}


def test_each_row_has_its_number_and_unit():
    rows = texts(shown(t_s=12.3456, missed=3, chunks=70, speed=0.5, realtime_factor=0.498))
    assert rows["time"] == "12.346 s"
    assert rows["speed"] == "0.5×, reached 0.50×"
    assert rows["|e|"] == "100.00 mrad = 5.730°"
    assert rows["law"] == "afsm, hold"
    assert rows["missed"] == "3 of 70"
    assert rows["margin"] == "75 %"
    assert texts(shown(speed=1e6))["speed"].startswith("as fast as possible")


def test_the_status_is_sent_once_in_some_frames():
    with Page(Bench(), CHOICES, server.listen(0)) as page:
        states = []
        page._show_status = lambda state: states.append(state.t_s)
        for frame in range(3 * FRAMES_A_STATUS):
            page._bench.now.t_s = float(frame)
            page.draw()
    assert states == [0.0, FRAMES_A_STATUS, 2 * FRAMES_A_STATUS]


@pytest.mark.parametrize(
    ("changes", "badge", "colour"),
    [
        ({"stopped": True}, "STOPPED", BAD),
        ({"status": "failsafe"}, "FAILSAFE", BAD),
        ({"reason": "a law raised"}, "FAULT", BAD),
        ({"saturated": True}, "SATURATED", WARN),
        ({"rank_lost": True}, "RANK LOST", BAD),
        ({"running": False}, "PAUSED", status_panel.QUIET),
        ({"mode": "off"}, "OFF", status_panel.QUIET),
        ({"mode": "fault"}, "FAULT", BAD),
    ],
)
def test_each_state_has_its_badge_and_only_that(changes, badge, colour):
    before, after = badges(), badges(**changes)
    assert before == {"HOLD": GOOD, "RUNS": GOOD}
    assert badge not in before
    assert after[badge] == colour
    assert len(set(after) - set(before)) == 1


@pytest.mark.parametrize(
    ("share", "width", "colour"),
    [(0.75, 75, GOOD), (0.31, 31, GOOD), (0.29, 29, WARN), (0.06, 6, WARN), (0.04, 4, BAD), (4.0, 100, GOOD)],
)
def test_the_bar_of_the_margin_is_as_long_as_its_share_and_red_where_little_is_left(share, width, colour):
    html = shown(torque_margin=share)
    assert re.findall(r"width:(\d+)%;height:100%;background:(#\w+)", html) == [(f"{width}", colour)]
    assert texts(html)["margin"] == f"{100 * share:.0f} %"


def test_messages_have_the_colour_of_their_kind_and_are_no_markup():
    html = shown(
        "expected <b>", "load", reason="stuck", note="disk", pending=[("seed", 3)], recording=["run.rrd"]
    )
    by_text = {text: colour for colour, text in re.findall(r'<div style="color:(#\w+)">([^<]*)</div>', html)}
    assert by_text["stuck"] == by_text["expected &lt;b&gt;"] == BAD
    assert by_text["disk"] == by_text["at the next reset: seed = 3"] == WARN
    assert by_text["recording run.rrd"] == GOOD
    assert [text for text in by_text if "load" in text] != []
    assert "No client operates" not in html
    assert "No client operates" in shown(watching=("page 1",))
    assert "No client operates" not in shown(watching=("page 1",), operator="page 0")


def test_bars_of_currents_go_up_for_positive_ones_in_their_colours():
    current_A = (4.0, -8.0, 0.0, -12.0)
    html = currents_html(current_A, 8.0, (20.0, 61.5, 30.0, 40.0))
    bars = [tuple(map(int, bar)) for bar in BAR.findall(html)]
    # From the middle: half of the half, all of it, nothing, and no more than all of it.
    assert [bar[:2] for bar in bars] == [(25, 25), (50, 50), (50, 0), (50, 50)]
    colours = theme.current_colours(np.array(current_A), 8.0)
    assert [bar[2:] for bar in bars] == [tuple(colour) for colour in colours.tolist()]
    assert "at most 12.00 A, 61.5 °C" in html
    assert "°C" not in currents_html(current_A, 8.0, None)
    without_limit = [tuple(map(int, bar[:2])) for bar in BAR.findall(currents_html(current_A, 0.0, None))]
    assert without_limit[3] == (50, 50)  # then the largest is the scale
    assert without_limit[1] == (50, 33)


def test_the_scale_goes_from_the_negative_to_the_positive_limit():
    html = scale_html(8.0)
    stops = [tuple(map(int, stop)) for stop in re.findall(r"rgb\((\d+),(\d+),(\d+)\)", html)]
    ends = theme.current_colours(np.array([-1.0, 0.0, 1.0]), 1.0).tolist()
    assert [stops[0], stops[len(stops) // 2], stops[-1]] == [tuple(colour) for colour in ends]
    assert re.findall(r"<span>([^<]*)</span>", html) == ["−8 A", "0", "8 A"]
