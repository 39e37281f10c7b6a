"""A bench driven from a browser: what is shown is what it is, and what was recorded runs again."""

import contextlib
import os
import threading
from pathlib import Path

import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.bench import Bench
from spheretwin.bench.operators import Operators
from spheretwin.cli.bench import SILENCE_S, choices_of
from spheretwin.models.base.errors import InputError
from spheretwin.models.kinematics import rotation
from spheretwin.viz.bench import server
from spheretwin.viz.bench.page import Page
from tests.browser import Browser, needs_a_browser
from tests.viz.bench.on_page import STATUS, at_rest, choose, errors, on_screen, opened, write
from tests.waiting import wait_for

pytestmark = needs_a_browser


@contextlib.contextmanager
def driven(scenario):
    """A bench, and a page of it that follows."""
    ended = threading.Event()
    with (
        Bench(scenario, Operators(SILENCE_S)) as bench,
        Page(bench, choices_of(bench), server.listen(0)) as page,
    ):
        bench.begin()
        following = threading.Thread(target=page.show, args=(ended.is_set,))
        following.start()
        try:
            yield bench, page
        finally:
            ended.set()
            following.join()


def until(bench, condition):
    wait_for(lambda: condition(bench.state()))


def tip_m(bench, q_rad):
    return rotation(np.array(q_rad)) @ bench.actuator.shaft_tip_m


def says(tab, *words):
    for word in words:
        tab.wait_for(f"{STATUS}.innerText.includes({word!r})")


def test_a_bench_is_driven_from_a_browser(tmp_path):
    scenario = scenarios.load("sinusoid", {"plant.engine": "lagrangian"})
    kept = tmp_path / "bench.parquet"
    with driven(scenario) as (bench, page), Browser() as browser:
        tab = opened(browser, page)
        says(tab, "TRAJECTORY", "PAUSED", "afsm")

        tab.click("text=keep")
        write(tab, "recording", "")
        write(tab, "telemetry", str(kept))
        tab.click("text=Record from now on")
        until(bench, lambda state: state.recording == (str(kept),))
        tab.click("text=start")
        until(bench, lambda state: state.t_s > 0.2)
        says(tab, "RUNS", "recording")

        tab.click("text=law")
        choose(tab, "law", "computed_torque")
        until(bench, lambda state: state.law == "computed_torque")
        says(tab, "computed_torque, sinusoid")
        tab.click("text=twin")
        write(tab, "load", "0.2")
        tab.click("text=Set")
        until(bench, lambda state: ("disturbance.load", 0.2) in [field[:2] for field in bench.fields()])

        tab.click("text=move")
        tab.click("text=hold")
        until(bench, lambda state: state.mode == "hold")
        until(bench, lambda state: np.abs(state.qdot_ref_rad_s).max() < 1e-3)
        at_rest(page, tab)
        here = np.array(bench.state().q_ref_rad)
        there = here + [0.35, 0.1, 0.0]
        tab.drag(on_screen(page, tab, tip_m(bench, here)), on_screen(page, tab, tip_m(bench, there)))
        # A pixel is 5 mrad of the shaft as the page comes up, seen from ahead; here it is seen at a slant.
        until(bench, lambda state: np.abs(np.array(state.q_ref_rad) - there).max() < 2e-2)
        assert bench.state().mode == "point"
        says(tab, "POINT")
        picture = tab.screenshot(Path(os.environ.get("SPHERETWIN_PICTURES", tmp_path)) / "bench.png")
        assert picture.stat().st_size > 20_000  # more than one colour

        tab.click("text=faults")
        tab.click("text=Add from now on")
        until(bench, lambda state: state.faults and state.faults[0].startswith("coil.00 open"))
        tab.wait_for("document.body.innerText.includes('coil.00 open from')")

        tab.key(" ")
        until(bench, lambda state: state.stopped)
        says(tab, "STOPPED")
        # Without currents the rotor falls, and may leave the workspace before a busy page has drawn it.
        tab.wait_for(f"/OFF|FAULT/.test({STATUS}.innerText)")
        until(bench, lambda state: not np.any(state.current_command_A))
        tab.click("text=keep")
        tab.click("text=Stop and complete the files")
        until(bench, lambda state: state.completed_files == (str(kept),))
        assert errors(tab) == []
        assert tab.outside == []
    again = tmp_path / "again.parquet"
    cli.main(["simulate", "--replay", str(kept), "--telemetry", str(again), "--json"])
    assert again.read_bytes() == kept.read_bytes()


def test_what_is_out_of_range_is_refused_in_the_words_of_the_command_line():
    scenario = scenarios.load("hold", {"plant.engine": "lagrangian"})
    with driven(scenario) as (_, page), Browser((800, 600)) as browser:
        tab = opened(browser, page)
        tab.click("text=law")
        write(tab, "period_s", "-1")
        tab.click("text=Set gains")
        tab.wait_for("document.body.innerText.includes('controller.period_s: expected')")
        with pytest.raises(InputError) as refusal:
            scenarios.load("hold", {"plant.engine": "lagrangian", "controller.period_s": -1})
        shown = tab.evaluate("document.body.innerText")
        assert str(refusal.value).partition("controller.period_s")[2] in shown
        assert errors(tab) == []
