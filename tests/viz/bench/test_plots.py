"""Plots in the dock: bounds of all rows, cursor, window, pause, zoom, and the triggered capture."""

import numpy as np
import pytest

from tests.browser import needs_a_browser
from tests.viz.bench import fake
from tests.waiting import wait_for

pytestmark = [
    needs_a_browser,
    pytest.mark.release("browser, 3 to 7 s; content of the bench has the plots' data"),
]

LIVE = "bench.plots.live"


class Bench(fake.Bench):
    """Bench whose bins are added by a test."""

    count = 50

    def bins(self, after=-1):
        bins = super().bins(after)
        keep = [place for place, number in enumerate(bins.numbers) if number < self.count]
        parts = (
            {name: values[keep] for name, values in of.items()} for of in (bins.rows, bins.low, bins.high)
        )
        return type(bins)(bins.run, [bins.numbers[place] for place in keep], *parts)


@pytest.fixture
def bench():
    return Bench()


@pytest.fixture
def tab(tab):
    tab.wait_for(f"{LIVE}.t.length > 0")
    return tab


def values(pane):
    return f"document.querySelector('[data-pane={pane}] .values').innerText"


def test_the_plots_have_all_bins_once_also_after_a_restart(tab, bench):
    bench.count = 20
    bench.run = 2
    tab.wait_for(f"{LIVE}.t.length === 20")
    for bench.count in (21, 30, 50):
        tab.wait_for(f"{LIVE}.t.length === {bench.count}")
    bins = bench.bins()
    assert tab.evaluate(f"{LIVE}.number") == bins.numbers
    for key, name, factor in (("q1", "q_rad", 180 / np.pi), ("error1", "error_rad", 1e3)):
        for bound, part in enumerate((bins.low, bins.high)):
            shown = tab.evaluate(f"Array.from({LIVE}.bounds.{key}[{bound}])")
            np.testing.assert_allclose(shown, factor * part[name][:, 1], rtol=1e-14)


def test_a_group_that_is_selected_while_rows_arrive_has_all_of_its_rows(tab, bench):
    tab.evaluate(
        "(() => { const fetch = bench.fetch; bench.fetch = async (...given) => {"
        " const header = await fetch(...given); if (!bench.selected.length) bench.select(3);"
        " return header; }; return true; })()"
    )
    tab.wait_for(f"{LIVE}.bounds.current3?.[0].length > 0")
    shown = tab.evaluate(f"Array.from({LIVE}.bounds.current3[0])")
    np.testing.assert_allclose(shown, bench.bins().low["current_A"][:, 3], rtol=1e-14)


def test_no_extreme_is_lost_in_a_column_of_pixels(tab):
    columns = tab.evaluate(
        "(() => { const t = [...Array(1000).keys()];"
        " const low = t.map((i) => i % 2 ? -1 : 0), high = low.map((v) => v + 1);"
        " low[517] = -9; high[518] = 7;"
        " return bench.plots.columns(t, [low, high], 0, 1000, (value) => value / 100); })()"
    )
    assert [column["at"] for column in columns] == list(range(11))
    assert {(column["low"], column["high"]) for column in columns if column["at"] != 5} == {(-1, 1)}
    assert [(column["low"], column["high"]) for column in columns if column["at"] == 5] == [(-9, 7)]


def test_the_cursor_shows_the_values_at_its_time_in_every_pane(tab, bench):
    tab.wait_for("document.querySelector('[data-pane=error]')?.scale !== undefined")
    at = tab.evaluate(
        "((pane) => { const {x, y, height} = pane.getBoundingClientRect();"
        " const {start, end, left, right} = pane.scale;"
        " return [x + left + (0.5 - start) / (end - start) * (right - left), y + height / 2]; })"
        "(document.querySelector('[data-pane=error]'))"
    )
    tab._mouse("mouseMoved", *at)
    tab.wait_for("Math.abs(bench.plots.view.cursor - 0.5) < 0.1")
    cursor = tab.evaluate("bench.plots.view.cursor")
    bins = bench.bins()
    place = int(np.flatnonzero(bins.low["t_s"][:, 0] <= cursor + 1e-9)[-1])
    low, high = bins.low["torque_command_Nm"][place, 1], bins.high["torque_command_Nm"][place, 1]
    tab.wait_for(f"{values('torque')}.includes('β {low:.2f}…{high:.2f}')")
    assert "torque, N·m" in tab.evaluate(values("torque"))
    assert "β, °" in tab.evaluate(values("β"))
    assert "desired" in tab.evaluate(values("β"))


def test_window_pause_and_zoom(tab, bench):
    bench.count = 30
    bench.run = 2
    tab.wait_for(f"{LIVE}.t.length === 30")
    tab.evaluate("(s => { s.value = 0; s.dispatchEvent(new Event('change', {bubbles: true})); })"
                 "(document.querySelector('[data-do=window]'))")  # fmt: skip
    assert tab.evaluate("bench.plots.range()") == [0, 2]
    tab.click("[data-do=pause]")
    bench.count = 50
    tab.wait_for(f"{LIVE}.t.length === 50")  # nothing is lost meanwhile
    assert tab.evaluate("bench.plots.range()") == [0, 2]
    tab.click("[data-do=in]")
    assert tab.evaluate("bench.plots.range()") == [1, 2]
    tab.click("[data-do=pause]")
    assert tab.evaluate("bench.plots.view.end") is None
    tab.click("[data-show=torque]")
    tab.wait_for("document.querySelector('[data-pane=torque]') === null")


def test_a_capture_is_armed_shown_with_every_row_and_left(tab, bench):
    for name, value in (
        ("on", "level"),
        ("signal", "1"),
        ("level", "5"),
        ("before", "0.1"),
        ("length", "0.5"),
    ):
        tab.evaluate(
            f"(e => {{ e.value = {value!r}; e.dispatchEvent(new Event('change', {{bubbles: true}})); }})"
            f"(document.querySelector('[data-do={name}]'))"
        )
    tab.click("[data-do=arm]")
    wait_for(lambda: bench.commands() != [])
    ((name, given),) = bench.commands()
    assert name == "capture"
    assert given == {
        "on": "level", "signal": "error_rad", "entry": 1, "level": pytest.approx(5e-3), "edge": "rising",
        "before_s": 0.1, "length_s": 0.5,
    }  # fmt: skip
    bench.capture = bench.bins().rows
    bench.now.capture, bench.now.capture_t_s = "complete", 0.5
    tab.wait_for("document.querySelector('[data-capture]').innerText === 'complete at 0.500 s'")
    tab.click("[data-do=captured]")
    tab.wait_for("bench.plots.shown.t.length === 50 && bench.plots.shown.event_s === 0.5")
    assert tab.evaluate("bench.plots.range()") == pytest.approx([0.0, 0.98])
    tab.click("[data-do=captured]")
    tab.wait_for("bench.plots.shown === bench.plots.live")
