"""Border of machine and electronics: a hardware set never replaces a value of the model file."""

import json

import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.config.config_warnings import warnings_of
from spheretwin.machine.link.limits import LinkSettings, MachineLimits
from spheretwin.machine.link.machine_link import Link
from spheretwin.models.base.errors import InputError
from spheretwin.models.coil_group import HEAT
from spheretwin.scenario.hardware import HARDWARE, MODEL_FILE, PER_GROUP, amplifier_limit_A
from spheretwin.session import Session
from tests.twin import model_files

NUMBERS = {"group_resistance_ohm": 50.0, "group_inductance_H": 0.03, "group_current_limit_A": 0.2}


THERMAL = {
    "group_resistance_per_K": 0.004,
    "group_heat_capacity_J_K": [30.0] * 17 + [31.0],
    "group_thermal_resistance_K_W": [8.0] * 17 + [9.0],
    "group_temperature_limit_degC": [130.0] * 17 + [120.0],
}


def model_file(folder, **changes):
    return model_files.model_file(folder, **NUMBERS | changes)


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


@pytest.mark.parametrize("hardware", HARDWARE)
def test_thermal_data_are_those_of_the_model_file_unless_a_field_states_them(tmp_path, hardware):
    path = model_file(tmp_path, **THERMAL)
    _, config = resolved(path, hardware, drive__thermal_resistance_K_W=2.0)
    drive, stated = config.scenario.drive, iter(THERMAL.values())
    assert (drive.resistance_per_K, list(drive.heat_capacity_J_K)) == (next(stated), next(stated))
    assert (drive.thermal_resistance_K_W, list(drive.shutdown_degC)) == (2.0, [*stated][-1])


@pytest.mark.parametrize("hardware", HARDWARE)
def test_thermal_data_of_stator_and_rotor_are_those_of_the_model_file(tmp_path, hardware):
    stated = {name: (low if low > 0 else -0.003) * 1.5 for name, (low, _) in HEAT.items()}
    stated["magnet_temperature_limit_degC"] = 65.0
    _, config = resolved(model_file(tmp_path, **stated), hardware, plant__thermal__air_gap_K_W=3.0)
    heat = config.scenario.plant.thermal
    fields = {number: getattr(heat, dotted.rpartition(".")[2]) for dotted, number in MODEL_FILE.items()
              if number in HEAT}  # fmt: skip
    assert fields == stated | {"air_gap_K_W": 3.0}


def test_thermal_data_that_no_one_states_are_assumed_with_the_set(tmp_path):
    path = model_file(tmp_path)
    for hardware, per_K, shutdown_degC in (("ideal", 0.0, None), ("prototype", 0.0039, 155.0)):
        drive = resolved(path, hardware)[1].scenario.drive
        assert (drive.resistance_per_K, drive.shutdown_degC) == (per_K, shutdown_degC)
        assert (drive.heat_capacity_J_K, drive.thermal_resistance_K_W) == (60.0, 4.0)


def test_of_several_current_limits_the_smallest_holds_for_all_groups_and_the_run_says_so(tmp_path):
    scenario, config = resolved(model_file(tmp_path, group_current_limit_A=[0.3] * 17 + [0.25]), "ideal")
    assert config.scenario.drive.current_limit_A == config.scenario.nominal.current_limit_A == 0.25
    assert "the current limit of all groups is 0.25 A" in "\n".join(warnings_of(scenario, config.files))


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
    machine = (*PER_GROUP, "current_limit_A", "inertia_kg_m2")
    for fields in HARDWARE.values():
        assert not [name for name in fields if name.startswith("drive.") and name[6:] in machine]
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
    path = model_file(tmp_path, group_current_limit_A=limit_A, group_heat_capacity_J_K=[30.0] * 17 + [31.0])
    (tmp_path / "own.toml").write_text(
        f'name = "own"\nhardware = "{hardware}"\n[trajectory]\nshape = "sinusoid"\n[plant]\nmjcf = "{path}"\n'
    )
    assert cli.main(["explain", "scenario", str(tmp_path / "own.toml"), "--all", "--json"]) == 0
    facts = {fact["field"]: fact["origin"] for fact in json.loads(capsys.readouterr().out)["fields"]}
    assert facts["drive.current_limit_A"] == facts["nominal.current_limit_A"] == origin
    assert facts["drive.resistance_ohm"] == "model file: group_resistance_ohm"
    assert facts["drive.heat_capacity_J_K"] == "model file: group_heat_capacity_J_K"
    assert facts["drive.thermal_resistance_K_W"] == "default: assumed"
    assert facts["plant.thermal.air_gap_K_W"] == "default: assumed: 1 to 2 mm of air on 0.03 m²"
    if hardware == "prototype":
        assert facts["drive.shutdown_degC"] == "hardware prototype: assumed: insulation of class F"
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
    limits = MachineLimits(current_A=9.0)
    with Link.open("udp://127.0.0.1:9", scenario, LinkSettings(), limits):  # a dry run sends no current
        pass
    armed = LinkSettings(armed=True)
    if limit_A > 8.0:
        with pytest.raises(InputError, match="at most 8 A, that of the model file, to arm, received 9 A"):
            Link.open("udp://127.0.0.1:9", scenario, armed, limits)
    else:
        Link.open("udp://127.0.0.1:9", scenario, armed, limits).channel.transport.close()


@pytest.mark.parametrize(("highest_degC", "limit_degC"), [(120.0, 90.0), (80.0, 80.0)])
def test_a_link_removes_the_currents_at_the_lowest_temperature_limit(tmp_path, highest_degC, limit_degC):
    path = model_file(tmp_path, group_temperature_limit_degC=[130.0] * 17 + [90.0])
    limits = MachineLimits(current_A=0.1, temperature_degC=highest_degC)
    with Link.open("udp://127.0.0.1:9", scenarios.load("hold", {"plant.mjcf": path}), limits=limits) as link:
        assert link._limits.temperature_degC == limit_degC
