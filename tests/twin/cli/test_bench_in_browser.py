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
from spheretwin.bench.operators import Operators, SILENCE_s
from spheretwin.cli.bench import choices_of
from spheretwin.models.kinematics import rotation
from spheretwin.viz.bench import server
from spheretwin.viz.bench.page import Page
from tests.browser import Browser, needs_a_browser
from tests.viz.bench.on_page import STATUS, at_rest, choose, errors, on_screen, opened, show_tab, write
from tests.waiting import UNLIMITED_S, wait_for

pytestmark = [
    needs_a_browser,
    pytest.mark.release(
        "browser, 6 to 70 s; tests/twin/bench has the same commands and refusals without one"
    ),
]

LAGRANGIAN = {"plant.engine": "lagrangian"}


@contextlib.contextmanager
def driven(name="hold", fields=LAGRANGIAN, size=(1280, 800)):
    """A bench, its page that follows, and a tab of a browser; on a busy machine a page is silent for long."""
    ended = threading.Event()
    with (
        Bench(scenarios.load(name, fields), Operators(silence_s=UNLIMITED_S)) as bench,
        Page(bench, choices_of(bench), server.listen(0)) as page,
    ):
        bench.begin()
        following = threading.Thread(target=page.show, args=(ended.is_set,))
        following.start()
        try:
            with Browser(size) as browser:
                yield bench, page, opened(browser, page)
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
    telemetry_path = tmp_path / "bench.parquet"
    with driven("sinusoid") as (bench, page, tab):
        says(tab, "TRAJECTORY", "PAUSED", "afsm")

        show_tab(tab, "files")
        write(tab, "recording", "")
        write(tab, "telemetry", str(telemetry_path))
        tab.click("text=Record from now on")
        until(bench, lambda state: state.recording == (str(telemetry_path),))
        tab.click("text=start")
        until(bench, lambda state: state.t_s > 0.2)
        says(tab, "RUNNING", "recording on")

        show_tab(tab, "law")
        choose(tab, "law", "computed_torque")
        until(bench, lambda state: state.law == "computed_torque")
        says(tab, "computed_torque")
        show_tab(tab, "twin")
        write(tab, "load", "0.2")
        tab.click("text=Set")
        until(bench, lambda state: ("disturbance.load", 0.2) in [field[:2] for field in bench.fields()])

        show_tab(tab, "move")
        tab.click("text=hold")
        until(bench, lambda state: state.mode == "hold")
        # The shaft was held wherever it was: there, a drag may end 20 mrad away, or cross a notice.
        here = np.zeros(3)
        bench.do("point", UNLIMITED_S, pose_rad=here)
        until(bench, lambda state: np.abs(np.array(state.q_ref_rad) - here).max() < 1e-6)
        at_rest(page, tab)
        there = here + [0.35, 0.1, 0.0]
        tab.drag(on_screen(page, tab, tip_m(bench, here)), on_screen(page, tab, tip_m(bench, there)))
        # A pixel is 5 mrad of the shaft as the page comes up, seen from ahead; here it is seen at a slant.
        until(bench, lambda state: np.abs(np.array(state.q_ref_rad) - there).max() < 2e-2)
        assert bench.state().mode == "point"
        says(tab, "POINT")
        picture = tab.screenshot(Path(os.environ.get("SPHERETWIN_PICTURES", tmp_path)) / "bench.png")
        assert picture.stat().st_size > 20_000  # more than one colour

        show_tab(tab, "faults")
        tab.click("text=Add from now on")
        until(bench, lambda state: state.faults and state.faults[0].startswith("coil.00 open"))
        tab.wait_for("document.body.innerText.includes('coil.00 open from')")

        tab.key(" ")
        until(bench, lambda state: state.stopped)
        says(tab, "STOPPED")
        says(tab, "OFF")
        until(bench, lambda state: not np.any(state.current_command_A))
        show_tab(tab, "files")
        tab.click("text=Stop and complete the files")
        until(bench, lambda state: state.completed_files == (str(telemetry_path),))
        assert errors(tab) == []
        assert tab.outside == []
    again = tmp_path / "again.parquet"
    cli.main(["simulate", "--replay", str(telemetry_path), "--telemetry", str(again), "--json"])
    assert again.read_bytes() == telemetry_path.read_bytes()


# The page's own thread does nothing else, as if the browser had frozen; its sockets stay open.
FREEZE = "setTimeout(() => { while (true); }, 0)"


def test_a_frozen_page_is_lost_and_the_twin_holds():
    with driven() as (bench, page, tab):
        for name, arguments in (("start", {}), ("jog", {"rates_rad_s": [0.0, 0.0, 0.5]})):
            assert bench.command(name, **arguments).wait(None) == "done"
        tab.evaluate(f"{FREEZE}, true")
        # Only now: a page of a busy machine is silent for long, too.
        bench._bench_state.operators._silence_s = SILENCE_s
        until(bench, lambda state: state.operator is None)
        until(bench, lambda state: state.mode == "hold")
        assert bench.state().note == "the operator is gone: the twin holds"
        assert page._server.get_clients()  # it has not left


def test_a_rotor_that_is_let_go_stays_on_the_bench_and_the_currents_return_to_zero():
    with driven(fields={**LAGRANGIAN, "plant.payload_kg": 0.05}) as (bench, page, tab):
        tab.click("text=start")
        tab.click("text=manual currents: or click a coil")
        tab.click("text=Only this group, at 1 A")
        until(bench, lambda state: state.mode == "manual" and state.t_s > 0.3)
        handles = page._server.gui._gui_input_handle_from_uuid.values()
        (current,) = [handle for handle in handles if getattr(handle, "label", "") == "00, A"]
        wait_for(lambda: current.value == 1.0)
        tab.click("[data-mode=off]")
        wait_for(lambda: current.value == 0.0)
        off_s = bench.state().t_s
        until(bench, lambda state: state.t_s > off_s + 2.5)
        assert (bench.state().mode, bench.state().status) == ("off", "running")
        assert not np.any(bench.state().current_command_A)
        tab.click("text=hold")
        until(bench, lambda state: state.mode == "hold")
