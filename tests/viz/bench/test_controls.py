"""Controls of the page follow commands of others; the list of faults is no markup."""

import numpy as np
import pytest

from tests.waiting import wait_for


@pytest.fixture
def controls(page):
    """Controls by their labels; of several with one label the first."""
    results = {}
    for handle in page._server.gui._gui_input_handle_from_uuid.values():
        results.setdefault(handle.label, handle)
    return results


def test_faults_are_listed_as_text_from_0_on(page, bench):
    box = page._faults_tab._list
    wait_for(lambda: "no faults" in box.content)
    bench.now.faults = ("coil.00 open", "<b>adc</b> noise")
    wait_for(lambda: "<li>coil.00 open</li><li>&lt;b&gt;adc&lt;/b&gt; noise</li>" in box.content)
    assert 'start="0"' in box.content
    bench.now.faults = ()
    wait_for(lambda: "no faults" in box.content)


def test_controls_follow_commands_from_elsewhere(controls, bench):
    bench.now.limits = (0.7, 9.0)
    bench.now.mode, bench.now.jog_rates_rad_s = "jog", (0.0, np.radians(12.0), 0.0)
    wait_for(lambda: controls["rate, rad/s"].value == 0.7)
    wait_for(lambda: controls["acceleration, rad/s²"].value == 9.0)
    wait_for(lambda: controls["β, °/s"].value == 12.0)
    bench.now.mode, bench.now.pose_rad = "point", (0.2, -0.3, 0.5)  # of a script
    wait_for(lambda: controls["β, °"].value == round(np.degrees(-0.3), 1))
    bench.now.pose_rad = None
    bench.now.mode, bench.now.manual_currents_A = "manual", (0.0,) * 3 + (1.25,) + (0.0,) * 14
    wait_for(lambda: (controls["03, A"].value, controls["β, °/s"].value) == (1.25, 0.0))
    bench.now.mode = "replay"
    bench.now.replay_file, bench.now.replay_range_s, bench.now.t_s = "/other/run.rrd", (1.0, 7.0), 3.5
    scrubber = controls["time, s"]
    wait_for(lambda: scrubber.visible)
    wait_for(lambda: (scrubber.min, scrubber.max, scrubber.value) == (1.0, 7.0, 3.5))
    wait_for(lambda: controls["file"].value == "/other/run.rrd")
    wait_for(lambda: controls["03, A"].value == 0.0)  # a mode ended
