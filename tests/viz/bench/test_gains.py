"""Gains: sliders that follow, undo, and the comparison of two settings by their errors."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from spheretwin.viz.bench import gains
from spheretwin.viz.bench.gains import GainHistory, GainSliders
from spheretwin.viz.bench.protocols import FieldSetting
from tests.viz.bench import fake
from tests.waiting import wait_for

STIFFNESS = FieldSetting("controller.stiffness", "4 4 4", "1 1 1", "N·m/rad", range=(0.0, 8.0))
LAYER = FieldSetting("controller.layer", "0.1", "0.1", "layer", range=(0.0, 0.4))


@pytest.fixture
def applied():
    return []


def apply_to(applied):
    return lambda event, name, text: applied.append((name, text))


def test_sliders_follow_and_their_range_includes_the_value(page, applied):
    sliders = GainSliders(page._server.gui, apply_to(applied))
    sliders.show([STIFFNESS, LAYER])
    (alpha, *_), (layer,) = (sliders._sliders[of.name] for of in (STIFFNESS, LAYER))
    assert (alpha.min, alpha.max, alpha.value, layer.value) == (0.0, 8.0, 4.0, 0.1)

    def values():
        sliders.show([replace(STIFFNESS, text="5 6 7"), LAYER])
        return [slider.value for slider in sliders._sliders[STIFFNESS.name]]

    wait_for(lambda: values() == [5.0, 6.0, 7.0])  # one that was just changed is left alone at first
    assert sliders._sliders[STIFFNESS.name][0] is alpha
    sliders.show([replace(STIFFNESS, text="30 6 7"), LAYER])  # of a script
    assert [slider.max for slider in sliders._sliders[STIFFNESS.name]] == [32.0] * 3
    assert applied == []


def test_axes_move_together_if_they_are_linked(page, applied):
    sliders = GainSliders(page._server.gui, apply_to(applied))
    sliders.show([STIFFNESS])
    sliders._sliders[STIFFNESS.name][1].value = 6.5
    sliders._moved(STIFFNESS.name, 1, None)
    sliders._linked.value = True
    sliders._moved(STIFFNESS.name, 1, None)
    assert applied == [(STIFFNESS.name, "4 6.5 4"), (STIFFNESS.name, "6.5 6.5 6.5")]


class Buttons:
    """GUI whose buttons a test presses."""

    def __init__(self):
        self.acts = []

    def add_button(self, *_, **__):
        return self

    add_button_group = add_button

    def add_html(self, content):
        return SimpleNamespace(content=content)

    def on_click(self, act):
        self.acts.append(act)


def press(history, name, value=None):
    getattr(history, name)(SimpleNamespace(client_id=0, target=SimpleNamespace(value=value)))


def test_undo_returns_to_the_values_before_each_gesture(applied, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(gains.time, "monotonic", lambda: now[0])
    history = GainHistory(Buttons(), fake.Bench(), apply_to(applied))
    history.show([STIFFNESS, LAYER])
    for number in (5, 6, 7):  # one slider, slid
        now[0] += 0.1
        history.note(STIFFNESS.name)
        history.show([replace(STIFFNESS, text=f"{number} 4 4"), LAYER])
    history.note(LAYER.name)
    history.show([replace(STIFFNESS, text="7 4 4"), replace(LAYER, text="0.3")])
    press(history, "_on_undo")
    press(history, "_on_undo")
    press(history, "_on_undo")
    assert applied == [(LAYER.name, "0.1"), (STIFFNESS.name, "4 4 4")]


class Moving(fake.Bench):
    """Bench whose error has one length for each number of the run."""

    error_rad = 0.0

    def bins(self, after=-1):
        bins = super().bins(after)
        bins.rows["error_rad"][:] = self.error_rad / np.sqrt(3)
        bins.rows["t_s"][:] = self.now.t_s
        return bins


def test_each_of_two_settings_has_the_error_of_its_own_time(applied):
    bench = Moving()
    history = GainHistory(Buttons(), bench, apply_to(applied))
    stiff = replace(STIFFNESS, text="9 9 9")

    def run(settings, error_rad):
        history.show([settings, LAYER])  # from now on
        bench.now.t_s += 0.5
        bench.error_rad, bench.run = 1.0, bench.run + 1
        history.show([settings, LAYER])  # it settles: not counted
        bench.now.t_s += 10.0
        bench.error_rad, bench.run = error_rad, bench.run + 1
        history.show([settings, LAYER])

    history.show([STIFFNESS, LAYER])
    press(history, "_on_compare", "store A")
    run(STIFFNESS, 2e-3)
    history.show([stiff, LAYER])
    press(history, "_on_compare", "store B")
    run(stiff, 1e-3)
    assert (
        "A: RMS of |e| 2.000 mrad over 1 s<br>B: RMS of |e| 1.000 mrad over 1 s in use"
        in history._table.content
    )
    press(history, "_on_compare", "use A")
    assert applied == [(STIFFNESS.name, "4 4 4")]
