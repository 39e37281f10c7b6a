"""A scenario written down and read again is the same scenario."""

import shlex

import pytest

from spheretwin import scenario as scenarios
from spheretwin.scenario import reading
from spheretwin.scenario.reading import shipped
from spheretwin.scenario.writing import as_command, as_toml

CHANGES = {
    "nothing": {},
    "hardware": {"hardware": "electronics"},
    "part of it": {"hardware": "electronics", "sensors.adc.bits": 12, "estimator.kind": "difference"},
    "law": {"controller.law": "pid", "controller.stiffness": [1.0, 2.0, 3.0], "controller.period_s": 2e-3},
    "lists": {
        "fault": [
            {"target": "coil.07", "mode": "open", "start_s": 1.0},
            {"target": "coil.02", "mode": "gain", "value": 0.5},
        ],
        "event": [{"t_s": 1.0, "set": "disturbance", "value": {"load": 2.0}}],
        "disturbance.terms": [{"kind": "constant", "torque_Nm": [0.1, 0, 0]}],
        "hardware": "electronics",
    },
    "nested": {"trajectory": {"shape": "steps", "times_s": [1.0], "angles_rad": [[0.1, 0, 0]]}},
    "tables": {
        "trajectory": {
            "shape": "multisine",
            "components": [{"amplitude_rad": [0.1, 0, 0], "frequency_Hz": [1, 0, 0]}],
        }
    },
    "approach": {"trajectory.approach": {"start_s": 1.0, "angle_rad": [0.1, 0.0, 0.0]}},
    "by hand": {"manual.currents_A": 18 * [0.25]},
    "one of a list": {"plant.group_gain": [1.0] * 18, "name": 'a "b" \\ c', "description": "é, ∂"},
}


@pytest.mark.parametrize("name", shipped())
@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES)
def test_read_again_it_is_the_same(tmp_path, name, changes):
    scenario = scenarios.load(name, changes)
    path = tmp_path / "written.toml"
    path.write_text(as_toml(scenario), encoding="utf-8")
    assert scenarios.load(str(path)) == scenario
    verb, _, source, *words = shlex.split(as_command(scenario))
    assert verb == "spheretwin"
    assert scenarios.load(source, reading.overrides(words)) == scenario


def test_a_file_says_what_a_user_would_and_no_more():
    scenario = scenarios.load("sinusoid", {"controller.law": "pd", "hardware": "electronics"})
    text = as_toml(scenario)
    assert len(text.splitlines()) < 25
    assert "supply_V" not in text  # the named set says it
    assert as_command(scenario) == (
        "spheretwin simulate sinusoid --hardware electronics --controller.law pd --estimator.kind kalman"
    )


def test_a_field_without_a_value_that_the_named_set_gives_one_is_told_beside_the_others():
    scenario = scenarios.load("sinusoid", {"hardware": "electronics", "drive.supply_V": None})
    text = as_toml(scenario)
    assert 'hardware = "ideal"' in text
    assert "supply_V" not in text
    assert "dac_bits" in text
