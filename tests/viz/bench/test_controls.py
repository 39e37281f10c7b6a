"""Controls of the page: initial values, limits and choices; lists of faults and snapshots."""

import numpy as np
import pytest

from spheretwin.viz.bench.modes_tab import FASTEST_JOG_DEG_S
from spheretwin.viz.bench.page import SPEEDS
from tests.viz.bench import fake
from tests.waiting import wait_for

AXES = "αβγ"


@pytest.fixture
def controls(page):
    """Controls by their labels; of several with one label the first."""
    found = {}
    for handle in page._server.gui._gui_input_handle_from_uuid.values():
        found.setdefault(handle.label, handle)
    return found


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
        ("speed", tuple(SPEEDS), "1×"),
        ("shape", fake.CHOICES.shapes, "hold"),
        ("restart with", fake.CHOICES.scenarios, fake.CHOICES.scenarios[0]),
        ("law", fake.CHOICES.laws, "afsm"),
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


def test_speeds_are_the_factors_of_their_names():
    for name, factor in SPEEDS.items():
        assert factor == (1e6 if name == "as fast as possible" else float(name.removesuffix("×")))


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


def test_curves_and_currents_are_those_of_the_bench(page, bench):
    wait_for(lambda: "at most 2.00 A" in page._currents.content)
    low, high = bench.bounds()
    wait_for(lambda: len(page._plots._error.data[0]) == len(low["t_s"]))
    t_s, *bounds = page._plots._error.data
    np.testing.assert_allclose(t_s, low["t_s"])
    for axis in range(3):
        np.testing.assert_allclose(bounds[2 * axis], 1e3 * low["error_rad"][:, axis])
        np.testing.assert_allclose(bounds[2 * axis + 1], 1e3 * high["error_rad"][:, axis])
    assert not page._plots._temperature.visible
    for t_s, temperature_C in ((2.0, 41.0), (3.0, 43.0)):
        bench.now.temperature_C, bench.now.t_s = (20.0, temperature_C), t_s
        wait_for(lambda t_s=t_s: page._shown_s == t_s)
    wait_for(lambda: page._plots._temperature.visible)
    assert [column.tolist() for column in page._plots._temperature.data] == [[2.0, 3.0], [41.0, 43.0]]
