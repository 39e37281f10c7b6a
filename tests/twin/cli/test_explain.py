"""Origins, units and distributions of fields; explanations of a scenario against its resolved values."""

from spheretwin.active_config import initial_config
from spheretwin.scenario import load
from spheretwin.scenario.fields import every_field, fields_of, unit_of
from spheretwin.scenario.hardware import ORIGINS
from spheretwin.scenario.sections import Scenario
from tests.twin.cli.calls import call


def explained(*subject):
    result = call("explain", *subject, "--json")
    assert (result.code, result.err) == (0, "")
    return {row["field"]: row for row in result.json["fields"]}


def test_every_stated_origin_says_assumed_or_names_its_source():
    assert set(ORIGINS["electronics"]) < set(ORIGINS["prototype"])
    sources = ("assumed", "data sheet of the ", "property of ", "computed from the ")
    assert all(text.startswith(sources) for text in ORIGINS["prototype"].values())


def test_each_drawn_error_states_its_distribution():
    """Fields whose meaning speaks of the seed or of noise, but for those of the controller and of inputs."""
    for name, field in every_field(Scenario):
        text = field.description or ""
        if name.startswith(("sensors.", "drive.", "plant.")) and ("from the seed" in text or " rms" in text):
            assert "distribution" in (field.json_schema_extra or {}), name


UNITS = {"rad", "V", "A", "s", "N·m", "N·m·s", "kg", "m/s²", "rad/s", "°C", "1/K", "J/K", "K/W", "m"}


def test_units_are_those_of_the_meanings():
    """Where a meaning ends with a unit, or has one before its source, it is the unit of the name."""
    compared = 0
    for name, field in every_field(Scenario):
        stated = (field.description or "").partition(" (")[0].partition("; ")[0].rpartition(", ")[2]
        if not name.startswith("controller.") and stated in UNITS:
            assert unit_of(name) == stated, name
            compared += 1
    assert compared > 50


def test_a_scenario_has_the_values_that_it_sets_and_those_that_follow(tmp_path):
    rows = explained("scenario", "tilt", "--all")
    resolved = initial_config(load("tilt"), None, None).scenario
    assert list(rows) == [dotted for dotted, *_ in fields_of(resolved)]
    assert rows["nominal.resistance_ohm"]["value"] == resolved.nominal.resistance_ohm
    assert all(row["meaning"] for row in rows.values())
    few = explained("scenario", "tilt")
    assert few == {name: row for name, row in rows.items() if not row["origin"].startswith("default")}
    path = tmp_path / "mine.toml"
    path.write_text(
        'name = "mine"\nhardware = "electronics"\n[trajectory]\nshape = "hold"\n[plant]\npayload_kg = 0.1\n'
    )
    own = explained("scenario", path)
    assert own["plant.payload_kg"]["origin"] == "scenario mine"
    assert (
        own["drive.supply_V"]["origin"] == f"hardware electronics: {ORIGINS['electronics']['drive.supply_V']}"
    )
