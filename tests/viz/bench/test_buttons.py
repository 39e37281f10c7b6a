"""Every button sends one command with the values of its fields; shared controls do not move by themselves."""

from dataclasses import replace

import pytest

from spheretwin.viz.bench.event_handlers import Note
from spheretwin.viz.bench.protocols import FieldSetting
from spheretwin.viz.bench.settings_tab import Form
from tests.viz.bench.clients import changed, handle_of, page_socket
from tests.waiting import wait_for

BUTTONS = {
    "Hold": ("hold", {}),
    "Only this group, at 1 A": ("manual", {"group": 0, "current_A": 1.0}),
    "Replay": ("replay", {"file": "run.parquet"}),
    "Follow this trajectory": ("trajectory", {"fields": {"shape": "hold"}}),
    "Add from now on": ("add_fault", {"fault": {"target": "coil.00", "mode": "open"}}),
    "Clear all": ("clear_faults", {}),
    "Clear the fault at this place": ("clear_faults", {"place": 0}),
    "Record from now on": ("record", {"recording": "bench.rrd", "telemetry": "bench.parquet"}),
    "Stop and complete the files": ("keep", {}),
    "Load": ("load", {"source": "hold"}),
    "Save the present settings": ("save", {"file": "bench.toml"}),
    "Save a snapshot": ("snapshot", {"name": "last"}),
}

CHANGES = {
    "jog": ("β, °/s", 30.0, ("jog", {"rates_rad_s": pytest.approx([0.0, 0.5235988, 0.0], abs=1e-6)})),
    "manual": ("03, A", 0.5, ("manual", {"currents_A": [0.0] * 3 + [0.5] + [0.0] * 14})),
    "remote": ("remote", '["speed", {"factor": 0.5}]', ("speed", {"factor": 0.5})),
    "remote point": ("remote", '["enter", {"mode": "point"}]', ("point", {"pose_rad": [0.1, -0.1, 0.3]})),
    "remote jog": ("remote", '["enter", {"mode": "jog"}]', ("jog", {"rates_rad_s": [0.0] * 3})),
    "remote manual": ("remote", '["enter", {"mode": "manual"}]', ("manual", {"currents_A": [0.0] * 18})),
    "remote replay": ("remote", '["enter", {"mode": "replay"}]', ("replay", {"file": "run.parquet"})),
    "remote hold": ("remote", '["enter", {"mode": "hold"}]', ("hold", {})),
    "gain": ("stiffness β", 6.0, ("set", {"name": "controller.stiffness", "value": "4 6 4"})),
    "rate": ("rate, rad/s", 0.7, ("limits", {"rate_rad_s": 0.7})),
    "law": ("law", "pd", ("set", {"name": "controller.law", "value": "pd"})),
    "restore": ("restore", "before", ("restore", {"name": "before"})),
}


def test_each_button_is_one_command(page, bench):
    with page_socket(page) as visitor:
        for number, (label, expected) in enumerate(BUTTONS.items()):
            visitor.send(changed(handle_of(page, label), value=True))
            wait_for(lambda number=number: len(bench.commands()) > number)
            assert bench.commands()[number:] == [expected]


@pytest.mark.parametrize("change", CHANGES)
def test_each_change_is_one_command(page, bench, change):
    label, value, expected = CHANGES[change]
    bench.now.snapshots = ("last", "before")
    touched = page._server.gui._gui_input_handle_from_uuid[handle_of(page, label)]
    if label != "remote":  # which takes any text
        wait_for(lambda: value in getattr(touched, "options", [value]))  # else it is refused
    with page_socket(page) as visitor:
        visitor.send(changed(handle_of(page, label), value=value))
        wait_for(lambda: bench.commands() == [expected])


def test_a_form_begins_with_the_active_values(page):
    settings = [
        FieldSetting("plant.one_of_two", "Euler", "RK4", "a choice", ("RK4", "Euler")),
        FieldSetting("plant.yes_or_no", "true", "false", "a flag"),
        FieldSetting("plant.number", "0.25", "1", "a number"),
    ]
    Form(page._server.gui, "Apply", lambda event, fields: None).show(settings)
    known = page._server.gui._gui_input_handle_from_uuid
    values = [known[handle_of(page, label)].value for label in ("one_of_two", "yes_or_no", "number")]
    assert values == ["Euler", True, "0.25"]


def test_a_form_follows_the_active_values_and_keeps_a_change_in_progress(page):
    settings = [
        FieldSetting("plant.first_number", "1", "0", "a number"),
        FieldSetting("plant.second_number", "2", "0", "a number"),
    ]
    form = Form(page._server.gui, "Apply", lambda event, fields: None)
    form.show(settings)
    known = page._server.gui._gui_input_handle_from_uuid
    first, second = (known[handle_of(page, label)] for label in ("first_number", "second_number"))
    first.value = "7"  # not applied yet
    for text in ("20", "30"):
        form.show([replace(setting, text=text) for setting in settings])
        assert known[handle_of(page, "first_number")] is first
        assert (first.value, second.value) == ("7", text)


def test_reset_of_gains_sets_those_that_differ(page, bench):
    with page_socket(page) as visitor:
        visitor.send(changed(handle_of(page, "Reset gains to defaults"), value=True))
        wait_for(lambda: len(bench.commands()) == 2)
        assert bench.commands() == [
            ("set", {"name": "controller.stiffness", "value": "1 1 1"}),
            ("set", {"name": "controller.known", "value": "false"}),
        ]


def test_changes_of_a_watching_page_are_undone(page, bench):
    bench.now.operator = "another"
    name = handle_of(page, "save as")
    with page_socket(page) as visitor:
        visitor.send(changed(name, value="/etc/passwd"))
        visitor.send(changed(handle_of(page, "Save the present settings"), value=True))
        visitor.send(changed(handle_of(page, "remote"), value='["hold", {}]'))
        visitor.send(changed(handle_of(page, "remote"), value='["stop", {}]'))  # which is anybody's
        wait_for(lambda: bench.commands() == [("stop", {})])
    assert page._server.gui._gui_input_handle_from_uuid[name].value == "bench.toml"


def test_the_page_sends_no_command_without_an_event(page, bench):
    """Sliders follow the twin, forms what is in force: none of it is a person's."""
    with page_socket(page):
        wait_for(lambda: ("hello", "page 0", {}) in bench.told)
        bench.now.mode, bench.now.q_ref_rad = "trajectory", (0.5, 0.6, -0.7)
        slider = page._server.gui._gui_input_handle_from_uuid[handle_of(page, "γ, °")]
        wait_for(lambda: slider.value == pytest.approx(-40.1))
    assert bench.commands() == []


@pytest.mark.parametrize("text", ["expected a number", None])
def test_the_outcome_of_a_command_whose_field_was_removed_is_ignored(page, text):
    note = Note(page._server.gui, 1e6)
    note.remove()
    note.say(text)


def test_faults_are_listed_as_text_from_0_on(page, bench):
    box = page._faults_tab._list
    wait_for(lambda: "no faults" in box.content)
    bench.now.faults = ("coil.00 open", "<b>adc</b> noise")
    wait_for(lambda: "<li>coil.00 open</li><li>&lt;b&gt;adc&lt;/b&gt; noise</li>" in box.content)
    assert 'start="0"' in box.content
    bench.now.faults = ()
    wait_for(lambda: "no faults" in box.content)
