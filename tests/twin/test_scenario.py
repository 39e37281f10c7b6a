"""Scenarios: shipped ones, files, overrides, and complaints in one line."""

import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.errors import InputError
from spheretwin.twin import flags
from spheretwin.twin import scenario as scenarios


def test_shipped_scenarios_load_under_their_names():
    assert scenarios.shipped() == ["hold", "nutation", "sinusoid", "tilt"]
    for name in scenarios.shipped():
        assert scenarios.load(name).name == name


def test_nutation_is_the_paper_s_case():
    scenario = scenarios.load("nutation")
    assert (scenario.plant.modelling_error, scenario.disturbance.load) == (0.2, 2.0)
    assert scenario.plant.modelling_torque_Nm == (0.002, 0.001, 0.001)
    assert (scenario.duration, scenario.ticks, scenario.substeps) == (5.0, 5000, 2)


def test_physics_step_is_the_one_the_model_file_opens_with():
    assert mjcf.read(actuators.MJCF_PATH).described.opt.timestep == scenarios.load("hold").plant.step_s


def test_file_and_overrides(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('duration = 2\n[trajectory]\nshape = "hold"\nangle_rad = [0, 0, 1]\n')
    scenario = scenarios.load(str(path), {"controller.law": "pd", "seed": 3})
    assert (scenario.duration, scenario.controller.law, scenario.seed) == (2.0, "pd", 3)
    assert scenario.trajectory.angle_rad == (0.0, 0.0, 1.0)


def test_flags_reach_every_field():
    values = {
        "drive.current-limit-A": "4", "plant.initial-rad": "0 0 0.1", "plant.mjcf": "7.xml", "name": "12",
    }  # fmt: skip
    tokens = [part for flag, value in values.items() for part in (f"--{flag}", *value.split())]
    assert flags.overrides(tokens) == {
        "drive.current_limit_A": 4, "plant.initial_rad": [0, 0, 0.1], "plant.mjcf": "7.xml", "name": "12",
    }  # fmt: skip
    listed = {flag for flag, *_ in flags.described(scenarios.load("nutation"))}
    assert {f"--{flag}" for flag in values} < listed


@pytest.mark.parametrize(
    ("overrides", "parts"),
    [
        ({"controller.law": "pid"}, ["controller.law", "'pd'", "'afsm'", "'pid'"]),
        ({"controler.law": "pd"}, ["controller", "plant", "controler"]),
        ({"plant.colour": 1}, ["modelling_error", "plant", "colour"]),
        ({"trajectory.colour": 1}, ["beta_growth_rad_s", "trajectory", "colour"]),
        ({"trajectory.shape": "spiral"}, ["trajectory", "nutation", "spiral"]),
        ({"duration": float("nan")}, ["duration", "finite", "nan"]),
        ({"duration": float("inf")}, ["duration", "finite", "inf"]),
        ({"duration": -1.0}, ["duration", "greater than 0", "-1"]),
        ({"duration": 1e-9}, ["duration", "control period"]),
        ({"duration": 1e9}, ["duration", "control period"]),
        ({"duration": "long"}, ["duration", "number", "long"]),
        ({"seed": 1.5}, ["seed", "integer", "1.5"]),
        ({"seed": True}, ["seed", "integer", "True"]),
        ({"plant.payload_kg": -0.1}, ["payload_kg", "0", "-0.1"]),
        ({"plant.modelling_error": -1.0}, ["modelling_error", "-1"]),
        ({"drive.current_limit_A": 0}, ["current_limit_A", "greater than 0", "0"]),
        ({"controller.period_s": 7e-4}, ["whole multiple", "0.0007", "0.0005"]),
        ({"controller.period_s": 1e-4}, ["whole multiple", "0.0001", "0.0005"]),
        ({"plant.initial_rad": [1, 2]}, ["initial_rad"]),
        ({"disturbance.load": 1e300}, ["load", "1000"]),
        ({"seed.deep": 1}, ["seed.deep"]),
    ],
)
def test_bad_input_is_told_in_one_line(overrides, parts):
    with pytest.raises(InputError) as caught:
        scenarios.load("nutation", {"seed": 0, **overrides})
    message = str(caught.value)
    assert "\n" not in message
    for part in parts:
        assert part in message


@pytest.mark.parametrize(
    ("source", "text", "part"),
    [
        ("spiral", None, "hold, nutation, sinusoid, tilt"),
        ("missing.toml", None, "missing.toml"),
        ("broken.toml", "duration = = 2", "TOML"),
        ("empty.toml", "", "trajectory"),
    ],
)
def test_bad_source_is_told_in_one_line(tmp_path, monkeypatch, source, text, part):
    monkeypatch.chdir(tmp_path)
    if text is not None:
        (tmp_path / source).write_text(text)
    with pytest.raises(InputError, match=part) as caught:
        scenarios.load(source)
    assert "\n" not in str(caught.value)
