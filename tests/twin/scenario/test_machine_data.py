"""Border of machine and electronics: a hardware set never replaces a value of the model file."""

import json
import re

import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.active_config import initial_config, warnings_of
from spheretwin.machine.link.limits import Limits
from spheretwin.machine.link.machine_link import Link, LinkSettings
from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.scenario.hardware import HARDWARE, amplifier_limit_A
from spheretwin.session import Session

NUMBERS = {"group_resistance_ohm": 50.0, "group_inductance_H": 0.03, "group_current_limit_A": 0.2}


def model_file(folder, **changes):
    """Write the shipped model with other numbers of a group; return its path."""
    text = actuators.MJCF_PATH.read_text()
    for name, value in (NUMBERS | changes).items():
        text, count = re.subn(rf'name="{name}" data="[^"]*"', f'name="{name}" data="{value}"', text)
        assert count == 1, name
    (path := folder / "mine.xml").write_text(
        text.replace('meshdir="assets"', f'meshdir="{actuators.FOLDER}/assets"')
    )
    return str(path)


def resolved(path, hardware, **changes):
    scenario = scenarios.load(
        "hold",
        {"plant.mjcf": path, "hardware": hardware, **{k.replace("__", "."): v for k, v in changes.items()}},
    )
    return scenario, initial_config(scenario, None, None)


@pytest.mark.parametrize("hardware", HARDWARE)
def test_resistance_inductance_and_a_smaller_limit_are_those_of_the_model_file(tmp_path, hardware):
    scenario, config = resolved(model_file(tmp_path), hardware)
    for section in (config.scenario.drive, config.scenario.nominal):
        values = (section.resistance_ohm, section.inductance_H, section.current_limit_A)
        assert values == tuple(NUMBERS.values())
    lines = [line for line in warnings_of(scenario, config.files) if "current limit" in line]
    assert len(lines) == (hardware != "ideal")
    assert all("0.2 A of the model file and 8 A of hardware" in line for line in lines)


@pytest.mark.parametrize(
    ("model_A", "given", "limit_A", "warns"),
    [(12.0, {}, 8.0, True), (8.0, {}, 8.0, False), (0.2, {"drive__current_limit_A": 0.3}, 0.3, False)],
)
def test_the_smaller_limit_holds_unless_a_field_states_one(tmp_path, model_A, given, limit_A, warns):
    path = model_file(tmp_path, group_current_limit_A=model_A)
    scenario, config = resolved(path, "electronics", **given)
    assert config.scenario.drive.current_limit_A == limit_A
    assert any("current limit" in line for line in warnings_of(scenario, config.files)) == warns


def test_no_set_states_what_belongs_to_the_machine():
    machine = ("resistance_ohm", "inductance_H", "current_limit_A", "inertia_kg_m2", "heat_capacity_J_K")
    for fields in HARDWARE.values():
        assert not [name for name in fields if name.rpartition(".")[2] in machine]
    assert [amplifier_limit_A(name) for name in HARDWARE] == [float("inf"), 8.0, 8.0]


@pytest.mark.parametrize(
    ("hardware", "limit_A", "origin"),
    [
        ("ideal", 0.2, "model file: group_current_limit_A"),
        ("prototype", 0.2, "model file: group_current_limit_A"),
        (
            "prototype",
            9.0,
            "hardware prototype: data sheet of the OPA549, continuous, below 9 A of the model file",
        ),
    ],
)
def test_explain_states_which_of_both_a_value_came_from(tmp_path, capsys, hardware, limit_A, origin):
    path = model_file(tmp_path, group_current_limit_A=limit_A)
    (tmp_path / "own.toml").write_text(
        f'name = "own"\nhardware = "{hardware}"\n[trajectory]\nshape = "sinusoid"\n[plant]\nmjcf = "{path}"\n'
    )
    assert cli.main(["explain", "scenario", str(tmp_path / "own.toml"), "--json"]) == 0
    facts = {fact["field"]: fact["origin"] for fact in json.loads(capsys.readouterr().out)["fields"]}
    assert facts["drive.current_limit_A"] == facts["nominal.current_limit_A"] == origin
    assert facts["drive.resistance_ohm"] == "model file: group_resistance_ohm"
    if hardware == "prototype":
        assert facts["drive.supply_V"].startswith("hardware prototype: ")


def test_a_torque_field_skips_the_errors_that_it_cannot_have_by_name():
    scenario = scenarios.load("ventusff", {"hardware": "prototype"})
    config = initial_config(scenario, None, None)
    plant = config.scenario.plant
    assert (plant.poles.gain_error, plant.poles.angle_error_rad, plant.coils.distance_error_m) == (
        0.0,
        0.0,
        0.0,
    )
    assert plant.coils.gain_error == HARDWARE["prototype"]["plant.coils.gain_error"]
    (line,) = [line for line in warnings_of(scenario, config.files) if "torque field" in line]
    assert "plant.poles.gain_error" in line
    with pytest.raises(InputError, match="received errors of poles"):  # of the user's are not skipped
        Session(scenarios.load("ventusff", {"plant.poles.gain_error": 0.01}))


@pytest.mark.parametrize(("changes", "limit_A"), [({"nominal.current_limit_A": 9.0}, 9.0), ({}, 8.0)])
def test_a_link_is_not_armed_with_a_limit_above_that_of_the_model_file(changes, limit_A):
    scenario = scenarios.load("hold", changes)
    limits = Limits(current_A=9.0)
    with Link.open("udp://127.0.0.1:9", scenario, LinkSettings(), limits):  # a dry run sends no current
        pass
    armed = LinkSettings(armed=True)
    if limit_A > 8.0:
        with pytest.raises(InputError, match="at most 8 A, that of the model file, to arm, received 9 A"):
            Link.open("udp://127.0.0.1:9", scenario, armed, limits)
    else:
        Link.open("udp://127.0.0.1:9", scenario, armed, limits).channel.transport.close()
