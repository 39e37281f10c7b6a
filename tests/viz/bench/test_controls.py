"""Controls of the page: initial values, limits and choices; lists of faults and snapshots."""

import numpy as np
import pytest

from spheretwin.viz.bench.modes_tab import FASTEST_JOG_DEG_S
from tests.viz.bench import fake
from tests.waiting import wait_for

AXES = "αβγ"


@pytest.fixture
def controls(page):
    """Controls by their labels; of several with one label the first."""
    results = {}
    for handle in page._server.gui._gui_input_handle_from_uuid.values():
        results.setdefault(handle.label, handle)
    return results


def test_sliders_have_the_limits_of_their_quantities(controls, bench):
    limit_A = bench.actuator.group.current_limit_A
    ranges = {
        **{f"{axis}, °/s": (-FASTEST_JOG_DEG_S, FASTEST_JOG_DEG_S) for axis in AXES},
        **{f"{group:02}, A": (-limit_A, limit_A) for group in range(fake.GROUPS)},
        "group": (0, fake.GROUPS - 1),
    }
    for axis, hinge in zip(AXES, np.degrees(bench.actuator.hinge_range_rad), strict=True):
        ranges[f"{axis}, °"] = tuple(np.round(np.clip(hinge, -180, 180)))
    for label, (low, high) in ranges.items():
        assert (controls[label].min, controls[label].max) == (low, high), label
        if not label.endswith(", °"):  # which follow the twin
            assert controls[label].value == 0, label


def test_sliders_of_angles_show_the_desired_pose(controls, bench):
    for axis, angle in zip(AXES, bench.now.q_ref_rad, strict=True):
        slider = controls[f"{axis}, °"]
        wait_for(
            lambda slider=slider, angle=angle: slider.value == pytest.approx(np.degrees(angle), abs=0.05)
        )


def test_lists_have_the_choices_and_the_active_one(controls):
    for label, options, value in (
        ("shape", fake.CHOICES.shapes, "hold"),
        ("restart with", fake.CHOICES.scenarios(), fake.CHOICES.scenarios()[0]),
        ("law", fake.CHOICES.laws(), "afsm"),
        ("target", tuple(fake.CHOICES.targets), "coil.00"),
        ("section", ("plant",), "plant"),
    ):
        assert (tuple(controls[label].options), controls[label].value) == (options, value), label
    for label, value in (
        ("rate, rad/s", fake.CHOICES.limits[0]),
        ("acceleration, rad/s²", fake.CHOICES.limits[1]),
        ("recording", "bench.rrd"),
        ("telemetry", "bench.parquet"),
        ("stiffness", "4 4 4"),
        ("known", True),
        ("load", "0"),
        ("step_s", "0.0005"),
    ):
        assert controls[label].value == value, label


def test_faults_are_listed_as_text_from_0_on(page, bench):
    box = page._faults_tab._list
    wait_for(lambda: "no faults" in box.content)
    bench.now.faults = ("coil.00 open", "<b>adc</b> noise")
    wait_for(lambda: "<li>coil.00 open</li><li>&lt;b&gt;adc&lt;/b&gt; noise</li>" in box.content)
    assert 'start="0"' in box.content
    bench.now.faults = ()
    wait_for(lambda: "no faults" in box.content)


def test_snapshots_can_be_chosen_when_there_are_some(page, bench, controls):
    buttons = controls["restore"]
    assert not buttons.visible
    bench.now.snapshots = ("first", "second")
    wait_for(lambda: buttons.visible)
    assert tuple(buttons.options) == ("first", "second")
    bench.now.snapshots = ()
    wait_for(lambda: not buttons.visible)


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


def test_the_pose_as_numbers_follows_the_desired_pose(page, bench):
    for axis, angle in zip(AXES, bench.now.q_ref_rad, strict=True):
        line = page._modes_tab._pose._lines[f"pose.exact {axis}, °"]
        wait_for(lambda line=line, angle=angle: line.value == f"{np.degrees(angle):.2f}")
