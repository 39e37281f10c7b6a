"""Origins, units and distributions of fields; explanations of a scenario against its resolved values."""

import json

from spheretwin.scenario.fields import every_field, unit_of
from spheretwin.scenario.hardware import ORIGINS
from spheretwin.scenario.sections import Scenario
from tests.twin.cli.calls import succeeded


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


def test_fields_of_a_file_have_their_origins(tmp_path):
    """Those of shipped scenarios are content."""
    (path := tmp_path / "mine.toml").write_text(
        'name = "mine"\nhardware = "electronics"\n[trajectory]\nshape = "hold"\n[plant]\npayload_kg = 0.1\n'
    )
    rows = json.loads(succeeded("explain", "scenario", path, "--json"))["fields"]
    origins = {row["field"]: row["origin"] for row in rows}
    assert origins["plant.payload_kg"] == "scenario mine"
    assert origins["drive.supply_V"] == f"hardware electronics: {ORIGINS['electronics']['drive.supply_V']}"
