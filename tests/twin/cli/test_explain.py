"""Explanations of fields: values, units, distributions, origins against scenario, hardware and defaults."""

import json

import pytest

from spheretwin import cli
from spheretwin.active_config import initial_config
from spheretwin.scenario import load
from spheretwin.scenario.fields import every_field, fields_of, unit_of
from spheretwin.scenario.hardware import HARDWARE, ORIGINS
from spheretwin.scenario.sections import Scenario


def explained(capsys, *subject):
    assert cli.main(["explain", *subject, "--json"]) == cli.DONE
    out, err = capsys.readouterr()
    assert err == ""
    return {row["field"]: row for row in json.loads(out)["fields"]}


def test_a_hardware_set_has_every_value_with_its_origin(capsys):
    rows = explained(capsys, "hardware", "electronics")
    assert list(rows) == list(HARDWARE["electronics"])
    for name, value in HARDWARE["electronics"].items():
        given = rows[name]["value"]
        assert (tuple(given) if isinstance(given, list) else given) == value
        assert rows[name]["origin"] == ORIGINS["electronics"][name]
    assert rows["sensors.adc.bits"]["origin"] == "data sheet of the ADS8364"
    assert rows["drive.resistance_per_K"]["origin"] == "property of copper"
    assert rows["nominal.delay_s"]["origin"] == "computed from the values of the set"
    assert explained(capsys, "hardware", "ideal") == {}


def test_every_stated_origin_says_assumed_or_names_its_source():
    assert set(ORIGINS["electronics"]) < set(ORIGINS["prototype"])
    sources = ("assumed", "data sheet of the ", "property of ", "computed from the ")
    assert all(text.startswith(sources) for text in ORIGINS["prototype"].values())


@pytest.mark.parametrize(
    ("name", "unit", "distribution"),
    [
        ("sensors.adc.offset_V", "V", "uniform"),
        ("sensors.adc.noise_V", "V", "normal"),
        ("sensors.potentiometer.nonlinearity_rad", "rad", "sum of four harmonics"),
        ("sensors.current.noise_A", "A", "normal"),
        ("drive.amplifier_offset_V", "V", "uniform"),
        ("drive.dac_inl_lsb", "LSB", "sum of four harmonics"),
        ("plant.poles.gain_error", "", "uniform"),
        ("drive.supply_V", "V", ""),
        ("drive.thermal_resistance_K_W", "K/W", ""),
        ("plant.viscous_Nm_s", "N·m·s", ""),
    ],
)
def test_unit_and_distribution_of_a_field(capsys, name, unit, distribution):
    row = explained(capsys, name)[name]
    assert row["unit"] == unit
    assert row["distribution"].startswith(distribution)
    assert bool(row["distribution"]) == bool(distribution)


def test_a_section_has_the_rows_of_each_of_its_fields(capsys):
    assert cli.main(["explain", "sensors.adc", "--json"]) == cli.DONE
    rows = json.loads(capsys.readouterr().out)["fields"]
    for name, field in every_field(Scenario):
        values = [(row["value"], row["origin"]) for row in rows if row["field"] == name]
        if not name.startswith("sensors.adc."):
            assert values == []
            continue
        assert (field.default, "default") in values
        for hardware, defaults in HARDWARE.items():
            if name in defaults:
                assert (defaults[name], f"hardware {hardware}: {ORIGINS[hardware][name]}") in values


def test_each_drawn_error_states_its_distribution():
    """Fields whose meaning speaks of the seed or of noise, but for those of the controller and of inputs."""
    for name, field in every_field(Scenario):
        text = field.description or ""
        if name.startswith(("sensors.", "drive.", "plant.")) and ("from the seed" in text or " rms" in text):
            assert "distribution" in (field.json_schema_extra or {}), name


def test_units_are_those_of_the_meanings():
    """Where a meaning ends with a unit, or has one before its source, it is the unit of the name."""
    compared = 0
    for name, field in every_field(Scenario):
        stated = (field.description or "").partition(" (")[0].partition("; ")[0].rpartition(", ")[2]
        if not name.startswith("controller.") and stated in {
            "rad",
            "V",
            "A",
            "s",
            "N·m",
            "N·m·s",
            "kg",
            "m/s²",
            "rad/s",
            "°C",
            "1/K",
            "J/K",
            "K/W",
            "m",
        }:
            assert unit_of(name) == stated, name
            compared += 1
    assert compared > 50


def test_a_scenario_tells_what_it_sets_and_what_follows(capsys, tmp_path):
    rows = explained(capsys, "scenario", "tilt", "--all")
    resolved = initial_config(load("tilt"), None, None).scenario
    assert list(rows) == [dotted for dotted, *_ in fields_of(resolved)]
    assert rows["duration"]["origin"] == "scenario tilt"
    assert rows["plant.coulomb_Nm"]["origin"] == "default"
    assert rows["nominal.resistance_ohm"]["value"] == resolved.nominal.resistance_ohm
    assert rows["nominal.resistance_ohm"]["origin"].startswith("computed from the model file")
    assert all(row["meaning"] for name, row in rows.items())
    few = explained(capsys, "scenario", "tilt")
    assert few == {name: row for name, row in rows.items() if row["origin"] != "default"}
    path = tmp_path / "mine.toml"
    path.write_text(
        'name = "mine"\nhardware = "electronics"\n[trajectory]\nshape = "hold"\n[plant]\npayload_kg = 0.1\n'
    )
    own = explained(capsys, "scenario", str(path))
    assert own["plant.payload_kg"]["origin"] == "scenario mine"
    assert (
        own["drive.supply_V"]["origin"]
        == "hardware electronics: assumed; data sheet of the OPA549: 4 to 30 V"
    )


def test_the_text_has_the_same_facts_within_80_columns(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert cli.main(["explain", "plant.coulomb_Nm"]) == cli.DONE
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert "plant.coulomb_Nm = 0 0 0 N·m" in lines
    assert "plant.coulomb_Nm = 0.002 0.002 0.002 N·m" in lines
    assert "    origin: default" in lines
