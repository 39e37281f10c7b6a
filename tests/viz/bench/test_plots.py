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


@pytest.fixture
def forgetful(tab):
    """The page, whose layout another test has not left behind."""
    tab.evaluate("localStorage.clear()")
    return tab


PANES = "[...document.querySelectorAll('[data-pane]')].map((each) => each.dataset.pane)"


def select(tab, *panes):
    """Choose the quantities of as many plots."""
    tab.click(f"[data-count='{len(panes)}']")
    for place, name in enumerate(panes):
        choose(tab, f"document.querySelectorAll('[data-pane] select')[{place}]", name)
    assert tab.evaluate(PANES) == list(panes)


def choose(tab, element, value):
    change = f"e.value = {value!r}; e.dispatchEvent(new Event('change', {{bubbles: true}}));"
    tab.evaluate(f"((e) => {{ {change} }})({element})")


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
    select(tab, "β", "error", "torque")
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
    tab.wait_for(f"{values('torque')}.includes('β {low:.3f}…{high:.3f}')")
    quantity = (
        "[...document.querySelectorAll('[data-pane] select')].map((each) => each.selectedOptions[0].text)"
    )
    assert tab.evaluate(quantity) == ["β, °", "error, mrad", "torque, N·m"]
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


def test_one_to_four_plots_change_places_and_are_remembered(forgetful, page):
    tab = forgetful
    for count in (1, 4, 2, 3):
        tab.click(f"[data-count='{count}']")
        shown = tab.evaluate(PANES)
        assert len(shown) == len(set(shown)) == count
    select(tab, "currents", "error", "angles")
    choose(tab, "document.querySelectorAll('[data-pane] select')[0]", "angles")  # the two change places
    assert tab.evaluate(PANES) == ["angles", "error", "currents"]
    tab.wait_for("document.querySelector('[data-pane=error]').scale !== undefined")
    tab.click("[data-pane=error] [data-scale]")
    choose(tab, "document.querySelectorAll('[data-pane=error] [data-end]')[1]", "40")
    tab.wait_for("document.querySelector('[data-pane=error]').scale?.high === 40")
    tab.go(f"http://127.0.0.1:{page._server.get_port()}/")
    tab.wait_for("document.querySelector('[data-pane=error]')?.scale?.high === 40")
    assert tab.evaluate(PANES) == ["angles", "error", "currents"]
    tab.click("[data-pane=error] [data-scale]")
    tab.wait_for("document.querySelector('[data-pane=error]').scale?.high > 400")


def test_a_page_without_storage_or_with_a_foreign_entry_has_its_own_layout(forgetful, page):
    tab = forgetful
    address = f"http://127.0.0.1:{page._server.get_port()}/"
    for entry in ("[1]", "{", '{"panes": [{"show": "nothing"}]}', '{"panes": [{"show": "__proto__"}]}'):
        tab.evaluate(f"localStorage.setItem('spheretwin-bench', {entry!r})")
        tab.go(address)
        tab.wait_for(f"{PANES}.length === 3")
    denied = "Object.defineProperty(window, 'localStorage', {get() { throw new Error('denied'); }})"
    tab.command("Page.addScriptToEvaluateOnNewDocument", source=denied)
    tab.go(address)
    tab.click("[data-count='1']")
    tab.wait_for(f"{PANES}.length === 1")


def test_two_cursors_show_the_difference(forgetful, bench):
    tab = forgetful
    select(tab, "α")
    tab.wait_for("document.querySelector('[data-pane=α]').scale !== undefined")
    tab.click("[data-do=marks]")
    for place, t_s in enumerate((0.2, 0.7)):
        choose(tab, f"document.querySelectorAll('[data-mark]')[{place}]", str(t_s))
    bins = bench.bins()
    a, b = (
        np.degrees((bins.low["q_rad"][place, 0] + bins.high["q_rad"][place, 0]) / 2) for place in (10, 35)
    )
    tab.wait_for(f"{values('α')}.includes('Δ {b - a:.1f}')")
    assert tab.evaluate("document.querySelector('[data-difference]').innerText") == "Δ 0.500 s"
    before = tab.evaluate("bench.plots.view.marks")
    at = (
        "((pane, t) => {{ const {{x, y, height}} = pane.querySelector('canvas').getBoundingClientRect();"
        " const {{start, end, left, right}} = pane.scale;"
        " return [x + left + (t - start) / (end - start) * (right - left), y + height / 2]; }})"
        "(document.querySelector('[data-pane=α]'), {})"
    )
    tab.drag(tab.evaluate(at.format(0.2)), tab.evaluate(at.format(0.5)))
    after = tab.evaluate("bench.plots.view.marks")
    assert after[0] == pytest.approx(0.5, abs=0.05)
    assert after[1] == before[1]
    tab.click("[data-do=marks]")
    tab.wait_for("bench.plots.view.marks === null")


def test_the_bars_have_the_scale_of_the_run_and_the_limit_is_named(forgetful, bench):
    tab = forgetful
    bench.now.current_A = (0.2,) + (0.0,) * (fake.GROUPS - 1)
    scale = "document.querySelector('[data-pane=groups]').scale"
    select(tab, "groups")
    bench.bins = lambda after=-1: small_currents(fake.Bench.bins(bench, after))
    bench.run = 2
    tab.wait_for(f"{scale}?.high < 0.3 && {scale}.high > 0.2")
    assert "limit ±8" in tab.evaluate(values("groups"))


def small_currents(bins):
    parts = ({**part, "current_A": 0 * part["current_A"] + 0.01} for part in (bins.rows, bins.low, bins.high))
    return type(bins)(bins.run, bins.numbers, *parts)
